"""Getting out of the way: what comes at a robot, when, and which way leads off.

An object that was seen with a velocity is thought to keep it. Where that would bring it
too near to a robot within the robot's `evade_time`, whatever the robot does, the robot
is led away from it, joint by joint. All other pairs keep what they need: if that leaves
no way, it stays.
"""

from math import inf

from armguard.guard.layout import FIRST, NEAR_COUNT, SECOND, WITNESS
from armguard.guard.near_pairs import row_place
from armguard.guard.pair_row import pair_row
from armguard.guard.proofs import robot_of, standing_need
from armguard.guard.watch import RECOVERING, RESTING, RUNNING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.figures import FIRST_JOINT, JOINT_COUNT, VELOCITY
from armguard.motion.state import Motion
from armguard.respond.state import EVADE_SPEED, EVADE_TIME, Response

# What comes more slowly does not come [m/s].
SLOWEST = 0.01


@kernel
def look_for_threats(a: Response, w: Workspace, v: Watch, m: Motion) -> None:
    """Find robots that something comes at, and ask for a way that leads off."""
    for r in range(v.evades.shape[0]):
        v.evades[r] = 0
    for j in range(a.away.shape[0]):
        a.away[j] = 0.0
    if v.movers.shape[0] == 0:
        return
    for k in range(int(w.out[NEAR_COUNT])):
        place = row_place(k, w)
        i, j = int(w.out[place + FIRST]), int(w.out[place + SECOND])
        time = time_until(i, j, place, a, w, v, m)
        if time == inf:
            continue
        r = robot_of(i, v)
        phase = v.phase[r]
        if phase != RUNNING and phase != RESTING and phase != RECOVERING:
            continue
        v.evades[r] = 1
        weight = 1.0 - time / a.settings[r, EVADE_TIME]
        pair_row(i, j, place, a.raw, w, m)
        for q in range(a.away.shape[0]):
            a.away[q] -= weight * a.raw[q]
    for r in range(v.evades.shape[0]):
        if v.evades[r] != 0:
            ask_away(r, a, m)


@kernel
def time_until(
    i: int, j: int, place: int, a: Response, w: Workspace, v: Watch, m: Motion
) -> float:
    """Time until an object that comes at a robot is too near to it, at rest [s].

    Returns:
        That; infinite if it does not come, or later than the robot looks ahead.
    """
    if j < m.rate.shape[0] or j >= v.object_velocity.shape[0]:
        return inf
    r = robot_of(i, v)
    ahead = a.settings[r, EVADE_TIME]
    if ahead == 0.0:
        return inf
    at = place + WITNESS
    coming = 0.0
    for k in range(3):
        coming -= w.out[at + 7 + k] * v.object_velocity[j, k]
    if not coming > SLOWEST:
        return inf
    spare = w.out[at] - standing_need(i, j, w, v, m) - m.blur[i]
    time = max(spare, 0.0) / coming
    return float(time) if time < ahead else inf


@kernel
def ask_away(r: int, a: Response, m: Motion) -> None:
    """Ask for the way that leads off, as fast as the robot may, and for no other."""
    first = int(m.robot_figures[r, FIRST_JOINT])
    end = first + int(m.robot_figures[r, JOINT_COUNT])
    most = 0.0
    for j in range(first, end):
        most = max(most, abs(a.away[j]) / m.joint_figures[j, VELOCITY])
    for j in range(first, end):
        share = a.settings[r, EVADE_SPEED]
        a.asked[j] = share * a.away[j] / most if most > 0.0 else 0.0
