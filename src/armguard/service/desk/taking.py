"""Decodes a message that was let in: measured states and the desired motion."""

from math import isfinite
from typing import Any

from armguard.kernel import kernel
from armguard.respond.state import MOST_TWISTS
from armguard.service.desk.desk import (
    HAS_WISH,
    JOINTS,
    MEASURED,
    NOT_COMMANDER,
    NOW,
    PAYLOAD,
    ROBOTS,
    SECOND_CONTROLLER,
    SENDER,
    SEQUENCE,
    SIZE,
    TAKEN,
    TOKEN,
    TWIST_AT,
    WATCHDOG,
    WISH_COUNT,
    WISH_FORM,
    WISH_NOT_FINITE,
    WISH_OUTCOME,
    Desk,
    open_desk,
    records,
    signed,
)
from armguard.service.wire.layout import HAS_VELOCITY, HEADER, SEAL, STATE, TWIST, Form
from armguard.service.wire.layout import HAS_WISH as WITH_WISH
from armguard.service.wire.layout import WISH as WISH_HEAD

STATE_ROW, WISH_ROW = STATE.dtype, WISH_HEAD.dtype

# Where a payload begins, where the joints of a STATE begin, and how long the head of a
# WISH is [bytes].
PAYLOAD_AT = HEADER.size
POSITIONS_AT = HEADER.size + STATE.size
WISH_SIZE = WISH_HEAD.size

VELOCITIES, POSITIONS, TWISTS = (int(form) for form in Form)


@kernel(inline=False, entry=True)
def take_state(address: int) -> int:
    """Take a STATE over, and the WISH in it.

    Args:
        address: Address of the ledger of a desk: its message is a STATE, and `given`
            describes it.

    Returns:
        TAKEN, or why it was dropped; then nothing has changed. What came of the WISH in
        it is written to `given`.
    """
    d = open_desk(address)
    given = d.given
    given[HAS_WISH] = 0
    size = given[SIZE]
    if size < POSITIONS_AT + SEAL:
        return PAYLOAD
    state = records(d.message, PAYLOAD_AT, 1, STATE_ROW)[0]
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
    with_wish = flags & WITH_WISH != 0
    # With a WISH there is more; how much more its own head says.
    if room < WISH_SIZE if with_wish else room != 0:
        return JOINTS
    for r in range(robots):
        other = d.sender[r] != given[SENDER] and d.sender[r] != 0
        if (bits >> r) & 1 != 0 and other:
            if given[NOW] - d.heard[r] < given[WATCHDOG]:
                return SECOND_CONTROLLER
    keep_state(state, joints, both, d)
    if with_wish:
        given[HAS_WISH] = 1
        given[WISH_OUTCOME] = keep_wish(end, d)
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
    given, words = d.given, d.message
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
            d.sender[r], d.sequence[r] = given[SENDER], given[SEQUENCE]
            d.heard[r] = given[NOW]
        every &= d.measured[r]
    given[MEASURED] = every


@kernel(inline=False, entry=True)
def take_wish(address: int) -> int:
    """Take a WISH over.

    Args:
        address: See `take_state`.

    Returns:
        TAKEN, or why it was dropped.
    """
    return keep_wish(PAYLOAD_AT, open_desk(address))


@kernel(inline=False)
def keep_wish(start: int, d: Desk) -> int:
    """Take over the WISH that begins there [bytes]."""
    given, words = d.given, d.message
    room = given[SIZE] - SEAL - start - WISH_SIZE
    if room < 0:
        return PAYLOAD
    wish = records(words, start, 1, WISH_ROW)[0]
    form, count = signed(wish["form"]), signed(wish["numbers"])
    if room != 8 * count:
        return PAYLOAD
    if given[TOKEN] == 0 or signed(wish["token"]) != given[TOKEN]:
        return NOT_COMMANDER
    at = (start + WISH_SIZE) // 8
    if form == TWISTS:
        # At most one twist a tool.
        if count % TWIST != 0 or count > TWIST * min(MOST_TWISTS, d.tools.shape[0]):
            return JOINTS
    elif form != VELOCITIES and form != POSITIONS:
        return PAYLOAD
    elif count != d.wish.shape[0]:
        return JOINTS
    finite = True
    for k in range(count):
        finite &= isfinite(words[at + k])
    if not finite:
        return WISH_NOT_FINITE
    if form == TWISTS:
        if not tools_are_known(at, count, d):
            return JOINTS
        keep_twists(at, count, d)
    else:
        for k in range(count):
            d.wish[k] = words[at + k]
        given[WISH_COUNT] = count
    given[WISH_FORM] = form
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
            if d.twists[i, 0] == d.message[k]:
                place = i
        for i in range(TWIST_AT + 6):
            d.twists[place, i] = d.message[k + i]
        kept = max(kept, place + 1)
    d.given[WISH_COUNT] = kept
