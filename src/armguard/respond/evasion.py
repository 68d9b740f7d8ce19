"""Evasion: a robot moves out of the path of approaching obstacles.

An obstacle is a moving object or a cluster of sensed cells. It is assumed to keep its
observed velocity. If that would bring it too near to a robot that follows its request,
escape motions are judged over the time until all obstacles have passed. While a good
one is known the robot waits until its `evade_time`; then, or if none is good, it takes
the best one. This one is judged again in every cycle, with some others. The robot stays
aside until the obstacles have passed or its request is free again. All other pairs keep
their required separations, those of sensed cells too: if no motion satisfies that, the
robot stays.
"""

from enum import IntEnum
from math import inf

from armguard.guard.change import TOO_MANY
from armguard.guard.commands import time_passed
from armguard.guard.evaded_cells import mark_slots
from armguard.guard.motion_pairs import asks_index
from armguard.guard.needs import robot_of
from armguard.guard.proofs import evaded_clusters
from armguard.guard.watch import RECOVERING, RESTING, RUNNING, Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import ALLOWED, PROVEN
from armguard.motion.state import Motion
from armguard.record import clear
from armguard.respond.approaching import (
    FORESIGHT,
    forget_clusters,
    has_cluster,
    is_approaching,
    look_for_approaching,
)
from armguard.respond.engagement import NO_REQUEST
from armguard.respond.escape_cells import REACH, list_moving
from armguard.respond.escape_others import may_be_met
from armguard.respond.escape_path import ENOUGH, NEAR, judge_way
from armguard.respond.escape_state import Escape
from armguard.respond.escape_ways import look_across, way_count, write_way
from armguard.respond.state import Response

# Time for which a robot is assumed to follow its request [s].
REQUEST_TIME = 0.25

# Gap at which the obstacle counts as missing the robot, so that the evasion ends [m].
CLEAR = 0.045

# Least improvement for which a robot changes to another escape motion [m].
BETTER = 8e-3

# Primitives that are placed in a cycle for a robot, beyond those of its chosen motion.
PLACED = 800

# Share of its `evade_time` up to which a robot searches before it moves [-], and number
# of motions it judges at most if it knows one that is not good.
LOOKS_UNTIL = 0.5
LOOKS_AT = 64

# Time for which a recovering robot is still held after the last obstacle approached
# [s].
LINGERS = 0.1


class Search(IntEnum):
    """Result of the search for an escape motion while a robot waits."""

    GOOD = 0  # a good one is known
    OPEN = 1  # none is known that it would take now; the search may go on
    BEST = 2  # the best one is known, and it is not good


@kernel
def look_for_threats(a: Response, w: Workspace) -> None:
    """Find robots with approaching obstacles, where anything may move.

    Args:
        a: The responses; `requested` is written already.
        w: The workspace, after a cycle was opened.
    """
    v = w.watch
    for r in range(v.evades.shape[0]):
        v.evades[r] = 0
    moves = v.movers.shape[0] != 0
    if v.clusters.shape[0] != 0 and w.settings.sensed != 0:
        for r in range(v.evades.shape[0]):
            moves |= a.settings[r].evade_time != 0.0
    if moves:
        evade_all(a, w)


@kernel(separate=True, optional=True)
def evade_all(a: Response, w: Workspace) -> None:
    """Find robots with approaching obstacles, and request escape motions for them.

    Args:
        a: The responses; `requested` is written already.
        w: The workspace, after a cycle was opened.
    """
    v, m = w.watch, w.motion
    for k in range(v.movers.shape[0]):
        v.evaded[v.movers[k]] = 0
    e = a.escape
    for r in range(v.evades.shape[0]):
        if a.settings[r].evade_time == 0.0:
            continue
        before = evaded_clusters(r, v)
        if evades(r, a, e, w, v, m):
            v.evades[r] = 1
            for c in range(e.plan.approaching_count):
                if e.approaching[c].primitive >= 0:
                    v.evaded[e.approaching[c].primitive] |= 1 << r
        else:
            forget_clusters(r, v)
        if before & ~evaded_clusters(r, v) != 0:
            # Cells that it evaded may have no row.
            v.judged_count[0] = TOO_MANY
        if v.clusters.shape[0] != 0:
            mark_slots(r, w)


@kernel
def gets_out_of_its_way(r: int, j: int, v: Watch) -> bool:
    """Whether a robot evades a primitive."""
    return bool(j < v.evaded.shape[0] and (v.evaded[j] >> r) & 1 != 0)


