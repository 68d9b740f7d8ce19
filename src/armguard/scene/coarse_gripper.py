"""One box round a gripper and its fingers, wherever these are."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box, PlacedShape, shape_row
from armguard.robot.kinematics import PRISMATIC, KinematicTable
from armguard.robot.limits import joint_limits
from armguard.robot.tree import joints_above
from armguard.scene.blocks import extent
from armguard.scene.robots import SceneRobot

Floats = NDArray[np.float64]


def gripper_members(robot: SceneRobot) -> tuple[str, ...]:
    """The gripper's link and all links that ride on it, of those with primitives."""
    assert robot.gripper is not None, "only asked of robots that have one"
    carrier = robot.gripper.link
    return tuple(
        link
        for link in robot.fits
        if link == carrier
        or carrier in (joint.parent for joint in joints_above(robot.model, link))
    )


def coarse_gripper(robot: SceneRobot, table: KinematicTable) -> PlacedShape:
    """Box in the frame of the gripper's body that always holds its members.

    What slides is held at both ends of its way, what turns at any angle.
    """
    assert robot.gripper is not None, "only asked of robots that have one"
    carrier = table.body_of_link[robot.gripper.link]
    lower, upper = joint_limits(robot.model)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    box = np.zeros(6)
    for link in gripper_members(robot):
        fit = robot.fits[link]
        T = table.T_body_link[link]
        rows = np.array([shape_row(s.shape, T @ s.pose.matrix()) for s in fit.shapes])
        kinds = np.array([int(s.shape.kind) for s in fit.shapes], dtype=np.int32)
        extent(kinds, rows, box)
        corners = corners_of(box[:3], box[3:])
        body = table.body_of_link[link]
        while body != carrier:
            corners = above_joint(corners, body, table, lower, upper)
            body = int(table.parent[body])
        low = np.minimum(low, corners.min(axis=0))
        high = np.maximum(high, corners.max(axis=0))
    x, y, z = (high - low).tolist()
    i, j, k = ((high + low) / 2.0).tolist()
    return PlacedShape(Box(size=(x, y, z)), Pose(xyz=(i, j, k)))


def corners_of(low: Floats, high: Floats) -> Floats:
    """The corners of a box, shape (8, 3)."""
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, 8).T


def above_joint(
    corners: Floats, body: int, table: KinematicTable, lower: Floats, upper: Floats
) -> Floats:
    """Corners in the parent's frame that hold what a joint moves, at any position."""
    T = table.T_parent_joint[body].reshape(3, 4)
    q = int(table.q_index[body])
    multiplier, offset = table.gain[body]
    if table.joint_kind[body] == PRISMATIC:
        ends = multiplier * np.array([lower[q], upper[q]]) + offset
        moved = np.concatenate([corners + end * table.axis[body] for end in ends])
        return np.asarray(moved @ T[:, :3].T + T[:, 3])
    radius = float(np.linalg.norm(corners, axis=1).max())
    return corners_of(T[:, 3] - radius, T[:, 3] + radius)
