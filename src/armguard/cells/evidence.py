"""Evidence of cells: hits and passes of a frame become claims."""

import numpy as np

from armguard.cells.deltas import push
from armguard.cells.state import (
    ALL,
    NO_SENSOR,
    NONE,
    SEVERAL,
    Claims,
    Evidence,
    Look,
    Motion,
    Words,
)
from armguard.cells.words import member_of_group, place_of_word, put_word, touch
from armguard.kernel import kernel
from armguard.lanes import ones
from armguard.table import IntVector, LongVector, opener

STILL, MOVING = int(Motion.STILL), int(Motion.MOVING)

claims_of, evidence_of, look_of = opener(Claims), opener(Evidence), opener(Look)


@kernel
def count(word: int, hit: np.uint64, passed: np.uint64, out: Evidence) -> None:
    """Add 2 to the evidence of hit cells, take 1 from that of passed ones.

    Args:
        word: The word.
        hit: Its cells that are hit.
        passed: Its cells that are passed, none of which is hit.
        out: Evidence, kept within 0 and 7.
    """
    a, b, c = out.ones[word], out.twos[word], out.fours[word]
    carry = b & hit
    above = c & carry
    b, c = b ^ hit, c ^ carry
    a, b, c = a | above, b | above, c | above
    less = (a | b | c) & passed
    a = a ^ less
    borrow = less & a
    b = b ^ borrow
    c = c ^ (borrow & b)
    out.ones[word], out.twos[word], out.fours[word] = a, b, c


@kernel
def common_source(one: int, other: int) -> int:
    """Source of claims that are of two sources."""
    if one == other or other == NO_SENSOR:
        return one
    return other if one == NO_SENSOR else SEVERAL


@kernel
def recent_of(
    word: int, stamp: float, settles: float, occupied: np.uint64, out: Evidence
) -> np.uint64:
    """Cells of a word that were occupied before this frame; those of now are added.

    At the edge of a stationary body noise hits cells in one frame, and passes
    them in another one; so do a sensor with wide zones and a camera.

    Args:
        word: The word.
        stamp: Time of the frame [s].
        settles: See `settle`; a word that was empty for twice that time forgets.
        occupied: Its occupied cells after the frame.
        out: Evidence.
    """
    if stamp - out.occupied_at[word] > 2.0 * settles:
        out.recent[word] = NONE
    before: np.uint64 = out.recent[word]
    if occupied != 0:
        out.recent[word] = before | occupied
        out.occupied_at[word] = stamp
    return before


@kernel
def motion_of(
    word: int, stamp: float, settles: float, motion: int, hit: bool,
    appeared: np.uint64, occupied: np.uint64, evidence: Evidence,
) -> int:  # fmt: skip
    """Motion of the cells of a word after a frame; notes those that move.

    Args:
        word: The word.
        stamp: Time of the frame [s].
        settles: Time after which a cell that appeared is still [s].
        motion: Their motion before, STILL or MOVING.
        hit: Whether the frame hits one of them.
        appeared: Those that were known free before.
        occupied: All that are occupied now.
        evidence: Evidence of the map.
    """
    returned = appeared & recent_of(word, stamp, settles, occupied, evidence)
    if appeared != returned:
        before = NONE if motion == STILL else evidence.moving[word]
        evidence.moving[word] = before | appeared
        evidence.appeared[word] = stamp
        return MOVING
    young = stamp - evidence.appeared[word] < settles
    if returned != 0 and young:
        evidence.moving[word] |= returned
        return MOVING
    return STILL if occupied == 0 or (hit and not young) else motion


@kernel
def basis_of(
    word: int, error: float, source: int, whole: bool, confirms: bool, out: Claims
) -> tuple[float, int]:
    """Error of the pose and source from which the claims of a word are after a frame.

    A frame of a worse pose that only confirms them changes neither: they hold already,
    by better poses.

    Args:
        word: The word.
        error: Error of the frame's pose [m].
        source: Its sensor.
        whole: Whether it looked at all cells that are not unknown.
        confirms: Whether no claim has changed, none is forgotten in time, and nothing
            is hit.
        out: The claims before.
    """
    before, other = float(out.error[word]), int(out.source[word])
    # Errors are kept as singles.
    rounded = float(np.float32(error))
    farthest = rounded if whole else max(before, rounded)
    if confirms and farthest > before:
        return before, other
    return farthest, source if whole else common_source(other, source)


