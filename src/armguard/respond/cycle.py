"""Response stage of a filtered cycle: from the requested to the commanded motion.

Request -> engagement -> limits -> constraint rows -> target, or a quadratic program to
solve -> (proof) -> commanded velocities and set-points.
"""

from math import inf, isfinite, nan, sqrt

from armguard.guard.commands import time_passed
from armguard.guard.filtered_cycle import close_cycle
from armguard.guard.intent import read_intents
from armguard.guard.layout import NEAR_WIDTH
from armguard.guard.levels import Reason
from armguard.guard.watch import (
    AT_REST,
    AT_WORK,
    GIVES_UP,
    LEAVES,
    RECOVERING,
    RESTING,
    RUNNING,
    Watch,
)
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.command import Blocked, Changed
from armguard.respond.daqp_interface import FUNCTION
from armguard.respond.engagement import NO_REQUEST, engage, wait_if_stopped
from armguard.respond.evasion import look_for_threats
from armguard.respond.grip_keeping import keep_grips
from armguard.respond.joint_bounds import frame_limits, retreats
from armguard.respond.leading import follow_lead, lead_robots, note_leads
from armguard.respond.leaving import lead_away, sure_share
from armguard.respond.missed import note_missed
from armguard.respond.program import BY_ROWS, add_pairs, scale_back
from armguard.respond.programs import solve_programs
from armguard.respond.responses import change_target
from armguard.respond.state import POSITIONS, STANDSTILL, TWISTS, Response
from armguard.respond.tool_asking import request_tools

WRONG_COMMAND = int(Reason.WRONG_COMMAND)
NO_WAY = int(Reason.NO_WAY)

BY_PROOF = int(Changed.PROOF)

# Share of its deceleration with which a joint brakes at a requested position [-].
GENTLE = 0.5

# Greatest lead of the set-points before the measured positions, as time at the fastest
# speed of the joint [s].
LEAD_TIME = 0.1


@kernel(separate=True)
def respond(a: Response, w: Workspace) -> int:
    """Turn the request into a target velocity that is to be proven.

    Args:
        a: The responses; `requested` or `goal` is written already.
        w: The workspace, after `open_cycle`.

    Returns:
        Robots whose program is to be solved, a bit for each; if kernels can call the
        solver, the robots whose program has no solution.
    """
    v, m = w.watch, w.motion
    hold(a, v, m)
    note_missed(a, v, m)
    if a.request.form == TWISTS:
        request_tools(a, w, m)
    take_requested(a, v, m)
    lead_robots(a, w)
    s = a.lead
    if w.settings.intents != 0:
        read_intents(a.requested, w)
    look_for_threats(a, w)
    for r in range(a.notes.shape[0]):
        follows = follow_lead(r, engage(r, a, v, m), a, s, v)
        frame_limits(r, follows, a, w, v, m)
    keep_grips(a, w, m)
    add_pairs(a, w)
    open_programs = 0
    for r in range(a.notes.shape[0]):
        if a.notes[r].violates != 0:
            a.notes[r].changed |= BY_ROWS
            if a.notes[r].coupled != 0:
                # Under any response: only coupled joints lead out.
                open_programs |= 1 << r
            elif retreats(r, a):
                scale_back(r, a, m)
            elif change_target(r, a, w):
                open_programs |= 1 << r
    if a.solver[FUNCTION] != 0:
        return solve_programs(open_programs, a, m)
    return open_programs


@kernel
def take_requested(a: Response, v: Watch, m: Motion) -> None:
    """Check the request, and turn requested positions into velocities."""
    if a.request.form == STANDSTILL:
        for j in range(a.requested.shape[0]):
            a.requested[j] = a.far[j] = 0.0
        v.last.forced = a.request.stop_reason
        return
    positions = a.request.form == POSITIONS
    wrong = False
    for j in range(a.requested.shape[0]):
        wrong |= not isfinite(a.goal[j] if positions else a.requested[j])
    for j in range(a.requested.shape[0]):
        a.far[j] = 0.0
        if wrong:
            a.requested[j] = 0.0
        elif positions:
            way = a.goal[j] - a.held[j]
            a.far[j] = abs(way)
            speed = speed_to(a.far[j], m.joint_figures[j].deceleration, v.timing.period)
            a.requested[j] = speed if way > 0.0 else -speed
    if wrong:
        v.last.forced = WRONG_COMMAND


@kernel
def speed_to(way: float, deceleration: float, period: float) -> float:
    """Speed from which a joint can still stop at a distance, after one more cycle.

    [rad/s or m/s]
    """
    d = GENTLE * deceleration
    speed = d * (sqrt(period * period + 2.0 * way / d) - period)
    return float(min(way / period, speed))


