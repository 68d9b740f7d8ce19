"""Signed distance by another road: slow, and nothing in common with the kernels.

The signed distance of two convex bodies is the largest separation over all directions,
  sd = max over unit n of  -h_A(n) - h_B(-n)  (h: support function),
apart as well as overlapping. It is found by trying many directions and climbing from
the best; where they overlap, the faces of the difference body are tried one by one.
"""

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    Sphere,
    Triangle,
)


def corners(shape, T):
    """Points that span the core, in the world, and the radius it is grown by."""
    if isinstance(shape, Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        points = signs * np.array(shape.half_extents)
        radius = shape.rounding
    elif isinstance(shape, Capsule):
        points = np.array([shape.start, shape.end])
        radius = shape.radius + shape.rounding
    else:
        points, radius = np.zeros((1, 3)), shape.radius + shape.rounding
    return points @ T[:3, :3].T + T[:3, 3], radius


def surface(shape, T, count=400):
    """Points of the core that reach its bounds, in the world; curved cores sampled."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    if isinstance(shape, Box | Capsule | Sphere):
        return corners(shape, T)[0]
    if isinstance(shape, Triangle):
        points = np.array([shape.a, shape.b, shape.c])
    elif isinstance(shape, Hull):
        points = shape.points
    elif isinstance(shape, Cylinder | Cone):
        top = shape.radius if isinstance(shape, Cylinder) else shape.top_radius
        up = np.array([0.0, 0.0, shape.height / 2.0])
        points = np.concatenate([shape.radius * ring - up, top * ring + up])
    elif isinstance(shape, Ellipsoid):
        points = sphere_points(20 * count) * np.array(shape.semi_axes)
    else:
        parameters = shape.parameters
        points = np.array(
            [type(shape).support(parameters, *d) for d in sphere_points(20 * count)]
        )
    return points @ T[:3, :3].T + T[:3, 3]


def sphere_points(count):
    """Points spread evenly over the unit sphere: a golden spiral."""
    k = np.arange(count) + 0.5
    height = 1.0 - 2.0 * k / count
    out = np.sqrt(1.0 - height**2)
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    return np.stack([out * np.cos(turn), out * np.sin(turn), height], axis=1)


def signed_distance(shape_a, T_a, shape_b, T_b):
    """Signed distance of two shapes [m]."""
    a, radius_a = corners(shape_a, T_a)
    b, radius_b = corners(shape_b, T_b)
    difference = (b[:, None] - a[None]).reshape(-1, 3)
    return core_distance(difference) - radius_a - radius_b


def core_distance(points):
    """Signed distance of the origin to the convex hull of points [m].

    Inside a hull with volume: minus the distance to the nearest face. Outside, or
    where the hull is flat: the smallest norm of a convex combination.
    """
    spread = points - points.mean(axis=0)
    if np.linalg.matrix_rank(spread, tol=1e-9) == 3:
        faces = ConvexHull(points).equations
        inside = faces[:, 3].max()
        if inside <= 0.0:
            return float(inside)
    return smallest_norm(points)


def smallest_norm(points):
    """Distance of the origin to the convex hull of points, by quadratic programming."""
    scale = float(np.abs(points).max()) or 1.0
    p = points / scale
    count = len(p)
    best = np.inf
    for start in (np.full(count, 1.0 / count), np.eye(count)[np.argmin((p**2).sum(1))]):
        found = minimize(
            lambda w: float(((w @ p) ** 2).sum()),
            start,
            jac=lambda w: 2.0 * p @ (w @ p),
            bounds=[(0.0, 1.0)] * count,
            constraints={"type": "eq", "fun": lambda w: w.sum() - 1.0,
                         "jac": lambda w: np.ones(count)},
            method="SLSQP",
            options={"ftol": 1e-18, "maxiter": 500},
        )  # fmt: skip
        best = min(best, float(np.linalg.norm(found.x @ p)))
    return best * scale
