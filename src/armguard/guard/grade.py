"""Last step of a cycle with predicted stops: level and speed scale of each robot.

A robot is slowed when its time left is short, and until that time is clearly longer
again: levels do not flicker.
"""

from math import inf

from armguard.guard.levels import Level, Reason
from armguard.guard.needs import LOOK_AHEAD
from armguard.guard.watch import (
    BRAKING,
    HYSTERESIS,
    LOST,
    RECOVERING,
    RESTING,
    STOPPING,
    Watch,
)
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIXED
from armguard.motion.pair_state import UNPROVEN
from armguard.motion.state import Motion

CLEAR = int(Level.CLEAR)
CAUTION = int(Level.CAUTION)
SLOW = int(Level.SLOW)
STOP = int(Level.STOP)
RECOVER = int(Level.RECOVER)
BRAKE = int(Level.BRAKE)
HARDWARE_STOP = int(Level.HARDWARE_STOP)

OK = int(Reason.OK)
NEAR = int(Reason.NEAR)
SHORT_TIME = int(Reason.SHORT_TIME)
TOO_CLOSE = int(Reason.TOO_CLOSE)
NO_PROOF = int(Reason.NO_PROOF)
BUDGET_SPENT = int(Reason.BUDGET_SPENT)
STOPPING_STILL = int(Reason.STOPPING)
AT_REST = int(Reason.RESTING)
NOTHING_PROVEN = int(Reason.UNPROVEN)
MOVED_AT_REST = int(Reason.MOVED_AT_REST)
CROWDED = int(Reason.CROWDED)
STOP_LAGS = int(Reason.STOP_LAGS)
BRAKE_LAGS = int(Reason.BRAKE_LAGS)


@kernel
def grade_robots(w: Workspace, v: Watch, m: Motion) -> None:
    """Write each robot's level, phase and speed scale, and the common reason."""
    out = w.header
    slow_time = v.timing.slow_time
    least = inf
    worst = CLEAR
    which = -1
    for r in range(v.phase.shape[0]):
        row = w.robots[r]
        level = robot_level(r, w, v, m)
        left = v.time_left[r] if m.robot_figures[r].mode != FIXED else inf
        least = min(least, left)
        scale = 0.0 if level >= STOP else min(left / slow_time, 1.0)
        v.level[r] = level
        row.level = level
        row.phase = v.phase[r]
        row.scale = scale
        row.age = m.clock[r].age
        row.cause = v.cause[r]
        row.delay = v.delays[r]
        if level > worst:
            worst, which = level, r
    out.least_time_left = min(least, LOOK_AHEAD * slow_time)
    out.reason = common_reason(worst, w, v)
    if worst >= STOP and out.robot < 0.0:
        out.robot = which


@kernel
def robot_level(r: int, w: Workspace, v: Watch, m: Motion) -> int:
    """Level of one robot, by its phase and its time left."""
    if m.robot_figures[r].mode == FIXED:
        return fixed_level(r, w, v)
    phase = v.phase[r]
    if phase == STOPPING:
        return STOP
    if phase == BRAKING:
        return BRAKE
    if phase == LOST:
        return HARDWARE_STOP
    if phase == RESTING or phase == RECOVERING:
        return RECOVER
    limit = v.timing.slow_time
    if v.level[r] == SLOW:
        limit *= HYSTERESIS
    if v.time_left[r] < limit:
        return SLOW
    return CAUTION if w.header.near_count > 0.0 else CLEAR


@kernel
def fixed_level(r: int, w: Workspace, v: Watch) -> int:
    """Level of a robot in mode "fixed": STOP if a pair of its own breaks its buffer."""
    if v.must[r] != 0:
        return STOP
    return CAUTION if w.header.near_count > 0.0 else CLEAR


@kernel
def common_reason(worst: int, w: Workspace, v: Watch) -> int:
    """Reason of the highest level."""
    found = int(w.header.reason)
    forced = v.last.forced
    if worst == HARDWARE_STOP:
        return BRAKE_LAGS
    if worst == BRAKE:
        return STOP_LAGS
    if forced != OK:
        return forced
    if found > BRAKE_LAGS:
        # The cycle itself could not judge.
        return found
    if worst == RECOVER:
        if found == CROWDED:
            return found
        return NOTHING_PROVEN if is_unproven(w) else AT_REST
    if worst == STOP:
        if found >= TOO_CLOSE:
            # A recovery that ended is stopped for the pair that it was leaving.
            return TOO_CLOSE if found == NOTHING_PROVEN else found
        for r in range(v.phase.shape[0]):
            if v.phase[r] == STOPPING and v.cause[r] == MOVED_AT_REST:
                return MOVED_AT_REST
        return STOPPING_STILL
    if worst == SLOW:
        return SHORT_TIME
    return NEAR if found >= NEAR else OK


@kernel
def is_unproven(w: Workspace) -> bool:
    """Whether there is an unproven near pair."""
    for k in range(int(w.header.near_count)):
        if w.near[k].proof == UNPROVEN:
            return True
    return False