@kernel
def evades(
    r: int,
    a: Response,
    e: Escape,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> bool:
    """Update the evasion of a robot by a cycle, and request its escape motion.

    Returns:
        Whether the robot evades.
    """
    phase, notes = v.phase[r], e.notes[r]
    if phase != RUNNING and phase != RESTING and phase != RECOVERING:
        forget_ways(r, e, m)
        return False
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    look_for_approaching(r, a, e, w, v, m)
    approaches = e.plan.approaching_count > 0
    if approaches and is_threatened(r, a, e, w, v, m):
        left = e.plan.near_at / a.settings[r].evade_time
        look_across(r, e, w, m)
        look_for_others(r, e, w, v)
        if notes.evading == 0:
            found = look_for_way(r, a, e, w, m)
            # Cells grow at the speed of an intruder: later no motion can be proven.
            if found == Search.GOOD and left > 1.0 and not has_cluster(e):
                return False
            if found == Search.OPEN and left > LOOKS_UNTIL:
                return False
            notes.evading, notes.next_candidate = 1, max(notes.best_candidate - 1, 0)
        e.memory[r].clear_time = 0.0
        choose_way(r, a, e, w, v, m)
        for j in range(first, end):
            a.requested[j] = e.way[j] if notes.has_motion != 0 else 0.0
        return True
    asks = False
    for j in range(first, end):
        asks |= abs(a.requested[j]) > NO_REQUEST
    if not approaches:
        e.memory[r].clear_time += time_passed(v)
    ends = phase != RECOVERING and (asks or not approaches)
    stays = notes.evading != 0 and not ends and e.memory[r].clear_time <= LINGERS
    if not (stays or (approaches and is_threatened_at_rest(r, e, w, v))):
        forget_ways(r, e, m)
        return False
    # The robot is aside, and rests there until no obstacle could cause a stop.
    notes.evading, notes.has_motion = 1, 0
    for j in range(first, end):
        a.requested[j] = 0.0
    return True


@kernel
def is_threatened_at_rest(r: int, e: Escape, w: Workspace, v: Watch) -> bool:
    """Whether a passing obstacle would stop a robot, which could not evade then."""
    if v.phase[r] != RUNNING or v.must[r] == 0:
        return False
    for k in range(int(w.header.near_count)):
        near = w.near[k]
        i, j = int(near.first), int(near.second)
        proof = near.proof
        if robot_of(i, v) != r or proof == PROVEN or proof == ALLOWED:
            continue
        if is_approaching(j, e, w):
            return True
    return False


@kernel
def forget_ways(r: int, e: Escape, m: Motion) -> None:
    """Reset the evasion of a robot and its known escape motions."""
    clear(e.notes[r])
    e.memory[r].time_left = e.memory[r].clear_time = 0.0
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        e.way[j] = 0.0


@kernel
def look_for_way(r: int, a: Response, e: Escape, w: Workspace, m: Motion) -> Search:
    """Continue the search for an escape motion of a robot that waits.

    The best known one is judged again.
    """
    notes, memory, share = e.notes[r], e.memory[r], a.settings[r].evade_speed
    ways = way_count(r, m)
    memory.best_gap = -inf
    if notes.best_candidate != 0:
        go = write_way(notes.best_candidate - 1, r, share, e, m)
        memory.best_gap = judge_way(r, go, -inf, 1, a, w)
    e.plan.placed = 0
    for _ in range(ways):
        if memory.best_gap >= CLEAR:
            notes.judged = 0
            return Search.GOOD
        leads_out = memory.best_gap > 0.0 and notes.judged >= LOOKS_AT
        if leads_out or notes.judged == ways:
            return Search.BEST
        if e.plan.placed > PLACED:
            break
        go = write_way(notes.next_candidate, r, share, e, m)
        worth = judge_way(r, go, memory.best_gap, 1, a, w)
        if worth > memory.best_gap:
            notes.best_candidate, memory.best_gap = notes.next_candidate + 1, worth
        notes.next_candidate = (notes.next_candidate + 1) % ways
        notes.judged += 1
    return Search.OPEN


@kernel
def is_threatened(
    r: int, a: Response, e: Escape, w: Workspace, v: Watch, m: Motion
) -> bool:
    """Whether an obstacle would get too near to a robot that follows its request."""
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        e.trial[j] = a.requested[j] if v.phase[r] != RESTING else 0.0
    worth = judge_way(r, REQUEST_TIME, -inf, 0, a, w)
    if e.notes[r].evading != 0:
        return worth < CLEAR
    return worth < NEAR and e.plan.near_at < FORESIGHT * a.settings[r].evade_time


@kernel
def look_for_others(r: int, e: Escape, w: Workspace, v: Watch) -> None:
    """List moving cells and other primitives near a robot.

    No primitives if the index will be queried.
    """
    plan, reach = e.plan, e.reach
    if w.settings.sensed != 0:
        list_moving(r, e, w)
    plan.other_count = 0
    if asks_index(w) != 0:
        return
    for j in range(w.groups.shape[0]):
        if not may_be_met(r, j, e, w, v):
            continue
        box, near = w.world.boxes[j], True
        for k in range(3):
            near &= box[k] < reach[k + 3] + REACH and reach[k] < box[k + 3] + REACH
        if near:
            e.others[plan.other_count] = j
            plan.other_count += 1


@kernel
def choose_way(
    r: int, a: Response, e: Escape, w: Workspace, v: Watch, m: Motion
) -> None:
    """Judge rest, the present escape motion and some others; choose the best."""
    notes, memory = e.notes[r], e.memory[r]
    first = m.robot_figures[r].first_joint
    end = first + m.robot_figures[r].joint_count
    for j in range(first, end):
        e.trial[j] = 0.0
    best = judge_way(r, 0.0, -inf, 0, a, w)
    if not memory.time_left > 0.0 or best >= ENOUGH:
        notes.has_motion = 0
    if notes.has_motion != 0:
        for j in range(first, end):
            e.trial[j] = e.way[j]
        worth = judge_way(r, memory.time_left, -inf, 1, a, w)
        if worth > best - BETTER:
            best = worth
        else:
            notes.has_motion = 0
    e.plan.placed = 0
    ways = way_count(r, m)
    # A robot that is far enough aside stays there.
    stays = notes.has_motion == 0 and best >= CLEAR
    wanted = inf if stays else best + BETTER
    for _ in range(ways):
        if wanted > ENOUGH or e.plan.placed > PLACED:
            break
        go = write_way(notes.next_candidate, r, a.settings[r].evade_speed, e, m)
        worth = judge_way(r, go, wanted, 1, a, w)
        if worth >= wanted:
            for j in range(first, end):
                e.way[j] = e.trial[j]
            notes.has_motion, memory.time_left = 1, go
            wanted = worth + BETTER
        notes.next_candidate = (notes.next_candidate + 1) % ways
    memory.time_left -= time_passed(v)
