"""Getting out of the way: what comes at a robot, when, and which way leads off.

An object that was seen with a velocity is thought to keep it. Where that would bring it
too near to a robot within the robot's `evade_time`, if that goes on as it is asked to,
ways out are judged by where they lead until all that comes has passed, and the best one
is taken. It is judged anew in every cycle, with some others. The robot is given back
when it may go on as it is asked to. All other pairs keep what they need: if that leaves
no way, it stays.
"""

from math import inf

from armguard.guard.commands import time_passed
from armguard.guard.motion_pairs import asks_index
from armguard.guard.proofs import robot_of, time_since
from armguard.guard.watch import (
    RECOVERING,
    RESTING,
    RUNNING,
    Watch,
    open_watch,
)
from armguard.guard.workspace import (
    MOTION,
    MOVING_COUNT,
    WATCH,
    Workspace,
    open_workspace,
)
from armguard.index.octree_state import ABSENT, STATUS
from armguard.kernel import kernel
from armguard.ledger import ledger_at
from armguard.motion.figures import FIRST_JOINT, JOINT_COUNT
from armguard.motion.state import Motion, open_motion
from armguard.respond.engagement import NOTHING_ASKED
from armguard.respond.escape_path import (
    ENOUGH,
    NEAR,
    judge_way,
    may_be_met,
    speed_of,
)
from armguard.respond.escape_state import (
    COMER_COUNT,
    DONE,
    EVADING,
    HAS_WAY,
    HORIZON,
    LEFT,
    MOST_COMERS,
    NEXT_TRY,
    OTHER_COUNT,
    OWN_COUNT,
    SPENT,
    WHEN,
    Escape,
    open_escape,
)
from armguard.respond.escape_ways import look_across, way_count, write_way
from armguard.respond.state import (
    EVADE_SPEED,
    EVADE_TIME,
    Response,
    open_response,
)

# What comes more slowly does not come [m/s].
SLOWEST = 0.01

# Beyond `evade_time` is looked for what comes for so long [s], and so far beside it
# [m].
LOOK_BEYOND = 0.5
BESIDE = 0.15

# What comes has passed when it is so far behind a robot [m]; longer than so long is not
# looked ahead [s].
BEHIND = 0.15
FARTHEST = 8.0

# How long a robot is thought to do what it is asked to [s].
ASKED = 0.25

# Who got out of the way is given back when what comes misses him by so much [m].
CLEAR = 0.045

# By how much another way has to be better [m].
BETTER = 8e-3

# So far from a robot all else is looked at [m].
REACH = 0.6

# Postures that are looked at in a cycle for a robot, beyond those of the way it is on.
POSTURES = 80

# A robot that leaves what is too near is held for so long when nothing comes any more
# [s].
LINGERS = 0.1


@kernel(inline=False)
def look_for_threats(response: int, lines: int) -> None:
    """Find robots that something comes at, and ask for a way that leads off.

    Args:
        response: Address of the ledger of the responses; `asked` is written already.
        lines: Address of the ledger of the workspace, after a cycle was opened.
    """
    a, w = open_response(ledger_at(response)), open_workspace(ledger_at(lines))
    v, m = open_watch(w.parts[WATCH]), open_motion(w.parts[MOTION])
    for r in range(v.evades.shape[0]):
        v.evades[r] = 0
    for k in range(v.movers.shape[0]):
        v.evaded[v.movers[k]] = 0
    if v.movers.shape[0] == 0:
        return
    e = open_escape(a.escape)
    for r in range(v.evades.shape[0]):
        if a.settings[r, EVADE_TIME] == 0.0:
            continue
        if evades(r, response, lines, a, e, w, v, m):
            v.evades[r] = 1
            for c in range(e.counts[COMER_COUNT]):
                v.evaded[e.comers[c]] |= 1 << r
        else:
            e.notes[r, EVADING] = e.notes[r, HAS_WAY] = 0


@kernel
def gets_out_of_its_way(r: int, j: int, v: Watch) -> bool:
    """Whether a robot is getting out of the way of a primitive."""
    return bool(j < v.evaded.shape[0] and (v.evaded[j] >> r) & 1 != 0)


@kernel
def evades(
    r: int,
    response: int,
    lines: int,
    a: Response,
    e: Escape,
    w: Workspace,
    v: Watch,
    m: Motion,
) -> bool:
    """Go on by a cycle: say whether a robot gets out of the way, and ask for it."""
    phase, notes = v.phase[r], e.notes[r]
    if phase != RUNNING and phase != RESTING and phase != RECOVERING:
        return False
    first = int(m.robot_figures[r, FIRST_JOINT])
    end = first + int(m.robot_figures[r, JOINT_COUNT])
    look_for_comers(r, a, e, w, v, m)
    comes = e.counts[COMER_COUNT] > 0
    if comes and is_threatened(r, response, lines, a, e, v, m):
        if notes[EVADING] == 0:
            notes[EVADING], notes[NEXT_TRY] = 1, 0
        e.memory[r, DONE] = 0.0
        look_across(r, e, w, v, m)
        look_for_others(r, e, w, v)
        choose_way(r, response, lines, a, e, v, m)
        for j in range(first, end):
            a.asked[j] = e.way[j] if notes[HAS_WAY] != 0 else 0.0
        return True
    asks = False
    for j in range(first, end):
        asks |= abs(a.asked[j]) > NOTHING_ASKED
    if notes[EVADING] == 0 or (phase != RECOVERING and (asks or not comes)):
        return False
    # It is out of the way, and stands there until nobody could tell it to stop.
    if not comes:
        e.memory[r, DONE] += time_passed(v)
    notes[HAS_WAY] = 0
    for j in range(first, end):
        a.asked[j] = 0.0
    return bool(e.memory[r, DONE] <= LINGERS)


