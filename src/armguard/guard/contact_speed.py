"""Closing speed of a pair under a contact contract: commanded, and allowed."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import dot
from armguard.guard.grips import ContractRow
from armguard.guard.layout import NearRow, normal_of, point_of
from armguard.guard.needs import robot_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import (
    NEXT,
    Motion,
)

Floats = NDArray[np.float64]

# Share of the allowed speed that a response may request: pending commands are as old as
# the delays, from when the pair was farther apart [-].
GRANTED = 0.8

# Greatest share of it that is newly commanded. Pending commands act for a while, with
# their tracking errors, while the pair is nearer than it was [-].
COMMANDED_ANEW = 0.95


@kernel
def closing_commanded(
    i: int,
    j: int,
    plan_i: int,
    plan_j: int,
    near: NearRow,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> tuple[float, float]:
    """Greatest commanded closing speed of a pair, and the time until a stop acts.

    Returns:
        Speed along the pair's normal [m/s]; time until a stop has taken effect [s].
    """
    robots = m.robot_figures.shape[0]
    n = normal_of(near)
    moving = m.rate.shape[0]
    first = shared_joints(w.bodies[i], w.bodies[j], m)
    closing = time = 0.0
    for side in range(2):
        k, plan = (i, plan_i) if side == 0 else (j, plan_j)
        if k >= moving:
            continue
        r = robot_of(k, v)
        if r >= 0:
            time = max(time, m.clock[plan * robots + r].reaction)
        point = point_of(near, side)
        body = w.bodies[k]
        for x in range(first, m.length[body]):
            b = m.joints[body, x]
            g = m.gain[b, 0] * dot(n, joint_way(point, b, m.axes[b], m))
            closing += fastest(m.q_index[b], g if side == 0 else -g, plan, v, m)
    return (closing, time)


@kernel
def speed_at(distance: float, c: ContractRow) -> float:
    """Greatest closing speed that a contract allows at a distance [m/s]."""
    return float(c.creep + c.gain * distance)


@kernel
def fastest(q: int, g: float, plan: int, v: Watch, m: Motion) -> float:
    """Greatest part of a joint's commands in a closing speed [m/s].

    Args:
        q: The joint.
        g: Rate at which it closes the pair at unit speed [m/rad].
        plan: NEXT or NOW.
        v: Watch.
        m: Motion.
    """
    if v.given.commanded == 0:
        return float(g * 0.5 * (m.v_low[q] + m.v_high[q]))
    low, high = v.under_way[q, 0], v.under_way[q, 1]
    if plan == NEXT:
        low, high = min(low, v.wanted[q]), max(high, v.wanted[q])
    return float(max(g * low, g * high))


@kernel
def allowed_speed(distance: float, time: float, c: ContractRow) -> float:
    """Greatest closing speed that a contract allows until a stop takes effect [m/s].

    Args:
        distance: Present distance [m].
        time: Time until an order takes effect [s].
        c: The contract.
    """
    most = speed_at(distance, c) / (1.0 + c.gain * time)
    return float(max(c.creep, most))
