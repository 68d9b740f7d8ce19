"""Frames of bodies in which poses take few operations, and what joints reach."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ShapeKind
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Kinds whose rows hold points or directions, and no frame.
CORNERS = (
    ShapeKind.SPHERE,
    ShapeKind.CAPSULE,
    ShapeKind.TRIANGLE,
    ShapeKind.HALF_SPACE,
)

# Components of a unit vector below this are 0.
ROUNDING = 1e-15

# Configurations in which levers are measured, and their seed.
SAMPLES = 64
SEED = 0

# Least of the levers about which distances from an axis are bounded [m].
LEAST_LEVER = 0.01


def turn_to(axis: Floats) -> Floats:
    """A rotation that turns z to a unit vector, shape (3, 3)."""
    x, y, z = axis
    if z < 0.0:
        return np.asarray(turn_to(-axis) * np.array([1.0, -1.0, -1.0]))
    v = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + v + v @ v / (1.0 + z))


def turn_about_z(angle: float) -> Floats:
    """A rotation about z, shape (3, 3)."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned_row(kind: int, row: Floats, R: Floats) -> Floats:
    """A row in a frame that is turned by R."""
    row = row.copy()
    for first in (1, 4, 7) if kind in CORNERS else (1,):
        row[first : first + 3] = R.T @ row[first : first + 3]
    if kind not in CORNERS:
        row[7:16] = (R.T @ row[7:16].reshape(3, 3)).reshape(9)
    return row


def turned_bodies(tables: SceneTables) -> tuple[Floats, Floats, Floats]:
    """Frames of bodies, turned so that a joint's axis is z.

    The x axis of a body's frame is normal to the axis of its first child, and that
    child's joint frame keeps it: as in the convention of Denavit and Hartenberg.

    Returns:
        Rotation of each body's frame, shape (b, 3, 3); joint frames between the turned
        ones, shape (b, 12); multipliers and offsets of the joints, shape (b, 2).
    """
    F = tables.T_parent_joint.reshape(-1, 3, 4)
    gain = np.array(tables.gain)
    turns = np.array([turn_to(axis) for axis in tables.axis]).reshape(-1, 3, 3)
    turns[tables.parent < 0] = np.eye(3)
    frames = F.copy()
    children = np.full(len(F), -1)
    for body in range(len(F) - 1, -1, -1):
        if tables.parent[body] >= 0:
            children[tables.parent[body]] = body
    for body, up in enumerate(tables.parent):
        revolute = up >= 0 and tables.joint_kind[body] == REVOLUTE
        child = children[body]
        if revolute and child >= 0:
            x, y, _ = turns[body].T @ F[child, :, :3] @ turns[child][:, 2]
            if np.hypot(x, y) > ROUNDING:
                turns[body] = turns[body] @ turn_about_z(np.arctan2(x, -y))
        frames[body, :, :3] = frames[body, :, :3] @ turns[body]
        if up >= 0:
            frames[body] = turns[up].T @ frames[body]
        if revolute:
            angle = float(np.arctan2(frames[body, 0, 1], frames[body, 0, 0]))
            frames[body, :, :3] = frames[body, :, :3] @ turn_about_z(angle)
            gain[body, 1] -= angle
            R = frames[body, :, :3]
            if np.abs(R[1:, 0]).max() <= ROUNDING and np.abs(R[0, 1:]).max() <= (
                ROUNDING
            ):
                R[0], R[:, 0] = np.eye(3)[0], np.eye(3)[0]
    return turns, frames.reshape(-1, 12), gain


def sampled_poses(tables: SceneTables, frames: Floats, gain: Floats) -> Floats:
    """Poses of all bodies in some configurations, shape (SAMPLES, b, 3, 4)."""
    lower, upper = np.maximum(tables.lower, -np.pi), np.minimum(tables.upper, np.pi)
    drawn = np.random.default_rng(SEED).uniform(0.0, 1.0, (SAMPLES, len(lower)))
    q = lower + drawn * (upper - lower)
    T = np.tile(frames.reshape(-1, 3, 4), (SAMPLES, 1, 1, 1))
    for body, up in enumerate(tables.parent):
        if up < 0:
            continue
        angle = np.zeros(SAMPLES)
        if tables.q_index[body] >= 0:
            angle = q[:, tables.q_index[body]] * gain[body, 0] + gain[body, 1]
        own = T[:, body].copy()
        if tables.joint_kind[body] == PRISMATIC:
            own[:, :, 3] += angle[:, None] * own[:, :, 2]
        elif tables.joint_kind[body] == REVOLUTE:
            turn = np.array([turn_about_z(one) for one in angle])
            own[:, :, :3] = own[:, :, :3] @ turn
        T[:, body, :, :3] = T[:, up, :, :3] @ own[:, :, :3]
        shift = T[:, up, :, :3] @ own[:, :, 3:]
        T[:, body, :, 3] = shift[..., 0] + T[:, up, :, 3]
    return T


def points_at(poses: Floats, points: Floats) -> Floats:
    """A point of each body in some configurations, shape (SAMPLES, b, 3) [m]."""
    return np.asarray(np.einsum("sbij,bj->sbi", poses[..., :3], points) + poses[..., 3])


def levers_of(poses: Floats, points: Floats) -> Floats:
    """Usual distances of a point of each body from the axes of joints, (b, b) [m].

    Args:
        poses: Those of `sampled_poses`.
        points: In the frames of the bodies, shape (b, 3) [m].
    """
    centres = points_at(poses, points)
    apart = centres[:, :, None] - poses[:, None, :, :, 3]
    across = np.cross(apart, poses[:, None, :, :, 2])
    usual = np.sqrt((across**2).sum(axis=-1).mean(axis=0))
    return np.asarray(np.maximum(usual, LEAST_LEVER))
