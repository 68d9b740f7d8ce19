"""Kernels about bodies: how far they may be from where joint positions place them."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, norm, sub
from armguard.kernel import kernel
from armguard.robot.kinematics import FIXED, PRISMATIC

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]

# Columns of the table of joints: the kind of the joint, and its place in q.
KIND, PLACE = 0, 1


@kernel
def point_in(T: Floats, point: Vec3) -> Vec3:
    """A point of a frame, shape (12,), in the world [m]."""
    x, y, z = point
    return (
        T[0] * x + T[1] * y + T[2] * z + T[3],
        T[4] * x + T[5] * y + T[6] * z + T[7],
        T[8] * x + T[9] * y + T[10] * z + T[11],
    )


@kernel
def turned_by(T: Floats, other: Floats) -> float:
    """Norm of the difference of the rotations of two frames: the angle, or more."""
    total = 0.0
    for r in range(3):
        for k in range(3):
            off = other[4 * r + k] - T[4 * r + k]
            total += off * off
    return sqrt(total)


@kernel(inline=False, entry=True)
def spread(
    bodies: Ints, balls: Floats, T: Floats, error: Floats, parent: Ints, joints: Ints,
    gain: Floats, out: Floats,
) -> None:  # fmt: skip
    """Balls on bodies in the world, and how far each may be from there.

    Args:
        bodies: Body of each, shape (k,).
        balls: Middle in the body and radius of each, shape (k, 4) [m].
        T: Poses of the bodies at a time, and at both ends of the time in question,
            shape (3, b, 12).
        error: How far off each joint position may be, shape (n,) [rad or m].
        parent: See `KinematicTable`, shape (b,).
        joints: Its `joint_kind` and `q_index`, shape (b, 2).
        gain: See there, shape (b, 2).
        out: Middle, radius and that way, overwritten, shape (k, 5) [m].
    """
    for k in range(bodies.shape[0]):
        body, radius = int(bodies[k]), balls[k, 3]
        local = (balls[k, 0], balls[k, 1], balls[k, 2])
        middle = point_in(T[0, body], local)
        way = 0.0
        for end in range(1, 3):
            moved = norm(sub(point_in(T[end, body], local), middle))
            way = max(way, moved + turned_by(T[0, body], T[end, body]) * radius)
        while body >= 0:
            if joints[body, KIND] != FIXED:
                lever = 1.0
                if joints[body, KIND] != PRISMATIC:
                    origin = (T[0, body, 3], T[0, body, 7], T[0, body, 11])
                    lever = norm(sub(middle, origin)) + radius
                way += error[joints[body, PLACE]] * abs(gain[body, 0]) * lever
            body = int(parent[body])
        out[k, 0], out[k, 1], out[k, 2] = middle
        out[k, 3], out[k, 4] = radius, way


@kernel(inline=False, entry=True)
def turn_of(
    body: int, T: Floats, error: Floats, parent: Ints, joints: Ints, gain: Floats
) -> float:
    """By what angle a body may be turned against its pose [rad]; see `spread`."""
    total = max(turned_by(T[0, body], T[1, body]), turned_by(T[0, body], T[2, body]))
    while body >= 0:
        if joints[body, KIND] != FIXED and joints[body, KIND] != PRISMATIC:
            total += error[joints[body, PLACE]] * abs(gain[body, 0])
        body = int(parent[body])
    return total
