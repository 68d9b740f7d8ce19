"""The desired motion that a commander sends in a cycle, and the laws that make it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from viser.transforms import SO3

from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Desired positions are at most so many steps ahead of where the joints are.
AHEAD = 8.0

# A tool that is near its target is led there in proportion [1/s].
APPROACH = 4.0

# A joint has reached its target within this [rad or m].
REACHED = 2e-3

# Fastest motion of a tool by keys and handles [m/s], [rad/s].
LINEAR, ANGULAR = 0.30, 1.0


@dataclass(slots=True)
class DesiredMotion:
    """Velocities of joints, positions of them, or twists of tools.

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
    """Declared top speed of each joint, 1 where none is declared, shape (n,)."""
    parts = [
        np.ones(part.joint_count) if part.stopping is None else part.stopping.velocity
        for part in tables.robots
    ]
    return np.concatenate(parts)


def ramped(position: Floats, target: Floats, q: Floats, step: Floats) -> Floats:
    """Next desired positions on the way to a target, shape (n,).

    When the next ones are late, the arm then rests where it was sent last.

    Args:
        position: Positions desired last, shape (n,).
        target: Targets of joints, shape (n,); NaN for one that is to stay.
        q: Measured positions, shape (n,).
        step: How far each may go until the next, shape (n,).
    """
    left = np.where(np.isfinite(target), target - position, 0.0)
    wanted = position + np.clip(left, -step, step)
    # They do not run away from a joint that does not follow.
    return np.asarray(np.clip(wanted, q - AHEAD * step, q + AHEAD * step))


def twist_towards(T: Floats, T_target: Floats, share: float) -> Floats:
    """Twist that leads a frame to another one, shape (6,).

    Args:
        T: The frame in the world, shape (4, 4).
        T_target: Its target, likewise.
        share: Share of the fastest motion [-].
    """
    linear = T_target[:3, 3] - T[:3, 3]
    angular = SO3.from_matrix(T_target[:3, :3] @ T[:3, :3].T).log()
    return np.concatenate(
        [
            limited(APPROACH * linear, share * LINEAR),
            limited(APPROACH * angular, share * ANGULAR),
        ]
    )


def limited(vector: Floats, longest: float) -> Floats:
    """A vector that is no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)
