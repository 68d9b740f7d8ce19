"""Smith's test of overlap: edges of one polyhedron, clipped by the planes of the other.

The overlap of two convex polyhedra has corners: corners of one within the other, and
places at which an edge of one passes a face of the other. Each is on an edge that the
other's planes do not clip away. It shares no line with the kernels, which search for a
separating direction; Smith (1985) does it in hardware made for graphics.
"""

from typing import Any, NamedTuple

import numpy as np

from accuracy.regimes import Pair, Rng, measured, moved_to, placed, scale
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.shapes import Box, Hull
from arrays import Floats

# Signed distances of this size and less are not compared [m].
BAND = 1e-9

# Gaps of pairs that nearly touch are powers of ten between these [m].
GAPS = (-8.5, -5.0)
NEAR = 1e-5

# Placements of each two shapes.
PLACES = 8


class Polyhedron(NamedTuple):
    """A convex polyhedron in the world.

    Attributes:
        starts: First ends of its edges, shape (e, 3) [m].
        ways: From there to the other ends, shape (e, 3) [m].
        normals: Normals of its planes, outward, shape (f, 3).
        heights: Heights of its planes, shape (f,) [m].
    """

    starts: Floats
    ways: Floats
    normals: Floats
    heights: Floats

    def at(self, T: Floats) -> "Polyhedron":
        """The same in the world, its frame at T."""
        R, p = T[:3, :3], T[:3, 3]
        normals = self.normals @ R.T
        heights = self.heights + normals @ p
        return Polyhedron(self.starts @ R.T + p, self.ways @ R.T, normals, heights)


def polyhedron(shape: Box | Hull) -> Polyhedron:
    """A box or a hull in its own frame."""
    if isinstance(shape, Hull):
        points = shape.vertices
    else:
        half = np.array(shape.size) / 2.0
        points = half * np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    hull = convex_hull(points)
    ends = hull.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    starts, others = points[ends[:, 0]], points[ends[:, 1]]
    equations = hull.equations
    return Polyhedron(starts, others - starts, equations[:, :3], -equations[:, 3])


def keeps_a_part(one: Polyhedron, other: Polyhedron) -> bool:
    """Whether planes of the other leave a part of an edge of the first."""
    above = one.starts @ other.normals.T - other.heights
    rise = one.ways @ other.normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -above / rise
    enters = np.where(rise < 0.0, crossing, 0.0).max(axis=1)
    leaves = np.where(rise > 0.0, crossing, 1.0).min(axis=1)
    beside = ((rise == 0.0) & (above > 0.0)).any(axis=1)
    kept = ~beside & (np.maximum(enters, 0.0) <= np.minimum(leaves, 1.0))
    return bool(kept.any())


def drawn_shape(rng: Rng) -> Box | Hull:
    """A box or a hull of random points, of a tenth to one metre."""
    size = 10.0 ** rng.uniform(-1, 0)
    if rng.integers(2):
        return Box(size=tuple(size * rng.uniform(0.2, 1.0, 3)))
    points = size * rng.uniform(-0.5, 0.5, (int(rng.integers(4, 20)), 3))
    return Hull(points=points)


def drawn_pair(rng: Rng, a: Any, b: Any) -> Pair:
    """Both shapes anywhere, or so that they nearly touch."""
    pair = placed(rng, a, b, rng.uniform(0.2, 0.9))
    if rng.integers(2):
        gap = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(*GAPS)
        pair = moved_to(pair, gap * scale(pair))
    return pair


def compared(seed: int, count: int) -> dict[str, int]:
    """How often the sign of the distance and the clipped edges agree.

    Args:
        seed: Of the pairs.
        count: How many pairs of shapes, each at PLACES.
    """
    rng = np.random.default_rng([seed, 95])
    found = {"pairs": 0, "overlapping": 0, "near": 0, "left_out": 0, "wrong": 0}
    for _ in range(count):
        a, b = drawn_shape(rng), drawn_shape(rng)
        one, other = polyhedron(a), polyhedron(b)
        for _ in range(PLACES):
            pair = drawn_pair(rng, a, b)
            distance = float(measured(pair)[0])
            if abs(distance) <= BAND:
                found["left_out"] += 1
                continue
            first, second = one.at(pair.T_a), other.at(pair.T_b)
            clipped = keeps_a_part(first, second) or keeps_a_part(second, first)
            found["pairs"] += 1
            found["overlapping"] += clipped
            found["near"] += abs(distance) < NEAR
            found["wrong"] += clipped != (distance < 0.0)
    return found