@kernel(separate=True)
def finish(judged: int, unsolved: int, a: Response, w: Workspace) -> int:
    """Prove the target, order stops and write the command.

    Args:
        judged: Result of `open_cycle`.
        unsolved: Robots whose program has no solution, a bit for each.
        a: The responses.
        w: The workspace.

    Returns:
        Number of places of the workspace's `out` that were used.
    """
    v, m = w.watch, w.motion
    for r in range(a.notes.shape[0]):
        v.recover[r] = 0
        stays = a.settings[r].stops != 0 and not retreats(r, a)
        v.yields[r] = 0 if stays else 1
        if judged != 0:
            settle_target(r, (unsolved >> r) & 1, a, w, v, m)
    for j in range(a.target.shape[0]):
        v.wanted[j] = a.target[j]
    close_cycle(judged, w)
    if judged == 0:
        # `engage` did not run; a stop may be over before the next cycle that runs it.
        for r in range(a.notes.shape[0]):
            wait_if_stopped(r, a, v)
    note_leads(judged, a, w)
    note_changes(judged, a, v, m)
    write_command(a, v)
    return int(w.settings.first_row) + int(w.header.near_count) * NEAR_WIDTH


@kernel
def settle_target(
    r: int, unsolved: int, a: Response, w: Workspace, v: Watch, m: Motion
) -> None:
    """Take the declared stop if no solution was found; note which robots recover."""
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    tangled = a.notes[r].coupled != 0 and v.evades[r] == 0
    moves, room = False, False
    for j in range(first, end):
        if unsolved != 0:
            a.target[j] = a.brake[j]
        room |= a.low[j] < 0.0 or a.high[j] > 0.0
    if tangled:
        room = sure_share(r, a, w, v, m) < inf
    for j in range(first, end):
        if tangled and a.notes[r].requests_motion == 0:
            # The program was solved only to know whether an escape direction exists.
            a.target[j] = a.brake[j]
        moves |= abs(a.target[j]) > NO_REQUEST
    if unsolved != 0 and not tangled:
        v.last.forced = NO_WAY
        a.notes[r].blocked = Blocked.NO_WAY
    if a.notes[r].recovers == 0:
        return
    if v.evades[r] != 0:
        if v.phase[r] == RUNNING:
            v.recover[r] = AT_WORK
        elif moves:
            v.recover[r] = AT_REST
    elif moves and lead_away(r, a, w, v, m):
        v.recover[r] = LEAVES if v.phase[r] == RESTING else 0
    elif v.phase[r] == RECOVERING:
        v.recover[r] = GIVES_UP
    if not room and v.phase[r] == RESTING:
        a.notes[r].blocked = Blocked.PINCHED


@kernel
def note_changes(judged: int, a: Response, v: Watch, m: Motion) -> None:
    """Note the robots that are commanded less than their target for lack of a proof."""
    for r in range(a.notes.shape[0]):
        if judged == 0:
            a.notes[r].changed = BY_PROOF
        first = m.robot_figures[r].first_joint
        for j in range(first, first + m.robot_figures[r].joint_count):
            if v.wanted[j] != a.target[j]:
                a.notes[r].changed |= BY_PROOF


@kernel
def hold(a: Response, v: Watch, m: Motion) -> None:
    """Integrate the position set-points; keep them near the measured positions."""
    time = time_passed(v)
    for j in range(a.held.shape[0]):
        if v.sent_count[0] == 0 or not isfinite(a.held[j]):
            a.held[j] = m.q[j]
        last = v.commanded[j]
        a.held[j] += last * time
        fastest = max(abs(last), -m.v_low[j], m.v_high[j])
        room = LEAD_TIME * fastest + 2.0 * m.joint_figures[j].position_error
        a.held[j] = min(max(a.held[j], m.q[j] - room), m.q[j] + room)


@kernel
def write_command(a: Response, v: Watch) -> None:
    """Write the numbers of the command, see `Command`."""
    n = a.held.shape[0]
    for j in range(n):
        a.commanded[j] = v.wanted[j]
        a.commanded[n + j] = a.held[j] + v.wanted[j] * v.timing.period
        a.commanded[2 * n + j] = a.requested[j]
        a.commanded[3 * n + j] = a.far[j]
    robots = a.notes.shape[0]
    for r in range(robots):
        if not waits_for_a_person(r, a, v):
            a.held_since[r] = nan
        elif not isfinite(a.held_since[r]):
            a.held_since[r] = v.commanded_at[0]
        a.commanded[4 * n + r] = a.notes[r].blocked
        a.commanded[4 * n + robots + r] = v.phase[r]
        a.commanded[4 * n + 2 * robots + r] = a.held_since[r]
        a.commanded[4 * n + 3 * robots + r] = a.notes[r].changed


@kernel
def waits_for_a_person(r: int, a: Response, v: Watch) -> bool:
    """Whether a robot is at rest and waits for its operator.

    A robot that is still being stopped does not wait yet.
    """
    blocked, phase = a.notes[r].blocked, v.phase[r]
    waits = blocked == Blocked.STOPPED or blocked == Blocked.FAR_START
    waits |= blocked == Blocked.LOCAL_MINIMUM
    return bool(waits and (phase == RUNNING or phase == RESTING))