@kernel
def settle_word(
    word: int, stamp: float, error: float, settles: float, source: int,
    look: Look, evidence: Evidence, out: Claims,
) -> np.uint64:  # fmt: skip
    """Turn the hits and passes of a word into claims; see `settle`.

    Returns:
        Cells that were passed.
    """
    inside, shell = look.inside[word], look.shell[word]
    hit = look.sure[word] & ~(inside | shell)
    seen_past = look.passes[word] & ~look.hits[word]
    occupied_before, unknown_before = out.occupied.words[word], out.unknown.words[word]
    held = look.kept[word] | shell & ~unknown_before
    passed: np.uint64 = seen_past & ~held | inside
    look.notes.hit += ones(hit)
    look.notes.passed += ones(passed)
    look.hits[word] = look.sure[word] = look.passes[word] = NONE
    looked = hit | passed
    if looked == 0:
        return passed
    count(word, hit, passed, evidence)
    occupied = evidence.twos[word] | evidence.fours[word]
    unknown = unknown_before & ~(passed | occupied)
    new = occupied & ~occupied_before
    appeared = new & ~unknown_before
    motion = motion_of(
        word, stamp, settles, int(out.motion[word]), hit != 0, appeared, occupied,
        evidence,
    )  # fmt: skip
    whole, at = looked & ~unknown == ~unknown, stamp
    if not whole:
        at = min(out.stamp[word], stamp)
        aged = occupied if motion == STILL else occupied & evidence.moving[word]
        if occupied != 0 and aged & ~looked == 0:
            # It matters of no other cells when they were seen.
            at = stamp
    # Cells in own links are free whatever the pose of the sensor.
    news = hit | occupied ^ occupied_before | unknown_before & ~(unknown | inside)
    confirms = news == 0 and look.seen.shape[0] == 0
    farthest, origin = basis_of(word, error, source, whole, confirms, out)
    # Of a word without occupied cells the time of the look matters to no reader, and of
    # one that is wholly free its error neither: most words of most frames.
    changed = occupied != occupied_before or unknown != unknown_before
    changed |= motion != out.motion[word]
    changed |= occupied != 0 and at != out.stamp[word]
    changed |= occupied | unknown != 0 and farthest != out.error[word]
    if occupied != occupied_before:
        put_word(word, occupied, out.occupied)
    if unknown != unknown_before:
        put_word(word, unknown, out.unknown)
    look.opened[word >> 6] |= 1 << member_of_group(word)
    out.motion[word], out.source[word] = motion, origin
    out.stamp[word], out.error[word] = at, farthest
    if changed:
        push(word, new != 0, evidence)
    return passed


@kernel(inline=False, entry=True)
def settle(
    stamp: float, error: float, settles: float, source: int,
    look_lines: LongVector, evidence_lines: LongVector, claims_lines: LongVector,
) -> None:  # fmt: skip
    """Turn the hits and passes of a frame into claims, and empty the frame.

    Cells inside own links are passed, for no other body is there. Occupied cells of the
    shell around them stay, and none is added: what touches a link is neither erased nor
    taken for a foreign body. Unknown cells of the shell are passed as any other, unless
    they are kept.

    Args:
        stamp: Time of the frame [s].
        error: Error of the pose of its sensor [m].
        settles: Time after which a cell that appeared is still [s].
        source: Number of the sensor, or `NO_SENSOR`.
        look_lines: Lines of `Look`; afterwards it has no hits and no passes.
        evidence_lines: Lines of `Evidence`.
        claims_lines: Lines of `Claims`.
    """
    look, evidence = look_of(look_lines), evidence_of(evidence_lines)
    claims = claims_of(claims_lines)
    look.notes.hit = look.notes.passed = 0
    for k in range(look.notes.masked):
        word = look.masked[k]
        if look.inside[word] != 0:
            touch(word, look)
            look.passes[word] |= look.inside[word]
    blocks = claims.lattice.blocks
    edge = claims.lattice.side // 8
    for k in range(look.notes.touched):
        word = look.touched[k]
        passed = settle_word(
            word, stamp, error, settles, source, look, evidence, claims
        )
        if passed == ALL and look.seen.shape[0] > 0:
            x, y, z = place_of_word(word, blocks)
            look.seen[((z >> 1) * edge + (y >> 1)) * edge + (x >> 1)] += 1
    look.notes.touched = 0


@kernel
def make_unknown(word: int, cells: np.uint64, evidence: Evidence, out: Claims) -> None:
    """Make cells of a word unknown, unless they are occupied."""
    before = out.unknown.words[word]
    unknown: np.uint64 = before | cells & ~out.occupied.words[word]
    if unknown != before:
        put_word(word, unknown, out.unknown)
        push(word, False, evidence)


@kernel(inline=False, entry=True)
def withdraw(
    source: int, words: IntVector, passes: Words,
    look_lines: LongVector, evidence_lines: LongVector, claims_lines: LongVector,
) -> None:  # fmt: skip
    """Make the cells unknown that a frame has passed.

    Not those of own links, and none of a word that another sensor has wholly looked at
    since.

    Args:
        source: Number of the sensor of the frame.
        words: Words that it has touched, shape (n,).
        passes: Cells of these that it has passed, shape (n,).
        look_lines: Lines of `Look`, with own links.
        evidence_lines: Lines of `Evidence`; words that change wait to be sent.
        claims_lines: Lines of `Claims`.
    """
    look, evidence = look_of(look_lines), evidence_of(evidence_lines)
    claims = claims_of(claims_lines)
    for k in range(words.shape[0]):
        word = int(words[k])
        if claims.source[word] == source or claims.source[word] == SEVERAL:
            own = look.inside[word] | look.shell[word]
            make_unknown(word, passes[k] & ~own, evidence, claims)


@kernel(inline=False, entry=True)
def withdraw_all(
    source: int, look_lines: LongVector, evidence_lines: LongVector,
    claims_lines: LongVector,
) -> None:  # fmt: skip
    """Make the words unknown that a sensor has looked at, alone or with others.

    But for cells of own links: no sensor decides on these.

    Args:
        source: Number of the sensor.
        look_lines: Lines of `Look`, with own links.
        evidence_lines: Lines of `Evidence`; words that change wait to be sent.
        claims_lines: Lines of `Claims`.
    """
    look, evidence = look_of(look_lines), evidence_of(evidence_lines)
    claims = claims_of(claims_lines)
    for word in range(claims.stamp.shape[0]):
        if claims.source[word] == source or claims.source[word] == SEVERAL:
            own = look.inside[word] | look.shell[word]
            make_unknown(word, ~own, evidence, claims)
