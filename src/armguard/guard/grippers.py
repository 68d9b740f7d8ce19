"""The grippers of a scene: choice of their models, and atomic changes of tables.

Held objects and contracts change between two cycles, while the primitives of the links
represent the grippers; the next cycle judges with the whole change.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from armguard.errors import GraspError, UnknownNameError, did_you_mean, known_names
from armguard.guard.grips import GripperModel, Grips
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import ABSENT
from armguard.scene.hold_tables import GripperPart
from armguard.scene.tables import SceneTables


@dataclass(frozen=True, slots=True)
class Grippers:
    """The grippers of a scene and their models.

    Attributes:
        tables: The scene.
        index: The index.
        grips: Arrays of contracts and grippers.
        world_changed: Callback; the loop measures every pair again.
        tables_changed: Callback; the loop reads changed tables of holds and contracts.
    """

    tables: SceneTables
    index: Octree | BruteForce
    grips: Grips
    world_changed: Callable[[], None]
    tables_changed: Callable[[], None]

    def of(self, robot: str) -> tuple[int, GripperPart]:
        """Index and tables of a robot's gripper.

        Raises:
            UnknownNameError: There is no such robot.
            GraspError: It has no gripper, or a robot has the mode "fixed".
        """
        robots = [part.name for part in self.tables.robots]
        numbers = {part.name: g for g, part in enumerate(self.tables.holds.grippers)}
        if robot not in robots:
            raise UnknownNameError(
                f"no robot is named '{robot}'; {known_names(robots)}"
            )
        if robot not in numbers:
            raise GraspError(
                f"robot '{robot}' has no gripper; give it `gripper: {{link: ..., "
                "fingers: [...]}` in the scene"
            )
        self.check_modes()
        g = numbers[robot]
        return g, self.tables.holds.grippers[g]

    def check_modes(self) -> None:
        """Refuse robots in mode "fixed": contracts need proofs with predicted stops.

        Raises:
            GraspError: A robot has the mode "fixed".
        """
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
            model: "coarse", one box; "detailed", the primitives of its links; "auto",
                the box while nothing is near.

        Raises:
            UnknownNameError: There is no such robot.
            GraspError: It has no gripper or no box, or there is no such model.
        """
        models = {
            "auto": GripperModel.AUTO,
            "coarse": GripperModel.COARSE,
            "detailed": GripperModel.DETAILED,
        }
        g, part = self.of(robot)
        if model not in models:
            raise GraspError(f"model is {model!r}; {did_you_mean(str(model), models)}")
        if part.coarse is None and model == "coarse":
            raise GraspError(
                f"the gripper of '{robot}' has no coarse model; leave out "
                "`coarse: false` in the scene"
            )
        self.grips.grippers[g].model = models[model]

    @contextmanager
    def detailed(self) -> Iterator[None]:
        """Represent every gripper by its links' primitives, between two cycles."""
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
        """Change held objects and contracts atomically, between two cycles."""
        with self.detailed():
            yield
        self.tables_changed()

    def show_detailed(self) -> list[int]:
        """Represent every gripper by the primitives of its links.

        Returns:
            Indices of the grippers that were represented by their box.
        """
        swapped = []
        for g, own in enumerate(self.grips.grippers):
            if own.box < 0 or not self.is_there(own.box):
                continue
            swapped += [g] if own.coarse else []
            for first, end in self._members(g):
                for i in range(first, end):
                    self.index.insert(i)
            self.index.remove(own.box)
            own.coarse = 0
        return swapped

    def show_coarse(self, g: int) -> None:
        """Represent a gripper by its box."""
        own = self.grips.grippers[g]
        self.index.insert(own.box)
        for first, end in self._members(g):
            for i in range(first, end):
                self.index.remove(i)
        own.coarse = 1

    def show_those_coarse(self) -> None:
        """Insert the boxes of the grippers whose row marks them as coarse."""
        for g, own in enumerate(self.grips.grippers):
            if own.coarse:
                self.show_coarse(g)
        if len(self.grips.grippers):
            self.world_changed()

    def is_there(self, i: int) -> bool:
        """Whether a primitive is in the index."""
        return bool(self.index.state.residency[i].status != ABSENT)

    def _members(self, g: int) -> list[tuple[int, int]]:
        """First primitive of each link of a gripper, and the index after its last."""
        part = self.tables.holds.grippers[g]
        return [self.tables.holds.places[member] for member in part.members]
