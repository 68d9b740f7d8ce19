"""The primitives an index looks after."""

from typing import NamedTuple

from armguard.table import IntVector, Matrix, Vector


class World(NamedTuple):
    """Primitives in the world frame; the caller moves them, the index follows.

    Attributes:
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, see `geometry.shapes`, shape (p, 16).
        boxes: Their bounding boxes, lower and upper corner, shape (p, 6) [m].
        owners: Which object each is part of, from 0 on, shape (p,). Parts of one
            object are never checked against each other, so it is objects that the
            octree counts.
        growth: Extra radius each is indexed with: two primitives whose distance is at
            most the larger of their growths share a leaf, shape (p,) [m].
    """

    kinds: IntVector
    rows: Matrix
    boxes: Matrix
    owners: IntVector
    growth: Vector
