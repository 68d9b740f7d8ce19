"""Objects that stand still, and may come, go and stand elsewhere while a guard runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import PlacedShape
from armguard.scene.blocks import Block, blocks_of, stacked_rows
from armguard.scene.meshes.surface import Surface
from armguard.scene.objects import SceneObject

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Standing:
    """A static object, and its place in the tables.

    Attributes:
        first: Its first primitive.
        count: How many it has.
        present: Whether it is there from the start.
        shapes: Its shapes, in its own frame.
        surfaces: Its triangles, in its own frame.
        body: Its own body if it may be gripped, else -1.
        error: How far off it may be seen [m].
        stale: Age from which on a sighting of it is refused [s].
    """

    first: int
    count: int
    present: bool
    shapes: tuple[PlacedShape, ...]
    surfaces: tuple[Surface, ...]
    body: int = -1
    error: float = 0.0
    stale: float = inf

    @property
    def places(self) -> slice:
        """Places of its primitives in the tables."""
        return slice(self.first, self.first + self.count)

    def rows(self, T: Floats) -> Floats:
        """Rows of its primitives where its frame is at T, shape (count, 16)."""
        return stacked_rows(list(blocks_of("", self.shapes, self.surfaces, T, -1)))


def standing_objects(
    blocks: Sequence[Block], objects: Mapping[str, SceneObject]
) -> dict[str, Standing]:
    """Objects that are attached to nothing, by name.

    Args:
        blocks: All blocks in the order of the tables.
        objects: All objects of the scene.
    """
    first: dict[str, int] = {}
    body: dict[str, int] = {}
    count: dict[str, int] = {}
    start = 0
    for block in blocks:
        first.setdefault(block.owner, start)
        body[block.owner] = block.body
        count[block.owner] = count.get(block.owner, 0) + len(block)
        start += len(block)
    return {
        name: Standing(
            first[name],
            count[name],
            thing.present,
            thing.shapes,
            thing.surfaces,
            body[name],
            thing.error,
            thing.stale,
        )
        for name, thing in objects.items()
        if thing.attached_to is None
    }
