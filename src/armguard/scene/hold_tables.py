"""Grippers and what they may grip, in the tables; which groups are checked."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.scene.gripping import Grasp

Bytes = NDArray[np.uint8]

# What the name of a gripper's coarse box ends with.
COARSE = " (coarse)"


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperPart:
    """A gripper in the tables.

    Attributes:
        robot: Number of its robot.
        name: That robot's name.
        link: 'robot/link' of its link.
        body: Body of that link.
        fingers: Links that may touch what is gripped, 'robot/link'; those with
            primitives.
        members: All links of it that have primitives.
        coarse: Name of the box around them; None if there is none.
        swap: Distance at which the box is replaced, see `Gripper` [m].
    """

    robot: int
    name: str
    link: str
    body: int
    fingers: tuple[str, ...]
    members: tuple[str, ...]
    coarse: str | None
    swap: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Graspable:
    """An object that may be gripped, in the tables.

    Attributes:
        name: Its name.
        body: Its body: static in the world, or riding on a gripper's.
        group: Its rule group.
        grasp: How it may be gripped.
        rests_on: Bodies it may be put down on; None for what it rests on.
    """

    name: str
    body: int
    group: int
    grasp: Grasp
    rests_on: tuple[str, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldTables:
    """All that gripping needs beside the other tables.

    Attributes:
        grippers: Grippers, in the order of their robots.
        objects: What may be gripped, by name.
        places: First primitive of each body, and the one after its last, by name.
        group_of: Rule group of each body, by name.
        rules: 1 where two groups are checked as soon as a robot moves one of them,
            shape (g, g).
        still: 1 for groups of what never moves, shape (g,).
    """

    grippers: tuple[GripperPart, ...]
    objects: Mapping[str, Graspable]
    places: Mapping[str, tuple[int, int]]
    group_of: Mapping[str, int]
    rules: Bytes
    still: Bytes

    def checked(
        self, held: Iterable[str] = (), exempt: Iterable[tuple[int, int]] = ()
    ) -> Bytes:
        """Which groups are checked at present, shape (g, g).

        What no robot carries is checked against robots and what they carry, not
        against what is static like itself.

        Args:
            held: Objects that a gripper holds.
            exempt: Groups that touch each other for it.
        """
        carried = self.still == 0
        for name, item in self.objects.items():
            carried[item.group] = name in held
        now = self.rules * (carried[:, None] | carried[None, :])
        for a, b in exempt:
            now[a, b] = now[b, a] = 0
        return np.asarray(now, dtype=np.uint8)


def free_coarse(
    rules: Bytes,
    buffers: NDArray[np.float64],
    group_of: Mapping[str, int],
    grippers: Iterable[GripperPart],
) -> None:
    """Treat each gripper's box as its members together are treated, in place.

    Args:
        rules: Which groups are checked.
        buffers: Required distances of groups [m].
        group_of: Rule group of each body.
        grippers: The grippers.
    """
    for part in grippers:
        if part.coarse is None:
            continue
        box, own = group_of[part.coarse], [group_of[m] for m in part.members]
        rules[box] = rules[own].max(axis=0)
        rules[box, [*own, box]] = 0
        rules[:, box] = rules[box]
        buffers[box] = buffers[own].max(axis=0)
        buffers[:, box] = buffers[box]
