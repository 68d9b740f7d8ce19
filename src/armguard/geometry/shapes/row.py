"""A primitive as a row of a flat table.

A row is this many float64, whatever the kind; lengths in metres, in the frame the table
is for; places that are not named are 0:

    all         0 radius the core is grown by · 1-3 origin
    sphere      origin is the centre
    capsule     origin is one end · 4-6 the other
    triangle    origin is one corner · 4-6 and 7-9 the others
    half-space  origin is on the surface · 4-6 unit normal, out of the solid
    box         4-6 half extents of the core · 7-15 R
    cylinder    4 radius · 5 half height · 6 radius · 7-15 R
    cone        4 lower radius · 5 half height · 6 upper radius · 7-15 R
    ellipsoid   4-6 semi-axes · 7-15 R
    hull        4 address of its vertices · 5 how many · 6 reach · 7-15 R
    support     4 address of its numbers · 5 of its function · 6 reach · 7-15 R

R goes row by row; its columns are the axes of the shape's frame. *Reach* is the largest
distance of a point of the core from the origin. An address is a whole number below 2⁵³,
which a float64 holds exactly; an owner of such a row keeps the shape as well, since
the numbers at the address live as long as the shape does.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROW_WIDTH = 16


def empty_row(radius: float, origin: Floats) -> Floats:
    """A row with radius and origin, shape (ROW_WIDTH,)."""
    row = np.zeros(ROW_WIDTH)
    row[0] = radius
    row[1:4] = origin
    return row


def framed_row(radius: float, T: Floats, sizes: Sequence[float]) -> Floats:
    """A row with three numbers and a frame, shape (ROW_WIDTH,)."""
    row = empty_row(radius, T[:3, 3])
    row[4:7] = sizes
    row[7:16] = T[:3, :3].reshape(9)
    return row


class HasRow(Protocol):
    """Anything that can write its row."""

    def row(self, T: Floats) -> Floats:
        """Table row where the frame is at T."""


def shape_row(shape: HasRow, T: Floats | None = None) -> Floats:
    """Table row of a shape whose frame is at `T`, shape (ROW_WIDTH,).

    Args:
        shape: The shape.
        T: Its frame in the table's frame, shape (4, 4); identity if left out.
    """
    return shape.row(np.eye(4) if T is None else T)
