"""The capsule and the rounded box that overreach a set of points the least.

Both are given by a core alone: the radius follows as the largest distance of a point to
it. So every trial encloses all points, and a search without constraints finds the best.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.convex_hull import convex_hull, mesh_library
from armguard.geometry.pose import LOOKS_LIKE_DEGREES, Pose, rotation_from_rpy
from armguard.geometry.shapes import Box, Capsule, PlacedShape
from armguard.geometry.shapes.hull import distinct
from armguard.robot.fitting.hausdorff import (
    directions,
    judge_box,
    judge_capsule,
    support,
)

Floats = NDArray[np.float64]

# Growth of every fitted primitive [m]. Pieces of a mesh meet at cutting planes; grown
# by this much their primitives overlap there, so that a proof by subdivision ends.
SEAM = 5e-5

# A core thinner than this is a sheet; the rounding takes over [m].
LEAST_HALF = 1e-6

# Steps a search may take [-], and where it stops [m].
STEPS = 700
TOLERANCE = 1e-5

NORMALS = directions()


@dataclass(frozen=True, slots=True)
class Enclosure:
    """A primitive around points.

    Attributes:
        shape: The primitive.
        reach: How far it overreaches the convex hull of the points [m].
    """

    shape: PlacedShape
    reach: float


def hull_points(points: Floats) -> Floats:
    """The points that span the convex hull; all of them where there is none."""
    points, _ = distinct(points)
    if len(points) < 8:
        return points
    hull = convex_hull(points)
    return points if hull is None else np.asarray(points[hull.vertices])


def principal_axes(points: Floats) -> Floats:
    """Axes of the points' spread as columns, longest first, right-handed, (3, 3)."""
    centred = points - points.mean(axis=0)
    _, _, rows = np.linalg.svd(centred, full_matrices=False)
    axes = np.eye(3)
    if rows.shape == (3, 3):
        axes = rows.T.copy()
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return axes


def middle_and_half(points: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Centre of the box around points along axes, in the world, and half extents."""
    along = points @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    return axes @ ((low + high) / 2.0), (high - low) / 2.0


def best_capsule(points: Floats, *, refine: bool = True) -> Enclosure:
    """Capsule around points that overreaches their hull the least.

    Args:
        points: Points, shape (n, 3) [m].
        refine: Search further from the best axis.
    """
    inner = support(points, NORMALS)
    starts = []
    for axes in (principal_axes(points), np.eye(3)):
        centre, half = middle_and_half(points, axes)
        for k in range(3):
            others = np.delete(half, k)
            for inset in (0.4, 0.8):
                length = max(half[k] - inset * float(others.max()), 0.0)
                offset = axes[:, k] * length
                starts.append(np.concatenate([centre - offset, centre + offset]))
    ranked = sorted(starts, key=lambda e: judge_capsule(e, points, NORMALS, inner)[0])
    best = ranked[0]
    if refine:
        best = search(
            lambda ends: judge_capsule(ends, points, NORMALS, inner)[0], ranked[:2]
        )
    reach, radius = judge_capsule(best, points, NORMALS, inner)
    shape = Capsule(
        start=as_point(best[:3]), end=as_point(best[3:]), radius=float(radius + SEAM)
    )
    return Enclosure(PlacedShape(shape), float(reach + SEAM))


def best_box(points: Floats, *, refine: bool = True) -> Enclosure:
    """Box, sharp or rounded, around points that overreaches their hull the least.

    Args:
        points: Points, shape (n, 3) [m].
        refine: Search further from the best orientation.
    """
    inner = support(points, NORMALS)
    starts = []
    for axes in (principal_axes(points), np.eye(3)):
        centre, half = middle_and_half(points, axes)
        for share in (0.0, 0.3, 0.7):
            core = np.maximum(half - share * half.min(), LEAST_HALF)
            starts.append(
                np.concatenate([centre, core, Pose.from_matrix(lift(axes)).rpy])
            )

    def judge(numbers: Floats) -> tuple[float, float]:
        R = rotation_from_rpy(*numbers[6:].tolist())
        core = np.maximum(numbers[3:6], LEAST_HALF)
        found: tuple[float, float] = judge_box(
            numbers[:3], core, R, points, NORMALS, inner
        )
        return found

    ranked = sorted(starts, key=lambda s: judge(s)[0])
    best = ranked[0]
    if refine:
        best = search(lambda numbers: judge(numbers)[0], ranked[:2])
    reach, rounding = judge(best)
    shape = Box(
        size=as_point(2.0 * np.maximum(best[3:6], LEAST_HALF)),
        rounding=float(rounding + SEAM),
    )
    # Whole turns, which a search may add, change no rotation.
    turn = np.fmod(best[6:], LOOKS_LIKE_DEGREES)
    pose = Pose(xyz=as_point(best[:3]), rpy=as_point(turn))
    return Enclosure(PlacedShape(shape, pose), float(reach + SEAM))


def search(judge: Callable[[Floats], float], starts: list[Floats]) -> Floats:
    """Best of several searches without derivatives; the figure has kinks."""
    minimize = mesh_library("scipy.optimize").minimize
    best, least = starts[0], judge(starts[0])
    for start in starts:
        found = minimize(
            judge,
            start,
            method="Nelder-Mead",
            options={
                "maxfev": STEPS,
                "xatol": TOLERANCE,
                "fatol": TOLERANCE,
                "adaptive": True,
                "initial_simplex": simplex(start),
            },
        )
        if found.fun < least:
            best, least = found.x, float(found.fun)
    return best


def simplex(start: Floats) -> Floats:
    """First simplex of a search: a centimetre, or a tenth of a radian, each way."""
    steps = np.full(len(start), 0.01)
    steps[6:] = 0.1
    return np.vstack([start, start + np.diag(steps)])


def lift(R: Floats) -> Floats:
    """A rotation as a transform, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = R
    return T


def as_point(values: Floats) -> tuple[float, float, float]:
    """Three numbers as plain floats."""
    x, y, z = (float(v) for v in values)
    return (x, y, z)
