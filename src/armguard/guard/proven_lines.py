"""Lines of a path that the checker of batches proves, before the guard judges the rest.

Both hold the same pairs to the same distances. The checker proves many lines some ten
times faster; the guard also judges contracts of held objects, and finds the first place
at which a pair is too near.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.guard.continuous import RESOLUTION
from armguard.guard.holding import Holding
from armguard.guard.objects import Objects
from armguard.guard.static_errors import static_errors
from armguard.index.octree_state import ABSENT
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Fewer lines are judged by the guard alone, in less than a millisecond. Its retreat
# checks single lines in the loop, where no kernels may be loaded.
FEW = 32


@dataclass(slots=True)
class ProvenLines:
    """The checker of a guard, made for the first long path.

    Attributes:
        tables: The scene.
        objects: Objects and their present poses.
        holding: Held objects.
        kept: The checker.
        placed: Placement of each object that the checker was given, as bytes; empty for
            one that is absent.
    """

    tables: SceneTables
    objects: Objects
    holding: Holding
    kept: Checker | None = None
    placed: dict[str, bytes] = field(default_factory=dict)

    def among(self, rows: Floats, resolution: float) -> NDArray[np.bool_]:
        """Which straight lines between rows are proven to keep every distance.

        None is while an object is held, among fewer than 32 lines, or where the guard
        would not bisect as far as the checker does.

        Args:
            rows: Joint positions, shape (k, n) [rad or m].
            resolution: See `check_path` [rad or m].

        Returns:
            Shape (max(k - 1, 1),).
        """
        if len(rows) <= FEW or self.holding.holders or resolution > RESOLUTION:
            return np.zeros(max(len(rows) - 1, 1), dtype=np.bool_)
        if self.kept is None:
            needed = replace(self.tables, buffers=static_needs_of_groups(self.tables))
            self.kept = Checker(needed)
        self.place_objects(self.kept, self.placed)
        return self.kept.prove(rows[:-1], rows[1:]).proven

    def checker(self, threads: int = 1) -> Checker:
        """A `Checker` of the world as it is now, for planning from here on.

        Placed, removed and held objects are as in the guard, and so are allowed pairs:
        a held object moves with its gripper and may touch it. Later changes of the
        guard do not reach it.

        Args:
            threads: See `Checker`.

        Raises:
            SceneError: `threads` is below 1.

        Example:
            >>> from armguard import Guard, bay_scene
            >>> guard = Guard(bay_scene())
            >>> guard.checker().clear([guard.home]).tolist()
            [True]
        """
        return self._checker_with(self.tables.buffers, {}, threads)

    def strict_checker(self, placed: dict[str, bytes]) -> Checker:
        """The same, with distances that the guard requires of measured positions.

        Args:
            placed: Written for `place_objects`.
        """
        return self._checker_with(static_needs_of_groups(self.tables), placed, 1)

    def _checker_with(
        self, buffers: Floats, placed: dict[str, bytes], threads: int
    ) -> Checker:
        """A checker of the world as it is now, with these buffers of groups."""
        changing = ("parent", "T_parent_joint", "checked")
        now = {name: getattr(self.tables, name).copy() for name in changing}
        checker = Checker(replace(self.tables, **now, buffers=buffers), threads)
        self.place_objects(checker, placed)
        return checker

    def place_objects(self, checker: Checker, placed: dict[str, bytes]) -> None:
        """Place and remove objects in a checker as they are in the guard.

        Args:
            checker: The checker.
            placed: What it was given, see `placed` above; updated.
        """
        tables, index = self.tables, self.objects.index
        changed = self.objects.changed.union(placed, tables.holds.objects)
        # The tables have a held object where it is on its gripper.
        for name in sorted(changed - set(self.holding.holders)):
            item = tables.standing[name]
            local = tables.local_rows if item.body >= 0 else index.world.rows
            # An object without a body takes the frame of another, which is not read.
            rows, frame = local[item.places], tables.T_parent_joint[item.body]
            there = index.state.residency["status"][item.first] != ABSENT
            placement = rows.tobytes() + frame.tobytes() if there else b""
            if placed.get(name) == placement:
                continue
            placed[name] = placement
            if there:
                checker.place_rows(name, rows, frame)
            else:
                checker.remove(name)


def static_needs_of_groups(tables: SceneTables) -> Floats:
    """Upper bound of the static need of each two groups' primitives, shape (g, g) [m].

    All primitives of a group that moves ride on one body.
    """
    moving = tables.groups[: tables.moving_count]
    found = static_errors(tables)
    link, robot = np.zeros((2, len(tables.buffers)))
    np.maximum.at(link, moving, found["link_error"])
    np.maximum.at(robot, moving, found["robot_error"])
    owner = np.full(len(tables.buffers), -1)
    owner[moving] = tables.robot_of_primitive
    between = np.where(owner[:, None] != owner, robot[:, None] + robot, 0.0)
    return np.asarray(tables.buffers + link[:, None] + link + between)