@kernel
def look_for_comers(
    r: int, a: Response, e: Escape, w: Workspace, v: Watch, m: Motion
) -> None:
    """Find what may come near a robot soon; write how long that takes to pass."""
    counts, reach, boxes = e.counts, e.reach, w.world.boxes
    counts[OWN_COUNT] = counts[COMER_COUNT] = 0
    for k in range(3):
        reach[k], reach[k + 3] = inf, -inf
    for i in range(w.settings[MOVING_COUNT]):
        if robot_of(i, v) != r:
            continue
        e.own[counts[OWN_COUNT]] = i
        counts[OWN_COUNT] += 1
        for k in range(3):
            reach[k] = min(reach[k], boxes[i, k])
            reach[k + 3] = max(reach[k + 3], boxes[i, k + 3])
    ahead = a.settings[r, EVADE_TIME] + LOOK_BEYOND
    horizon = 0.0
    for c in range(v.movers.shape[0]):
        j = int(v.movers[c])
        speed = speed_of(j, v)
        if not speed > SLOWEST or w.octree.residency[j, STATUS] == ABSENT:
            continue
        comes, way = True, 0.0
        since = time_since(v.seen_at[j], v, m)
        for k in range(3):
            x = v.object_velocity[j, k]
            low, high = boxes[j, k] + since * x, boxes[j, k + 3] + since * x
            comes &= low + min(ahead * x, 0.0) - BESIDE < reach[k + 3]
            comes &= high + max(ahead * x, 0.0) + BESIDE > reach[k]
            way += x * (reach[k + 3] - low if x > 0.0 else reach[k] - high)
        if not comes or counts[COMER_COUNT] == MOST_COMERS:
            continue
        e.comers[counts[COMER_COUNT]] = j
        counts[COMER_COUNT] += 1
        horizon = max(horizon, (way / speed + BEHIND) / speed)
    e.plan[HORIZON] = min(horizon, FARTHEST)


@kernel
def is_threatened(
    r: int, response: int, lines: int, a: Response, e: Escape, v: Watch, m: Motion
) -> bool:
    """Whether what comes gets too near to a robot that goes on as it is asked to."""
    first = int(m.robot_figures[r, FIRST_JOINT])
    for j in range(first, first + int(m.robot_figures[r, JOINT_COUNT])):
        e.trial[j] = a.asked[j] if v.phase[r] != RESTING else 0.0
    worth = judge_way(r, ASKED, -inf, 0, response, lines)
    if e.notes[r, EVADING] != 0:
        return worth < CLEAR
    return worth < NEAR and e.plan[WHEN] < a.settings[r, EVADE_TIME]


@kernel
def look_for_others(r: int, e: Escape, w: Workspace, v: Watch) -> None:
    """Find what a robot may run into, unless the index is going to be asked."""
    counts, reach = e.counts, e.reach
    counts[OTHER_COUNT] = 0
    if asks_index(w) != 0:
        return
    for j in range(w.groups.shape[0]):
        if not may_be_met(r, j, e, w, v):
            continue
        box, near = w.world.boxes[j], True
        for k in range(3):
            near &= box[k] < reach[k + 3] + REACH and reach[k] < box[k + 3] + REACH
        if near:
            e.others[counts[OTHER_COUNT]] = j
            counts[OTHER_COUNT] += 1


@kernel
def choose_way(
    r: int, response: int, lines: int, a: Response, e: Escape, v: Watch, m: Motion
) -> None:
    """Judge to stay, the way a robot is on, and some others; take the best."""
    notes, memory = e.notes[r], e.memory[r]
    first = int(m.robot_figures[r, FIRST_JOINT])
    end = first + int(m.robot_figures[r, JOINT_COUNT])
    for j in range(first, end):
        e.trial[j] = 0.0
    best = judge_way(r, 0.0, -inf, 0, response, lines)
    if not memory[LEFT] > 0.0 or best >= ENOUGH:
        notes[HAS_WAY] = 0
    if notes[HAS_WAY] != 0:
        for j in range(first, end):
            e.trial[j] = e.way[j]
        worth = judge_way(r, memory[LEFT], -inf, 1, response, lines)
        if worth > best - BETTER:
            best = worth
        else:
            notes[HAS_WAY] = 0
    e.counts[SPENT] = 0
    ways = way_count(r, m)
    wanted = best + BETTER
    for _ in range(ways):
        if wanted > ENOUGH or e.counts[SPENT] > POSTURES:
            break
        go = write_way(notes[NEXT_TRY], r, a.settings[r, EVADE_SPEED], e, m)
        worth = judge_way(r, go, wanted, 1, response, lines)
        if worth >= wanted:
            for j in range(first, end):
                e.way[j] = e.trial[j]
            notes[HAS_WAY], memory[LEFT] = 1, go
            wanted = worth + BETTER
        notes[NEXT_TRY] = (notes[NEXT_TRY] + 1) % ways
    memory[LEFT] -= time_passed(v)
