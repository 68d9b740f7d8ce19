"""The order of bodies and of primitives in the tables of a scene."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from armguard.robot.kinematics import (
    FIXED,
    KinematicTable,
    concatenate,
    kinematic_table,
)
from armguard.scene.blocks import Block
from armguard.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class Layout:
    """Bodies of a scene in the order of the tables: those of robots, then of objects.

    Attributes:
        scene: The scene.
        tables: Bodies of each robot.
        first: First body of each robot.
        own: Body of each object that may be gripped.
    """

    scene: Scene
    tables: Mapping[str, KinematicTable]
    first: Mapping[str, int]
    own: Mapping[str, int]

    @classmethod
    def of(cls, scene: Scene) -> "Layout":
        """The layout of a scene."""
        tables = {n: kinematic_table(r.model) for n, r in scene.robots.items()}
        ends = np.cumsum([0, *(len(t.parent) for t in tables.values())]).tolist()
        carried = [name for name, item in scene.objects.items() if item.graspable]
        return cls(
            scene=scene,
            tables=tables,
            first=dict(zip(tables, ends[:-1], strict=True)),
            own={name: ends[-1] + k for k, name in enumerate(carried)},
        )

    def body(self, robot: str, link: str) -> int:
        """Body of a link."""
        return self.first[robot] + self.tables[robot].body_of_link[link]

    def joined(self) -> KinematicTable:
        """One table of all bodies; objects that may be gripped are in the world."""
        bases = [robot.base.matrix() for robot in self.scene.robots.values()]
        table = concatenate(list(self.tables.values()), bases)
        count = len(self.own)
        poses = [self.scene.objects[name].pose.matrix() for name in self.own]
        frames = np.array([T[:3].reshape(12) for T in poses]).reshape(-1, 12)
        none = np.full(count, -1, dtype=np.int32)
        fixed = np.full(count, FIXED, dtype=np.int32)
        return replace(
            table,
            parent=np.concatenate([table.parent, none]),
            joint_kind=np.concatenate([table.joint_kind, fixed]),
            q_index=np.concatenate([table.q_index, none]),
            gain=np.concatenate([table.gain, np.tile([1.0, 0.0], (count, 1))]),
            T_parent_joint=np.concatenate([table.T_parent_joint, frames]),
            axis=np.concatenate([table.axis, np.tile([1.0, 0.0, 0.0], (count, 1))]),
        )


class PrimitiveNames(Sequence[str]):
    """A name for each primitive of a list of blocks, made when it is read.

    Args:
        blocks: The blocks, in the order of the tables.
        numbered: Whether primitives of an owner with several get a number, as in
            'table[3]'; otherwise all have their owner's name.
    """

    def __init__(self, blocks: Sequence[Block], *, numbered: bool) -> None:
        self._owners = [block.owner for block in blocks]
        self._offsets: list[int | None] = [
            block.first if numbered and not block.alone else None for block in blocks
        ]
        self._starts = [0]
        for block in blocks:
            self._starts.append(self._starts[-1] + len(block))

    def __len__(self) -> int:
        """How many primitives."""
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...

    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        """Name of one primitive, or of a slice of them."""
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(len(self))))
        place = range(len(self))[index]
        block = bisect_right(self._starts, place) - 1
        offset = self._offsets[block]
        owner = self._owners[block]
        if offset is None:
            return owner
        return f"{owner}[{offset + place - self._starts[block]}]"
