"""Earliest times at which an intruder can be in a block of cells.

A block that a frame has wholly seen free holds nothing at its stamp. An intruder that
is in it later has come from a block that was not seen then: at the frame's stamp, or
when it could first be in that block. From there it has at least the distance from face
to face to go. Steps to the 26 neighbours, scaled down, are never longer than the
straight line.
"""

from math import inf, sqrt

from armguard.cells.carve import look_of
from armguard.cells.deltas import push
from armguard.cells.evidence import claims_of, evidence_of
from armguard.cells.state import (
    ARRIVAL_SIDE,
    EVERY_MEMBER,
    WORD_SIDE,
    Evidence,
    Look,
)
from armguard.cells.words import member_of_group, place_of_word, put_word
from armguard.kernel import kernel
from armguard.table import LongVector, Vector

# Steps to neighbours across a face, an edge and a corner [blocks]. A way of steps of
# 1, √2 and √3 is at most this factor longer than the straight line.
LONGER = sqrt(1.0 + (sqrt(2.0) - 1.0) ** 2 + (sqrt(3.0) - sqrt(2.0)) ** 2)
FACE, EDGE, CORNER = 1.0 / LONGER, sqrt(2.0) / LONGER, sqrt(3.0) / LONGER

# Words of a block, and along an edge of it.
FULL, HALF = 8, ARRIVAL_SIDE // WORD_SIDE

Box = tuple[int, int, int, int, int, int]


@kernel
def box_of_seen(side: int, seen: Look) -> Box:
    """Lower corner and sizes of the box about the seen blocks, grown by one block.

    Its lower corner may be -1, beside the cube; its sizes are 0 if no block was seen.
    """
    x0, y0, z0, x1, y1, z1 = side, side, side, -1, -1, -1
    for z in range(side):
        for y in range(side):
            first = (z * side + y) * side
            row = seen.seen[first : first + side]
            # Without a branch for a block the compiler compares many at a time.
            some = False
            for x in range(side):
                some |= row[x] == FULL
            if not some:
                continue
            y0, z0, y1, z1 = min(y0, y), min(z0, z), max(y1, y), max(z1, z)
            for x in range(side):
                if row[x] == FULL:
                    x0, x1 = min(x0, x), max(x1, x)
    if x1 < 0:
        return 0, 0, 0, 0, 0, 0
    return x0 - 1, y0 - 1, z0 - 1, x1 - x0 + 3, y1 - y0 + 3, z1 - z0 + 3


@kernel
def write_sources(
    stamp: float, side: int, box: Box, look: Look, evidence: Evidence, out: Vector
) -> None:
    """Earliest times at which something can leave each block of a box.

    Infinite for those that were seen; of others not before the frame.
    """
    at = 0
    for k in range(box[5]):
        z = box[2] + k
        for j in range(box[4]):
            y = box[1] + j
            for i in range(box[3]):
                x = box[0] + i
                out[at] = stamp
                if 0 <= x < side and 0 <= y < side and 0 <= z < side:
                    block = (z * side + y) * side + x
                    if look.seen[block] == FULL:
                        out[at] = inf
                    else:
                        out[at] = max(stamp, evidence.arrival[block])
                at += 1


@kernel
def relax_row(
    source: int, target: int, count: int, straight: float, across: float, times: Vector,
    out: Vector,
) -> None:  # fmt: skip
    """Lower the times of a row by steps from another row.

    Args:
        source: First place of the other row in `times`.
        target: First place of the row in `out`.
        count: Blocks of a row.
        straight: Time of the step without a change of x [s].
        across: Time of a step to the next x [s].
        times: Times of the other row [s].
        out: Times.
    """
    for i in range(count):
        out[target + i] = min(out[target + i], times[source + i] + straight)
    for i in range(count - 1):
        out[target + i] = min(out[target + i], times[source + i + 1] + across)
    for i in range(1, count):
        out[target + i] = min(out[target + i], times[source + i - 1] + across)


@kernel
def step_into(box: Box, times: Vector, out: Vector) -> None:
    """Times at which something is in a block or in one beside it: they touch."""
    nx, ny, nz = box[3], box[4], box[5]
    for k in range(nz):
        for j in range(ny):
            target = (k * ny + j) * nx
            out[target : target + nx] = inf
            for dz in range(max(k - 1, 0), min(k + 2, nz)):
                for dy in range(max(j - 1, 0), min(j + 2, ny)):
                    relax_row((dz * ny + dy) * nx, target, nx, 0.0, 0.0, times, out)


