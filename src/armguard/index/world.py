"""World: the primitives of an index."""

from typing import NamedTuple

from armguard.table import IntVector, Matrix, Vector


class World(NamedTuple):
    """Primitives in the world frame; the caller moves them and updates the index.

    Attributes:
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Row of each primitive, see `geometry.shapes`, shape (p, 16).
        boxes: Lower and upper corner of each bounding box, shape (p, 6) [m].
        owners: Object of each primitive, from 0 on, shape (p,). Parts of one object are
            never checked against each other, so the octree counts objects.
        growth: Extra radius of each primitive in the index: two primitives whose
            distance is at most the larger of their growths share a leaf, (p,) [m].
    """

    kinds: IntVector
    rows: Matrix
    boxes: Matrix
    owners: IntVector
    growth: Vector
