"""Known free cells of a ball become unknown: something is in it, at no known place."""

from math import sqrt

import numpy as np

from armguard.cells.deltas import push
from armguard.cells.evidence import claims_of, evidence_of
from armguard.cells.state import ARRIVAL_SIDE, WORD_SIDE, Triple
from armguard.cells.words import (
    bit,
    corner_of,
    member_corner,
    middle_of,
    put_word,
    word_at,
)
from armguard.geometry.vec3 import Vec3, norm, sub
from armguard.kernel import kernel
from armguard.table import LongVector


@kernel
def cells_in_ball(corner: Vec3, cell: float, middle: Vec3, radius: float) -> np.uint64:
    """Cells of a word that a ball may touch.

    Args:
        corner: Lower corner of the word [m].
        cell: Edge of a cell [m].
        middle: Middle of the ball [m].
        radius: Its radius [m].
    """
    found = np.uint64(0)
    reach = radius + 0.5 * sqrt(3.0) * cell
    for k in range(64):
        at = middle_of(member_corner(corner, cell, k), cell)
        if norm(sub(at, middle)) <= reach:
            found |= bit(k)
    return found


@kernel(inline=False, entry=True)
def forget_cells(
    ball: Triple, radius: float, stamp: float,
    evidence_lines: LongVector, claims_lines: LongVector,
) -> None:  # fmt: skip
    """Forget the known free cells that a ball may touch.

    Words without occupied cells that were seen later keep what they have, and occupied
    cells stay.

    Args:
        ball: Middle of the ball, world, shape (3,) [m].
        radius: Its radius [m].
        stamp: When something was in it [s].
        evidence_lines: Lines of `Evidence`: arrival times; words that change wait to be
            sent.
        claims_lines: Lines of `Claims`.
    """
    evidence, claims = evidence_of(evidence_lines), claims_of(claims_lines)
    lattice = claims.lattice
    middle, edge = (ball[0], ball[1], ball[2]), WORD_SIDE * lattice.cell
    sides, half = lattice.side // WORD_SIDE, ARRIVAL_SIDE // WORD_SIDE
    blocks = lattice.side // ARRIVAL_SIDE
    x0, y0, z0 = (
        int(max((middle[0] - radius - lattice.low[0]) / edge - 1.0, 0.0)),
        int(max((middle[1] - radius - lattice.low[1]) / edge - 1.0, 0.0)),
        int(max((middle[2] - radius - lattice.low[2]) / edge - 1.0, 0.0)),
    )
    count = int(2.0 * radius / edge) + 4
    for z in range(z0, min(z0 + count, sides)):
        for y in range(y0, min(y0 + count, sides)):
            for x in range(x0, min(x0 + count, sides)):
                word = word_at(x, y, z, lattice.blocks)
                # The stamp of a word with occupied cells is theirs.
                free = claims.occupied.words[word] == 0
                if free and claims.stamp[word] > stamp:
                    continue
                corner = corner_of((x, y, z), WORD_SIDE, lattice)
                lost = cells_in_ball(corner, lattice.cell, middle, radius)
                unknown = claims.unknown.words[word]
                lost &= ~(unknown | claims.occupied.words[word])
                if lost == 0:
                    continue
                put_word(word, unknown | lost, claims.unknown)
                push(word, False, evidence)
                if evidence.arrival.shape[0] > 0:
                    block = ((z // half) * blocks + y // half) * blocks + x // half
                    evidence.arrival[block] = min(evidence.arrival[block], stamp)
