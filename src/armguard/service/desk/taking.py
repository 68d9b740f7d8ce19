"""Decodes a message that was let in: measured states and the desired motion."""

from math import isfinite
from typing import Any

from armguard.address import array_at, pointer
from armguard.kernel import kernel
from armguard.respond.state import MOST_TWISTS
from armguard.service.desk.desk import (
    DESIRED_NOT_FINITE,
    JOINTS,
    NOT_COMMANDER,
    PAYLOAD,
    ROBOTS,
    SECOND_CONTROLLER,
    TAKEN,
    Desk,
    Longs,
    open_desk,
    signed,
)
from armguard.service.wire.layout import (
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    SEAL,
    STATE,
    TWIST,
    WISH,
    Form,
)

STATE_ROW, DESIRED_ROW = STATE.dtype, WISH.dtype

# Where a payload begins, where the joints of a STATE begin, and the length of the head
# of a WISH [bytes].
PAYLOAD_AT = HEADER.size
POSITIONS_AT = HEADER.size + STATE.size
DESIRED_SIZE = WISH.size

VELOCITIES, POSITIONS, TWISTS = (int(form) for form in Form)


@kernel(inline=False, entry=True)
def take_state(desk: Longs) -> int:
    """Take a STATE over, and the desired motion in it.

    Args:
        desk: Ledger of a desk: its message is a STATE, and its `arrival` describes it.

    Returns:
        TAKEN, or why it was dropped; then nothing has changed. `arrival` has what came
        of the desired motion.
    """
    d = open_desk(desk)
    arrival = d.arrival
    arrival.has_desired = 0
    size = arrival.length
    if size < POSITIONS_AT + SEAL:
        return PAYLOAD
    state = array_at(pointer(d.message.ctypes.data + PAYLOAD_AT), (1,), STATE_ROW)[0]
    bits, flags = signed(state["robots"]), signed(state["flags"])
    robots = d.first_joint.shape[0]
    if bits == 0 or bits >> robots != 0:
        return ROBOTS
    joints = 0
    for r in range(robots):
        if (bits >> r) & 1 != 0:
            joints += d.joint_count[r]
    both = 2 if flags & HAS_VELOCITY != 0 else 1
    end = POSITIONS_AT + 8 * joints * both
    room = size - SEAL - end
    with_desired = flags & HAS_WISH != 0
    # The head of a desired motion says how long that is.
    if room < DESIRED_SIZE if with_desired else room != 0:
        return JOINTS
    for r in range(robots):
        other = d.sender[r] != arrival.sender and d.sender[r] != 0
        if (bits >> r) & 1 != 0 and other:
            if arrival.now - d.heard[r] < arrival.watchdog:
                return SECOND_CONTROLLER
    keep_state(state, joints, both, d)
    if with_desired:
        arrival.has_desired = 1
        arrival.desired_outcome = keep_desired_motion(end, d)
    return TAKEN


@kernel
def keep_state(state: Any, joints: int, both: int, d: Desk) -> None:
    """Copy the numbers of a STATE that is valid.

    Args:
        state: Its head, see `State`.
        joints: How many joints its robots have together.
        both: 2 if there are velocities, else 1.
        d: The desk.
    """
    arrival, words = d.arrival, d.message
    bits, stamp = signed(state["robots"]), state["stamp"]
    at = POSITIONS_AT // 8
    every = 1
    for r in range(d.first_joint.shape[0]):
        if (bits >> r) & 1 != 0:
            first = d.first_joint[r]
            for k in range(d.joint_count[r]):
                d.q[first + k] = words[at + k]
                if both == 2:
                    d.velocity[first + k] = words[at + joints + k]
            at += d.joint_count[r]
            d.stamps[r] = stamp
            d.measured[r] = both - 1
            d.sender[r], d.sequence[r] = arrival.sender, arrival.sequence
            d.heard[r] = arrival.now
        every &= d.measured[r]
    arrival.measured = every


@kernel(inline=False, entry=True)
def take_desired_motion(desk: Longs) -> int:
    """Take a WISH over.

    Args:
        desk: See `take_state`.

    Returns:
        TAKEN, or why it was dropped.
    """
    return keep_desired_motion(PAYLOAD_AT, open_desk(desk))


@kernel(inline=False)
def keep_desired_motion(start: int, d: Desk) -> int:
    """Take over the desired motion that begins there [bytes]."""
    arrival, words = d.arrival, d.message
    room = arrival.length - SEAL - start - DESIRED_SIZE
    if room < 0:
        return PAYLOAD
    head = array_at(pointer(words.ctypes.data + start), (1,), DESIRED_ROW)[0]
    form, count = signed(head["form"]), signed(head["numbers"])
    if room != 8 * count:
        return PAYLOAD
    if arrival.token == 0 or signed(head["token"]) != arrival.token:
        return NOT_COMMANDER
    at = (start + DESIRED_SIZE) // 8
    if form == TWISTS:
        # At most one twist a tool.
        if count % TWIST != 0 or count > TWIST * min(MOST_TWISTS, d.tools.shape[0]):
            return JOINTS
    elif form != VELOCITIES and form != POSITIONS:
        return PAYLOAD
    elif count != d.desired.shape[0]:
        return JOINTS
    finite = True
    for k in range(count):
        finite &= isfinite(words[at + k])
    if not finite:
        return DESIRED_NOT_FINITE
    if form == TWISTS:
        if not tools_are_known(at, count, d):
            return JOINTS
        keep_twists(at, count, d)
    else:
        for k in range(count):
            d.desired[k] = words[at + k]
        arrival.desired_count = count
    arrival.desired_form = form
    return TAKEN


@kernel
def tools_are_known(at: int, count: int, d: Desk) -> bool:
    """Whether every twist names a tool by its index."""
    for k in range(at, at + count, TWIST):
        tool = d.message[k]
        if not 0.0 <= tool < d.tools.shape[0] or tool != int(tool):
            return False
    return True


@kernel
def keep_twists(at: int, count: int, d: Desk) -> None:
    """Copy twists; of two for one tool the later one counts."""
    kept = 0
    for k in range(at, at + count, TWIST):
        place = kept
        for i in range(kept):
            if d.twists[i].tool == d.message[k]:
                place = i
        d.twists[place].tool = int(d.message[k])
        for i in range(6):
            d.twists[place].twist[i] = d.message[k + 1 + i]
        kept = max(kept, place + 1)
    d.arrival.desired_count = kept
