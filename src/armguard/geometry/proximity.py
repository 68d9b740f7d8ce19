"""Signed distance of two shapes, for people: the kernels of the cycle, one call."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.pairs import measure
from armguard.geometry.pose import Pose, check_transform
from armguard.geometry.shapes import Shape, shape_row
from armguard.geometry.witness import WITNESS_WIDTH

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Proximity:
    """How two shapes stand to each other: point_b - point_a = distance · normal.

    Attributes:
        distance: Signed distance; negative is minus the length of the shortest
            translation that separates the shapes [m].
        point_a: Witness point on A, world, shape (3,) [m].
        point_b: Witness point on B, world, shape (3,) [m].
        normal: Unit vector from A to B, world, shape (3,).
    """

    distance: float
    point_a: Floats
    point_b: Floats
    normal: Floats


def distance(
    shape_a: Shape,
    pose_a: Pose | ArrayLike,
    shape_b: Shape,
    pose_b: Pose | ArrayLike,
) -> Proximity:
    """Signed distance of two shapes, with witness points and normal.

    Args:
        shape_a: Shape A.
        pose_a: Its frame in the world, a `Pose` or a transform of shape (4, 4).
        shape_b: Shape B.
        pose_b: Its frame in the world.

    Raises:
        PoseError: A transform is not rigid.

    Example:
        >>> from armguard import Box, Pose, Sphere, distance
        >>> ball, block = Sphere(radius=0.1), Box(half_extents=(0.5, 0.5, 0.5))
        >>> near = distance(ball, Pose(xyz=(0.8, 0, 0)), block, Pose())
        >>> round(near.distance, 9), near.normal.tolist()
        (0.2, [-1.0, 0.0, 0.0])
    """
    out = np.zeros(WITNESS_WIDTH)
    measure(
        int(shape_a.kind),
        shape_row(shape_a, transform_of("pose_a", pose_a)),
        int(shape_b.kind),
        shape_row(shape_b, transform_of("pose_b", pose_b)),
        out,
    )
    return Proximity(float(out[0]), out[1:4], out[4:7], out[7:10])


def transform_of(name: str, pose: Pose | ArrayLike) -> Floats:
    """A pose as a transform, shape (4, 4)."""
    return pose.matrix() if isinstance(pose, Pose) else check_transform(name, pose)
