"""Changes of a map, sent to a copy a few at a time."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.cells.state import Claims, Evidence
from armguard.cells.words import put_word
from armguard.kernel import kernel
from armguard.record import Records, Short, record
from armguard.table import LongVector, opener

# Bit of `Evidence.marks`: the claims of the word were changed since they were sent.
CHANGED = 4


@record
class Delta:
    """Claims about a word.

    It is sent when its cells or their motion change, when the stamp of occupied cells
    does, and when the error of a word that is not wholly free does.

    Attributes:
        bits: Its occupied cells, and its unknown ones.
        stamp: See `Claims` [s].
        error: See `Claims` [m].
        word: Number of the word.
        motion: `Motion` of its occupied cells.
        source: See `Claims`.
    """

    bits: Annotated[NDArray[np.uint64], (2,)]
    stamp: float
    error: float
    word: Short
    motion: Short
    source: Short


claims_of, evidence_of = opener(Claims), opener(Evidence)


@kernel
def push(word: int, first: bool, out: Evidence) -> None:
    """Put a word into a ring of those that wait.

    Args:
        word: The word.
        first: Whether it has new occupied cells, which go first.
        out: Evidence; a ring has room for every word once.
    """
    ring = 0 if first else 1
    mark = int(out.marks[word])
    if mark & (1 << ring) == 0:
        room = out.marks.shape[0]
        place = (out.ends[2 * ring] + out.ends[2 * ring + 1]) % room
        out.waiting[ring * room + place] = word
        out.ends[2 * ring + 1] += 1
    out.marks[word] = mark | (1 << ring) | CHANGED


@kernel
def pop(ring: int, out: Evidence) -> int:
    """Take the first word of a ring, -1 if it is empty."""
    if out.ends[2 * ring + 1] == 0:
        return -1
    room = out.marks.shape[0]
    word = int(out.waiting[ring * room + out.ends[2 * ring]])
    out.ends[2 * ring] = (out.ends[2 * ring] + 1) % room
    out.ends[2 * ring + 1] -= 1
    return word


@kernel(inline=False, entry=True)
def take_deltas(
    claims_lines: LongVector, evidence_lines: LongVector, out: Records[Delta]
) -> int:
    """Write the claims of words that wait, and take these off their rings.

    Args:
        claims_lines: Lines of `Claims`.
        evidence_lines: Lines of `Evidence`.
        out: Deltas, overwritten; words with new occupied cells come first.

    Returns:
        Count of deltas written.
    """
    claims, evidence = claims_of(claims_lines), evidence_of(evidence_lines)
    taken = 0
    for ring in range(2):
        while taken < out.shape[0]:
            word = pop(ring, evidence)
            if word < 0:
                break
            mark = int(evidence.marks[word])
            evidence.marks[word] = mark & ~(1 << ring) & 3
            # A word in both rings was sent when it left the first one.
            if mark & CHANGED != 0:
                delta = out[taken]
                delta.word = word
                delta.bits[0] = claims.occupied.words[word]
                delta.bits[1] = claims.unknown.words[word]
                delta.stamp, delta.error = claims.stamp[word], claims.error[word]
                delta.motion = claims.motion[word]
                delta.source = claims.source[word]
                taken += 1
    return taken


@kernel(inline=False, entry=True)
def apply_deltas(deltas: Records[Delta], claims_lines: LongVector) -> None:
    """Set the claims of words."""
    claims = claims_of(claims_lines)
    for k in range(deltas.shape[0]):
        delta = deltas[k]
        word = delta.word
        put_word(word, delta.bits[0], claims.occupied)
        put_word(word, delta.bits[1], claims.unknown)
        claims.stamp[word], claims.error[word] = delta.stamp, delta.error
        claims.motion[word], claims.source[word] = delta.motion, delta.source
