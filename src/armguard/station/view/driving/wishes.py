"""What is asked for, as the one wish a commander sends in a cycle."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# A wish for positions is at most so many steps ahead of where the joints are.
AHEAD = 8.0

# A tool that is near where it is to be is led there in proportion [1/s].
APPROACH = 4.0

# A joint is where it is to be within this [rad or m].
THERE = 2e-3

# Fastest motion of a tool that keys and handles ask for [m/s], [rad/s].
LINEAR, ANGULAR = 0.30, 1.0


@dataclass(slots=True)
class Wish:
    """What to send: velocities of joints, positions of them, or twists of tools.

    Attributes:
        velocities: Of all joints, shape (n,) [rad/s or m/s].
        positions: Of all joints, shape (n,) [rad or m]; sent in place of velocities
            where there are any.
        twists: By robot, shape (6,) [m/s], [rad/s]; likewise.
        engaged: Robots that are to be engaged first.
    """

    velocities: Floats
    positions: Floats | None = None
    twists: dict[str, Floats] = field(default_factory=dict)
    engaged: tuple[str, ...] = ()


def top_speeds(tables: SceneTables) -> Floats:
    """Declared top speed of each joint, 1 where nobody declared one, shape (n,)."""
    parts = [
        np.ones(part.joint_count) if part.stopping is None else part.stopping.velocity
        for part in tables.robots
    ]
    return np.concatenate(parts)


def ramped(position: Floats, target: Floats, q: Floats, step: Floats) -> Floats:
    """Positions to ask for next on the way to a target, shape (n,).

    A wish that comes late then leaves the arm where it was sent last, not in motion.

    Args:
        position: Positions that were asked for last, shape (n,).
        target: Where joints are to be, shape (n,); NaN for one that is to stay.
        q: Where they are, shape (n,).
        step: How far each may go until the next wish, shape (n,).
    """
    left = np.where(np.isfinite(target), target - position, 0.0)
    wanted = position + np.clip(left, -step, step)
    # What does not follow is not run away from.
    return np.asarray(np.clip(wanted, q - AHEAD * step, q + AHEAD * step))


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
