"""What is asked for, as the one wish a commander sends in a cycle."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# A joint or a tool that is near where it is to be is led there in proportion [1/s].
APPROACH = 4.0

# It is there within this [rad or m].
THERE = 1e-3

# Fastest motion of a tool that keys and handles ask for [m/s], [rad/s].
LINEAR, ANGULAR = 0.30, 1.0


@dataclass(slots=True)
class Wish:
    """What to send: velocities of joints, or twists of tools.

    Attributes:
        velocities: Of all joints, shape (n,) [rad/s or m/s].
        twists: By robot, shape (6,) [m/s], [rad/s]; where there are any, they are sent
            in place of the velocities.
        engaged: Robots that are to be engaged first.
    """

    velocities: Floats
    twists: dict[str, Floats] = field(default_factory=dict)
    engaged: tuple[str, ...] = ()


def top_speeds(tables: SceneTables) -> Floats:
    """Declared top speed of each joint, 1 where nobody declared one, shape (n,)."""
    parts = [
        np.ones(part.joint_count) if part.stopping is None else part.stopping.velocity
        for part in tables.robots
    ]
    return np.concatenate(parts)


def towards(target: Floats, q: Floats, fastest: Floats) -> Floats:
    """Velocities that lead joints to where they are to be, shape (n,).

    Args:
        target: Where, shape (n,); NaN for a joint that is to stay.
        q: Where they are, shape (n,).
        fastest: Their greatest speeds, shape (n,).
    """
    left = np.where(np.isfinite(target), target - q, 0.0)
    left = np.where(np.abs(left) < THERE, 0.0, left)
    return np.clip(APPROACH * left, -fastest, fastest)


def twist_towards(T: Floats, T_wanted: Floats, share: float) -> Floats:
    """Twist that leads a frame to another one, shape (6,).

    Args:
        T: The frame in the world, shape (4, 4).
        T_wanted: Where it is to be.
        share: Share of the fastest motion [-].
    """
    linear = APPROACH * (T_wanted[:3, 3] - T[:3, 3])
    angular = APPROACH * rotation_vector(T_wanted[:3, :3] @ T[:3, :3].T)
    return np.concatenate(
        [limited(linear, share * LINEAR), limited(angular, share * ANGULAR)]
    )


def limited(vector: Floats, longest: float) -> Floats:
    """A vector that is no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)


def rotation_vector(R: Floats) -> Floats:
    """Axis times angle of a rotation, shape (3,) [rad]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def tool_frame(tables: SceneTables, part: RobotPart, poses: Floats) -> Floats:
    """Frame of a robot's tool in the world, shape (4, 4).

    Args:
        tables: The scene.
        part: The robot.
        poses: Poses of all bodies, rows of [R | p], shape (b, 12).
    """
    at = tables.links[part.tool]
    T = np.eye(4)
    T[:3] = poses[at.body].reshape(3, 4)
    return np.asarray(T @ at.T_body_link)
