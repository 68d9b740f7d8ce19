"""Lower bounds of gaps, kept in cells.

Of two links over the joints between them, and of a point of the world from what does
not move. A cell's number depends on nothing but the cell. It is computed when it is
needed first, so the cells of a plan fill while it is used.
"""

from math import inf, sqrt
from typing import Any

from armguard.batch.balls import SLACK
from armguard.batch.grids import COARSE, FINE
from armguard.batch.plan import Plan
from armguard.batch.pose import Place, move_bodies, widen_body
from armguard.batch.scratch import Scratch
from armguard.batch.settle import SPHERE, compare_parts
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import (
    WIDTH,
    bits,
    either,
    floor,
    item,
    least,
    load,
    lowest,
    most,
    pick,
    some,
    splat,
    store,
)

# Bytes of a cell that is not computed yet, and of one whose gap may be negative. Larger
# ones count steps of the gap.
UNKNOWN = 0
CLOSE = 1
LARGEST = 255

# A step, a power of 2 [m].
STEP = 0.001953125

# Coarse cells in a fine one.
PER_FINE = COARSE / FINE


@kernel
def code_of(gap: float) -> int:
    """The byte of a cell whose gap is not below a number [m]."""
    if not gap >= 0.0:
        return CLOSE
    return int(min(gap / STEP, LARGEST - 2.0)) + 2


@kernel
def gap_of_code(code: Any) -> Any:
    """What the gap is not below in cells with these bytes [m]."""
    return either(code > CLOSE, (code - 2.0) * STEP, -inf)


@kernel
def cell(x: Any, low: float, per_width: float, side: int) -> Any:
    """Number of the cell of each lane; the first and the last hold all beyond them."""
    return least(most(floor((x - low) * per_width), 0.0), side - 1.0)


@kernel(inline=False)
def find_cells(p: Plan, w: Place) -> None:
    """Cells of all joint positions."""
    for j in range(p.grid.shape[0]):
        low, per_width = item(p.grid, 2 * j), item(p.grid, 2 * j + 1)
        store(w.cells, j * WIDTH, cell(load(w.q, j * WIDTH), low, per_width, FINE))


@kernel
def free_gap(k: int, p: Plan, s: Scratch, w: Place) -> Any:
    """What the gap of a pair of parts is not below, in each lane [m]."""
    first, count = item(p.ways, 5 * k), item(p.ways, 5 * k + 1)
    index = load(w.cells, item(p.ways, 5 * k + 2) * WIDTH)
    if count == 3:
        index = floor(PER_FINE * index)
    for d in range(1, count):
        one = load(w.cells, item(p.ways, 5 * k + 2 + d) * WIDTH)
        if count == 3:
            index = index * COARSE + floor(PER_FINE * one)
        else:
            index = index * FINE + one
    found = pick(p.gaps, index + first)
    missing = bits(found == UNKNOWN)
    if missing != 0:
        store(s.sides, 0, index)
        fill_gaps(k, missing, p, s)
        found = pick(p.gaps, index + first)
    return gap_of_code(found)


@kernel(inline=False)
def fill_gaps(k: int, left: int, p: Plan, s: Scratch) -> None:
    """Fill the cells of a pair in which some lanes are, numbered in `s.sides`."""
    first = p.ways[k, 0]
    while left != 0:
        at = int(s.sides[lowest(left)])
        left &= left - 1
        if p.gaps[first + at] == UNKNOWN:
            fill_block(k, at - at % WIDTH, p, s, s.cells)


@kernel(inline=False)
def fill_block(k: int, begin: int, p: Plan, s: Scratch, w: Place) -> None:
    """Fill eight cells of a pair that follow each other."""
    a, b, carrier = p.pairs[k, 0], p.pairs[k, 1], p.pairs[k, 2] - 1
    count = p.ways[k, 1]
    side = COARSE if count == 3 else FINE
    widths = FINE // side
    w.q[:] = 0.0
    w.half[:] = 0.0
    store(w.best, 0, splat(inf))
    rest = begin
    for d in range(count - 1, -1, -1):
        j, number = p.ways[k, 2 + d], rest % side
        rest //= side
        for lane in range(WIDTH):
            at = number + (lane if d == count - 1 else 0)
            w.q[j * WIDTH + lane] = p.grid[j, 0] + widths * (at + 0.5) / p.grid[j, 1]
            w.half[j * WIDTH + lane] = 0.5 * widths / p.grid[j, 1]
            if at == 0 or at == side - 1:
                w.best[lane] = -inf
    for r in range(12):
        one = 1.0 if r % 5 == 0 else 0.0
        store(w.T, (carrier * 12 + r) * WIDTH, splat(one))
    move_bodies(carrier + 1, p, w)
    widen_body(p.bodies[p.parts[a, 2]], carrier, p, w)
    widen_body(p.bodies[p.parts[b, 2]], carrier, p, w)
    compare_parts(k, splat(0.0), p, s, w)
    for lane in range(WIDTH):
        p.gaps[p.ways[k, 0] + begin + lane] = code_of(w.best[lane])


@kernel
def free_room(x: Any, y: Any, z: Any, p: Plan, s: Scratch) -> Any:
    """What the distance of points from all that does not move is not below [m]."""
    index = cell(x, p.region[0, 0], p.region[0, 1], COARSE)
    index = index * COARSE + cell(y, p.region[1, 0], p.region[1, 1], COARSE)
    index = index * COARSE + cell(z, p.region[2, 0], p.region[2, 1], COARSE)
    found = pick(p.room, index)
    if some(found == UNKNOWN):
        store(s.sides, 0, index)
        for lane in range(WIDTH):
            at = int(s.sides[lane])
            if p.room[at] == UNKNOWN:
                p.room[at] = code_of(room_of_cell(at, p, s))
        found = pick(p.room, index)
    return gap_of_code(found)


@kernel(inline=False)
def room_of_cell(at: int, p: Plan, s: Scratch) -> float:
    """Least distance of a cell's points from what does not move, or less [m]."""
    point, squared, rest = s.single[0], 0.0, at
    for r in range(2, -1, -1):
        number = rest % COARSE
        rest //= COARSE
        if number == 0 or number == COARSE - 1:
            return -inf
        point[1 + r] = p.region[r, 0] + (number + 0.5) / p.region[r, 1]
        squared += 0.25 / (p.region[r, 1] * p.region[r, 1])
    point[0] = 0.0
    found, node = inf, 0
    while node < p.nodes.shape[0]:
        x, y = point[1] - p.nodes[node, 0], point[2] - p.nodes[node, 1]
        z = point[3] - p.nodes[node, 2]
        if sqrt(x * x + y * y + z * z) - p.nodes[node, 3] >= found:
            node = p.links[node, 0]
            continue
        part = p.links[node, 1]
        node += 1
        if part >= 0:
            hull = p.parts[part, 3]
            for r in range(ROW_WIDTH):
                s.single[1, r] = p.rows[hull, r]
            measure(SPHERE, point, p.kinds[hull], s.single[1], s.single[2])
            found = min(found, float(s.single[2, 0]))
    return found - (sqrt(squared) + SLACK)
