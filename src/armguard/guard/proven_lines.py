"""Lines of a path that the checker of batches proves, before the guard judges the rest.

Both hold the same pairs to the same distances. The checker proves many lines some ten
times faster; the guard also measures exact hulls and held objects, and finds the first
place at which a pair is too near.
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
        checker: The checker.
        placed: Placement of each object that the checker was given, as bytes; empty for
            one that is absent.
    """

    tables: SceneTables
    objects: Objects
    holding: Holding
    checker: Checker | None = None
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
        if self.checker is None:
            needed = replace(self.tables, buffers=static_needs_of_groups(self.tables))
            self.checker = Checker(needed)
        self._place_objects(self.checker)
        return self.checker.prove(rows[:-1], rows[1:]).proven

    def _place_objects(self, checker: Checker) -> None:
        """Place and remove objects in the checker as they are in the guard."""
        tables, index = self.tables, self.objects.index
        changed = self.objects.changed.union(self.placed, tables.holds.objects)
        for name in sorted(changed):
            item = tables.standing[name]
            local = tables.local_rows if item.body >= 0 else index.world.rows
            # An object without a body takes the frame of another, which is not read.
            rows, frame = local[item.places], tables.T_parent_joint[item.body]
            there = index.state.residency["status"][item.first] != ABSENT
            placement = rows.tobytes() + frame.tobytes() if there else b""
            if self.placed.get(name) == placement:
                continue
            self.placed[name] = placement
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
