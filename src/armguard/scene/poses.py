"""Where the bodies of a scene are."""

import numpy as np
from numpy.typing import NDArray

from armguard.robot.kinematics import forward_kinematics
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def body_poses(tables: SceneTables, q: Floats) -> Floats:
    """Poses of all bodies at a configuration, rows of [R | p], shape (b, 12)."""
    poses = np.zeros((len(tables.parent), 12))
    forward_kinematics(
        q,
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        poses,
    )
    return poses
