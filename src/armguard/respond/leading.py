"""Guidance by the guard: a field or a retreat leads a robot in place of its operator.

A field leads while the operator requests no motion, a retreat until it ends. Both pass
the same limits, rows and proof as an operator's request. A stop suspends a field until
it is engaged, and ends a retreat that has begun: no robot restarts by itself. While
operators request positions no field leads.
"""

from math import exp

from armguard.guard.commands import time_passed
from armguard.guard.levels import Reason
from armguard.guard.watch import BRAKING, LOST, RUNNING, STOPPING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.command import Blocked
from armguard.respond.engagement import NO_REQUEST, Engagement
from armguard.respond.field import attract, forget_progress, look_for_minimum, repel
from armguard.respond.lead_state import Goal, Lead, Retreat, Source
from armguard.respond.retreat import is_held_up, lead_back, stand
from armguard.respond.state import POSITIONS, VELOCITIES, Response
from armguard.respond.trail import remember_place

OK = int(Reason.OK)

# Time constant of each of the two lags of a guided robot's request [s].
LAG = 0.02


@kernel(separate=True)
def lead_robots(a: Response, w: Workspace) -> None:
    """Write the requests of the robots that the guard guides.

    Args:
        a: The responses; `requested` is written already.
        w: The workspace, after a cycle was opened.
    """
    v, m = w.watch, w.motion
    s = a.lead
    fields = False
    for r in range(s.notes.shape[0]):
        notes = s.notes[r]
        notes.source = Source.OPERATOR
        phase = v.phase[r]
        if phase == STOPPING or phase == BRAKING or phase == LOST:
            notes.suspended = int(notes.goal != Goal.NONE)
            if notes.begun != 0:
                notes.retreat = Retreat.NONE
            continue
        if notes.retreat != Retreat.NONE:
            retreat(r, a, s, v, m)
        elif draws(r, a, s, m):
            notes.source = Source.FIELD
            if notes.in_minimum != 0:
                stand(r, a, m)
            else:
                attract(r, a, s, w, v, m)
                fields = True
    if fields:
        repel(a, s, w, v, m)
    for r in range(s.notes.shape[0]):
        smooth_lead(r, a, s, v, m)


@kernel
def smooth_lead(r: int, a: Response, s: Lead, v: Watch, m: Motion) -> None:
    """Filter errors of measurement out of the request of a guided robot.

    By two lags in series; those of any other robot follow its last command.
    """
    part = 1.0 - exp(-time_passed(v) / LAG)
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if s.notes[r].source == Source.OPERATOR:
            s.first_lag[j] = s.second_lag[j] = v.commanded[j]
        else:
            s.first_lag[j] += part * (a.requested[j] - s.first_lag[j])
            s.second_lag[j] += part * (s.first_lag[j] - s.second_lag[j])
            a.requested[j] = s.second_lag[j]


@kernel
def asks(r: int, a: Response, m: Motion) -> bool:
    """Whether motion is requested of a robot."""
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        if abs(a.requested[j]) > NO_REQUEST:
            return True
    return False


@kernel
def retreat(r: int, a: Response, s: Lead, v: Watch, m: Motion) -> None:
    """Continue a robot's retreat, unless its operator ends it."""
    notes = s.notes[r]
    if notes.begun == 0:
        s.memory[r].speed = s.memory[r].at_rest = 0.0
    notes.begun = 1
    if a.request.form == VELOCITIES:
        wants = asks(r, a, m)
        if not wants:
            notes.released = 1
        elif notes.released != 0:
            notes.retreat = Retreat.NONE
            a.notes[r].engagement = Engagement.FOLLOWING
            return
    if lead_back(r, a, s, v, m):
        notes.source = Source.RETREAT
    else:
        # The retreat led away, not the operator, who must still release the robot.
        a.notes[r].request_opens = 0


@kernel
def draws(r: int, a: Response, s: Lead, m: Motion) -> bool:
    """Whether a robot's field leads it in this cycle."""
    notes = s.notes[r]
    if notes.goal == Goal.NONE or notes.suspended != 0:
        return False
    if a.request.form == POSITIONS:
        return False
    if asks(r, a, m):
        # The operator moves it, so the path to its goal may change.
        forget_progress(r, s)
        return False
    return True


@kernel
def follow_lead(r: int, follows: bool, a: Response, s: Lead, v: Watch) -> bool:
    """Whether a robot follows its request, its retreat considered.

    A retreat needs no release by the operator and no leader arm that is near; both are
    required again after it. An evading robot has no other guidance, and a robot under
    an ordered stop has none at all.
    """
    if v.evades[r] != 0 or a.notes[r].ordered_stop != 0:
        s.notes[r].source = Source.OPERATOR
    if s.notes[r].source != Source.RETREAT:
        return follows
    notes = a.notes[r]
    notes.engagement, notes.gave_positions, notes.refused = Engagement.WAITING, 1, 0
    if notes.blocked != Blocked.TOO_NEAR:
        notes.blocked = Blocked.RETREATING
        a.speed[r] = a.settings[r].resume_speed
    return True


@kernel(separate=True)
def note_leads(judged: int, a: Response, w: Workspace) -> None:
    """After the proof, extend the trails and report the progress of guided robots.

    Args:
        judged: Whether the input could be judged.
        a: The responses.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    s = a.lead
    if judged == 0:
        return
    for r in range(s.notes.shape[0]):
        runs = v.phase[r] == RUNNING
        led = s.notes[r].source
        proven = v.must[r] == 0 and v.last.forced == OK
        if runs and proven and led != Source.RETREAT:
            remember_place(r, s, m)
        if runs and led == Source.FIELD:
            look_for_minimum(r, a, s, w, v, m)
        say_lead(r, a, s, v, m)


@kernel
def say_lead(r: int, a: Response, s: Lead, v: Watch, m: Motion) -> None:
    """Write the reason for which a guided robot makes no progress."""
    notes, own = a.notes[r], s.notes[r]
    blocked = notes.blocked
    if own.source == Source.RETREAT:
        named = blocked == Blocked.PINCHED or blocked == Blocked.NO_WAY
        if is_held_up(r, a, s, v, m) and not named:
            notes.blocked = Blocked.WAY_BLOCKED
    elif blocked == Blocked.NOT and own.source == Source.FIELD:
        if own.in_minimum != 0:
            notes.blocked = Blocked.LOCAL_MINIMUM
    elif blocked == Blocked.NOT and own.suspended != 0 and notes.requests_motion == 0:
        if a.request.form == VELOCITIES:
            notes.blocked = Blocked.STOPPED
