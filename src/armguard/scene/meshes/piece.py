"""A convex piece of a mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A convex piece of a mesh.

    Attributes:
        points: Points whose hull it is, shape (n, 3) [m].
        growth: How far the hull is grown so that every vertex of the mesh that is
            nearest to it lies inside [m].
        overreach: How far the grown hull reaches beyond the mesh [m].
    """

    points: Floats
    growth: float
    overreach: float
