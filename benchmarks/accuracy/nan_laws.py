"""A NaN anywhere in a row has to come out as a NaN distance."""

import numpy as np

from accuracy.regimes import draw
from armguard.geometry import ShapeKind
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row

# How many numbers of a row a kind uses; 16 if it has a frame.
SHORT = {
    ShapeKind.SPHERE: 4,
    ShapeKind.CAPSULE: 7,
    ShapeKind.TRIANGLE: 10,
    ShapeKind.HALF_SPACE: 7,
}

# Addresses: they never leave a shape.
ADDRESSES = {ShapeKind.HULL: (4, 5, 6), ShapeKind.SUPPORT: (4, 5, 6)}


def swallowed(kind_a: ShapeKind, kind_b: ShapeKind) -> tuple[int, int]:
    """NaNs put into rows of a pair of kinds, and those that did not come out."""
    tried = missed = 0
    out = np.zeros(10)
    for number in range(4):
        pair = draw(kind_a, kind_b, "general", number)
        rows = [shape_row(pair.shape_a, pair.T_a), shape_row(pair.shape_b, pair.T_b)]
        for side, kind in enumerate((kind_a, kind_b)):
            for place in range(SHORT.get(kind, 16)):
                if place in ADDRESSES.get(kind, ()):
                    continue
                broken = [row.copy() for row in rows]
                broken[side][place] = np.nan
                measure(int(kind_a), broken[0], int(kind_b), broken[1], out)
                tried += 1
                missed += not np.isnan(out[0])
    return tried, missed
