"""Primitives around a cylinder, in closed form where that is good enough."""

from math import cos, hypot, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box, Capsule, PlacedShape
from armguard.robot.fitting.cover import cover
from armguard.robot.fitting.enclose import SEAM

Floats = NDArray[np.float64]

# Sides of the prism that replaces a cylinder where several primitives are needed;
# it is drawn around the cylinder, and reaches 0.2 % of the radius beyond it.
SIDES = 48


def enclose_cylinder(
    radius: float, length: float, target: float = 0.030, max_primitives: int = 8
) -> tuple[PlacedShape, ...]:
    """Primitives around a cylinder along z about the origin, with their overreach.

    A capsule whose caps pass through the rims overreaches by (√2 - 1)·r; a rounded box
    with core r/√2 by (1 - 1/√2)·r. The capsule is taken if it overreaches no more than
    half the target, else the better of box and rounded box; where even that is above
    the target, several primitives.

    Args:
        radius: Radius [m].
        length: Full length [m].
        target: Overreach to stay below [m].
        max_primitives: Primitives to stay below.
    """
    half = length / 2.0
    inset = min(radius, half)
    cap = hypot(radius, inset)
    capsule = PlacedShape(
        Capsule(
            start=(0.0, 0.0, inset - half),
            end=(0.0, 0.0, half - inset),
            radius=cap + SEAM,
        ),
        Pose(),
        max(cap - inset, cap - radius) + SEAM,
    )
    if capsule.model_error <= 0.5 * target:
        return (capsule,)
    core = radius / sqrt(2.0)
    rounded = PlacedShape(
        Box(size=(2 * core, 2 * core, 2 * half), rounding=radius - core + SEAM),
        Pose(),
        radius - core + SEAM,
    )
    sharp = PlacedShape(
        Box(size=(2 * radius, 2 * radius, 2 * half), rounding=SEAM),
        Pose(),
        (sqrt(2.0) - 1.0) * radius + SEAM,
    )
    best = min((rounded, sharp, capsule), key=lambda placed: placed.model_error)
    if best.model_error <= target or max_primitives == 1:
        return (best,)
    prism = prism_triangles(radius / cos(pi / SIDES), half)
    shapes, reach = cover(prism, target=target, max_primitives=max_primitives)
    if max(reach) >= best.model_error:
        return (best,)
    # The prism reaches beyond the cylinder by at most this.
    beyond = radius / cos(pi / SIDES) - radius
    return tuple(
        PlacedShape(s.shape, s.pose, r + beyond)
        for s, r in zip(shapes, reach, strict=True)
    )


def prism_triangles(radius: float, half: float) -> Floats:
    """Triangles of a prism along z, shape (4 · SIDES, 3, 3) [m]."""
    angle = np.arange(SIDES + 1) * 2.0 * pi / SIDES
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    x[-1], y[-1] = x[0], y[0]
    triangles = []
    for k in range(SIDES):
        rim = [(x[k], y[k]), (x[k + 1], y[k + 1])]
        low = [(*p, -half) for p in rim]
        high = [(*p, half) for p in rim]
        triangles += [
            (low[0], low[1], high[0]),
            (low[1], high[1], high[0]),
            ((0.0, 0.0, -half), low[0], low[1]),
            ((0.0, 0.0, half), high[0], high[1]),
        ]
    return np.array(triangles)