@kernel
def spread_row(
    j: int, k: int, sign: int, box: Box, edge_time: float, out: Vector
) -> None:
    """Lower the times of row j, k by steps from the rows before it, and along it.

    Args:
        j: Place of the row along y.
        k: Place of it along z.
        sign: 1 if rows before it have lower places, -1 if they have higher ones.
        box: The box.
        edge_time: Time to cross a block [s].
        out: Times.
    """
    nx, ny, nz = box[3], box[4], box[5]
    target = (k * ny + j) * nx
    face, edge, corner = FACE * edge_time, EDGE * edge_time, CORNER * edge_time
    if 0 <= k - sign < nz:
        for dy in range(max(j - 1, 0), min(j + 2, ny)):
            source = ((k - sign) * ny + dy) * nx
            if dy == j:
                relax_row(source, target, nx, face, edge, out, out)
            else:
                relax_row(source, target, nx, edge, corner, out, out)
    if 0 <= j - sign < ny:
        relax_row((k * ny + j - sign) * nx, target, nx, face, edge, out, out)
    for i in range(1, nx):
        if sign > 0:
            out[target + i] = min(out[target + i], out[target + i - 1] + face)
        else:
            at = target + nx - 1 - i
            out[at] = min(out[at], out[at + 1] + face)


@kernel(inline=False, entry=True)
def raise_arrivals(
    stamp: float, edge_time: float, look_lines: LongVector, evidence_lines: LongVector
) -> None:
    """Raise the arrival times of the blocks that a frame has wholly seen free.

    Args:
        stamp: Time of the frame [s].
        edge_time: Time in which an intruder crosses a block, infinite if it does not
            move [s].
        look_lines: Lines of `Look`; afterwards no block is seen.
        evidence_lines: Lines of `Evidence`: arrival times.
    """
    look, evidence = look_of(look_lines), evidence_of(evidence_lines)
    side = look.lattice.side // 8
    box = box_of_seen(side, look)
    size = box[3] * box[4] * box[5]
    sources, times = look.scratch[:size], look.scratch[size : 2 * size]
    write_sources(stamp, side, box, look, evidence, sources)
    step_into(box, sources, times)
    for k in range(box[5]):
        for j in range(box[4]):
            spread_row(j, k, 1, box, edge_time, times)
    for k in range(box[5] - 1, -1, -1):
        for j in range(box[4] - 1, -1, -1):
            spread_row(j, k, -1, box, edge_time, times)
    at = 0
    for k in range(box[5]):
        for j in range(box[4]):
            for i in range(box[3]):
                x, y, z = box[0] + i, box[1] + j, box[2] + k
                # The border of the box may lie outside the cube.
                if 0 <= x < side and 0 <= y < side and 0 <= z < side:
                    block = (z * side + y) * side + x
                    if look.seen[block] == FULL:
                        reached = inf if edge_time == inf else times[at]
                        evidence.arrival[block] = max(evidence.arrival[block], reached)
                at += 1
    look.seen[:] = 0


@kernel
def reached_members(group: int, stamp: float, look: Look, evidence: Evidence) -> int:
    """Cubes of 8³ cells of a group into which an intruder may have come by a time.

    Bit k is set for member k. Those without known free cells may be left out.
    """
    side, blocks = look.lattice.side // ARRIVAL_SIDE, look.lattice.blocks
    x, y, z = place_of_word(group << 6, blocks)
    first = ((z // HALF) * side + y // HALF) * side + x // HALF
    reached = 0
    for k in range(8):
        block = first + ((k >> 2) * side + (k >> 1 & 1)) * side + (k & 1)
        if evidence.arrival[block] <= stamp:
            reached |= 1 << k
    return int(reached & look.opened[group])


@kernel(inline=False, entry=True)
def expire_words(
    stamp: float, look_lines: LongVector, evidence_lines: LongVector,
    claims_lines: LongVector,
) -> None:  # fmt: skip
    """Turn known free cells into unknown ones where an intruder may be by now.

    Args:
        stamp: The time [s].
        look_lines: Lines of `Look`: where known free cells may be.
        evidence_lines: Lines of `Evidence`: arrival times; words that change wait to be
            sent.
        claims_lines: Lines of `Claims`.
    """
    look, evidence = look_of(look_lines), evidence_of(evidence_lines)
    claims = claims_of(claims_lines)
    for group in range(look.opened.shape[0]):
        if look.opened[group] == 0:
            continue
        reached = reached_members(group, stamp, look, evidence)
        if reached == 0:
            continue
        look.opened[group] &= EVERY_MEMBER & ~reached
        for word in range(group << 6, (group + 1) << 6):
            unknown = ~claims.occupied.words[word]
            member = 1 << member_of_group(word)
            if reached & member != 0 and claims.unknown.words[word] != unknown:
                put_word(word, unknown, claims.unknown)
                push(word, False, evidence)
