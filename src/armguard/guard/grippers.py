"""The grippers of a scene: which model represents each, and how tables change at once.

What a gripper holds and what may touch what is changed between two cycles, by the
links' own primitives; the next cycle judges with all of the change.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from armguard.errors import GraspError, UnknownNameError, did_you_mean
from armguard.guard import grips as at
from armguard.guard.grips import Grips
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import ABSENT, STATUS
from armguard.scene.hold_tables import GripperPart
from armguard.scene.tables import SceneTables


@dataclass(frozen=True, slots=True)
class Grippers:
    """The grippers of a scene and their models.

    Attributes:
        tables: The scene.
        index: The index.
        grips: Contracts and grippers.
        world_changed: Has the loop measure every pair afresh.
        tables_changed: Has it take over who holds or may touch what.
    """

    tables: SceneTables
    index: Octree | BruteForce
    grips: Grips
    world_changed: Callable[[], None]
    tables_changed: Callable[[], None]

    def of(self, robot: str) -> tuple[int, GripperPart]:
        """Number and part of a robot's gripper."""
        robots = [part.name for part in self.tables.robots]
        numbers = {part.name: g for g, part in enumerate(self.tables.holds.grippers)}
        if robot not in robots:
            raise UnknownNameError(
                f"no robot is named '{robot}'; {did_you_mean(str(robot), robots)}"
            )
        if robot not in numbers:
            raise GraspError(
                f"robot '{robot}' has no gripper; give it `gripper: {{link: ..., "
                "fingers: [...]}}` in the scene"
            )
        self.check_modes()
        g = numbers[robot]
        return g, self.tables.holds.grippers[g]

    def check_modes(self) -> None:
        """Contracts are proven, and proofs predict stops."""
        for part in self.tables.robots:
            if part.mode == "fixed":
                raise GraspError(
                    f"robot '{part.name}' has the mode 'fixed', which predicts no "
                    "stops; contracts need 'path' or 'speed'"
                )

    def swap_model(self, robot: str, model: str) -> None:
        """Choose the model of a robot's gripper, from the next cycle on.

        Args:
            robot: The robot.
            model: "coarse", one box; "detailed", the links' own primitives; "auto",
                the box while nothing is near.

        Raises:
            UnknownNameError: There is no such robot.
            GraspError: It has no gripper or no box, or there is no such model.
        """
        models = {"auto": at.AUTO, "coarse": at.COARSE, "detailed": at.DETAILED}
        g, part = self.of(robot)
        if model not in models:
            raise GraspError(f"model is {model!r}; {did_you_mean(str(model), models)}")
        if part.coarse is None and model == "coarse":
            raise GraspError(
                f"the gripper of '{robot}' has no coarse model; leave out "
                "`coarse: false` in the scene"
            )
        self.grips.grippers[g, at.MODEL] = models[model]

    @contextmanager
    def detailed(self) -> Iterator[None]:
        """Let links' own primitives stand for every gripper, outside of the loop."""
        swapped = self.show_detailed()
        if swapped:
            self.world_changed()
        try:
            yield
        finally:
            for g in swapped:
                self.show_coarse(g)
            if swapped:
                self.world_changed()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Change who holds or may touch what, all at once."""
        with self.detailed():
            yield
        self.tables_changed()

    def show_detailed(self) -> list[int]:
        """Let its links' own primitives stand for every gripper.

        Returns:
            Those whose box stood for them.
        """
        swapped = []
        for g, own in enumerate(self.grips.grippers):
            if own[at.BOX] < 0 or not self.is_there(int(own[at.BOX])):
                continue
            swapped += [g] if own[at.COARSE_NOW] else []
            for first, end in self._members(g):
                for i in range(first, end):
                    self.index.insert(i)
            self.index.remove(int(own[at.BOX]))
            own[at.COARSE_NOW] = 0
        return swapped

    def show_coarse(self, g: int) -> None:
        """Let its box stand for a gripper."""
        own = self.grips.grippers[g]
        self.index.insert(int(own[at.BOX]))
        for first, end in self._members(g):
            for i in range(first, end):
                self.index.remove(i)
        own[at.COARSE_NOW] = 1

    def show_those_coarse(self) -> None:
        """Let their boxes stand for those grippers that are said to have them."""
        for g, own in enumerate(self.grips.grippers):
            if own[at.COARSE_NOW]:
                self.show_coarse(g)
        if len(self.grips.grippers):
            self.world_changed()

    def is_there(self, i: int) -> bool:
        """Whether a primitive is in the index."""
        return bool(self.index.state.residency[i, STATUS] != ABSENT)

    def _members(self, g: int) -> list[tuple[int, int]]:
        """First primitive of each link of a gripper, and the one after its last."""
        part = self.tables.holds.grippers[g]
        return [self.tables.holds.places[member] for member in part.members]
