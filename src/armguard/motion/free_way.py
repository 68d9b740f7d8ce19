"""Displacement bounds of joints under any commands, until the times of a grid.

All pairs of a cycle share the grid of times.
"""

from armguard.kernel import kernel
from armguard.motion.state import (
    FREE,
    GRID,
    Motion,
)
from armguard.motion.stop_path import error_of
from armguard.robot.kinematics import FIXED as NO_JOINT

# Times of the grid: the first [s], and the ratio of successive ones [-].
FIRST_TIME = 0.004
RATIO = 1.45


@kernel
def grid_time(k: int) -> float:
    """Time k of the grid [s]."""
    return float(FIRST_TIME * RATIO**k)


@kernel
def time_after(t: float) -> int:
    """Index of the first time of the grid after a time; GRID if there is none."""
    k = 0
    while k < GRID and grid_time(k) <= t:
        k += 1
    return k


@kernel(separate=True)
def bound_free_way(k: int, m: Motion) -> None:
    """Bound each joint's displacement from its measurement until a time of the grid.

    The result is written like that of a plan, to row FREE + k, once per cycle.

    Args:
        k: Index of the time, less than GRID.
        m: The prediction.
    """
    if m.grid_stamp[k] == m.effort.stamp:
        return
    m.grid_stamp[k] = m.effort.stamp
    t = grid_time(k)
    middle, width, spread = m.middle[FREE + k], m.width[FREE + k], m.spread[FREE + k]
    for b in range(m.parent.shape[0]):
        middle[b] = width[b] = spread[b] = 0.0
        if m.joint_kind[b] == NO_JOINT:
            continue
        j = m.q_index[b]
        if m.clock[m.robot_of_joint[j]].still != 0:
            continue
        error, gain = error_of(j, m), m.gain[b, 0]
        up = gain * (error + free_way(j, m.v_high[j], t, m))
        down = -gain * (error + free_way(j, -m.v_low[j], t, m))
        middle[b] = 0.5 * (up + down)
        width[b] = 0.5 * abs(up - down)
        spread[b] = abs(middle[b]) + width[b]


@kernel
def free_way(j: int, velocity: float, t: float, m: Motion) -> float:
    """Greatest displacement of a joint in a direction within a time [rad].

    A joint that moves the other way may stop at once: no bound on its deceleration is
    assumed.
    """
    figures = m.joint_figures[j]
    a, speed = figures.acceleration, max(velocity, 0.0)
    gain = max(figures.velocity - speed, 0.0)
    if a * t <= gain:
        return float(t * (speed + 0.5 * a * t))
    until = gain / a
    return float(until * (speed + 0.5 * gain) + (t - until) * (speed + gain))
