"""Distance gradient: rate at which each joint closes a near pair."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import dot
from armguard.guard.layout import NearRow, normal_of, point_of
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import Motion

Floats = NDArray[np.float64]


@kernel
def pair_row(
    i: int, j: int, near: NearRow, row: Floats, w: Workspace, m: Motion
) -> None:
    """Write the rate at which each joint closes a pair at unit joint speed.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        near: The pair's row.
        row: Overwritten, shape (n,) [m/rad].
        w: Workspace.
        m: Motion.
    """
    for q in range(row.shape[0]):
        row[q] = 0.0
    n = normal_of(near)
    moving = m.rate.shape[0]
    body_j = w.bodies[j] if j < moving else -1
    first = shared_joints(w.bodies[i], body_j, m)
    for side in range(2):
        k, body = (i, w.bodies[i]) if side == 0 else (j, body_j)
        if k >= moving:
            continue
        point = point_of(near, side)
        for c in range(first, m.length[body]):
            b = m.joints[body, c]
            q = m.q_index[b]
            if m.clock[m.robot_of_joint[q]].still != 0:
                continue
            g = m.gain[b, 0] * dot(n, joint_way(point, b, m.axes[b], m))
            row[q] += g if side == 0 else -g
