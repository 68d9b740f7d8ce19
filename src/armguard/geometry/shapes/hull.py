"""The convex hull of points."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import ShapeError
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import Floats, framed_row
from armguard.geometry.shapes.sizes import check_size

# Below this share of their extent, points count as lying in a plane or a line [-].
FLAT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Hull:
    """The convex hull of points, grown by `rounding`.

    One point, points in a line and points in a plane are legal hulls. Points that are
    not corners are left out; what remains is in `vertices`.

    Attributes:
        points: Points, shape (n, 3) with n >= 1 [m].
        rounding: Growth outwards, which rounds edges and corners [m].
        vertices: The corners, in the order in which they were given, shape (k, 3) [m].

    Raises:
        ShapeError: There are no points, a number is not finite, or the rounding is
            negative.

    Example:
        >>> from armguard import Hull
        >>> len(Hull(points=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, 0)]).vertices)
        3
    """

    kind: ClassVar[ShapeKind] = ShapeKind.HULL
    points: ArrayLike = field(repr=False)
    rounding: float = 0.0
    vertices: Floats = field(init=False, repr=False)
    columns: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the points and find the corners."""
        check_size("Hull", "rounding", self.rounding, zero=True)
        points = np.asarray(self.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or len(points) == 0:
            raise ShapeError(
                f"Hull points have shape {points.shape}; it must be (n, 3), n >= 1"
            )
        if not np.isfinite(points).all():
            bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
            raise ShapeError(f"Hull point {bad} is {points[bad]}; it must be finite")
        vertices = points[corners(points)]
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "vertices", vertices)
        # What rows lead to: all x, then all y, then all z, as the support scan reads,
        # and the last one twice where that makes their number even.
        even = np.vstack([vertices, vertices[len(vertices) - len(vertices) % 2 :]])
        object.__setattr__(self, "columns", np.ascontiguousarray(even.T))

    def __repr__(self) -> str:
        """Count of corners, and the rounding."""
        return f"<Hull of {len(self.vertices)} points, rounding {self.rounding:g} m>"

    @property
    def core_radius(self) -> float:
        """Radius the core is grown by [m]."""
        return self.rounding

    def row(self, T: Floats) -> Floats:
        """Table row with the frame at T; the shape must outlive it."""
        reach = float(np.linalg.norm(self.vertices, axis=1).max())
        sizes = (self.columns.ctypes.data, self.columns.shape[1], reach)
        return framed_row(self.rounding, T, sizes)

    @classmethod
    def example(cls, rng: np.random.Generator, size: float) -> "Hull":
        """A random one of about this size [m]: 1 to 40 points, some of them flat."""
        points = size * rng.uniform(-1.0, 1.0, (int(rng.integers(1, 41)), 3))
        if rng.integers(4) == 0:
            points[:, 2] = 0.0
        return cls(points=points, rounding=0.1 * size * rng.integers(2))


def corners(points: Floats) -> NDArray[np.intp]:
    """Indices of the points that are corners of the convex hull, ascending.

    Where the points lie in a plane or a line, the hull is that of their projection.
    """
    unique, first = distinct(points)
    if len(unique) == 1:
        return first[:1]
    centred = unique - unique.mean(axis=0)
    _, extent, axes = np.linalg.svd(centred, full_matrices=False)
    if len(extent) < 2 or extent[1] <= FLAT * extent[0]:
        along = centred @ axes[0]
        return np.sort(first[[int(along.argmin()), int(along.argmax())]])
    flat = len(extent) < 3 or extent[2] <= FLAT * extent[0]
    inside = centred @ axes[:2].T if flat else centred
    # Scaled to a unit extent along each axis: qhull's tolerances are absolute.
    return np.sort(first[hull_indices(inside)])


def distinct(points: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Points without repetition, sorted, and the index of the first of each.

    As `np.unique` along an axis has them, several times faster.
    """
    order = np.lexsort(points.T[::-1])
    sorted_ = points[order]
    new = np.ones(len(points), dtype=np.bool_)
    new[1:] = (sorted_[1:] != sorted_[:-1]).any(axis=1)
    return sorted_[new], order[new]


def hull_indices(points: Floats) -> Sequence[int] | NDArray[np.intp]:
    """Corners of points that span their space; all of them where qhull fails."""
    spread = np.ptp(points, axis=0)
    scaled = (points - points.min(axis=0)) / spread.max()
    hull = convex_hull(scaled)
    if hull is None:
        # Nearly flat: more vertices than needed give the same hull.
        return range(len(points))
    return np.asarray(hull.vertices, dtype=np.intp)
