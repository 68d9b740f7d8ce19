"""Exact shapes of links whose primitives are too near, in eight configurations.

They decide as in a guard: two links are at least as far apart as their primitives, and
at least as far as their exact shapes.
"""

from math import inf
from typing import Any

from armguard.batch.plan import Plan
from armguard.batch.pose import Place
from armguard.batch.scratch import Scratch
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import WIDTH, bits, least, load, lowest, splat, store


@kernel
def is_refined(i: int, j: int, p: Plan) -> bool:
    """Whether the link of any of two primitives has exact shapes."""
    return bool(p.exact_of[i, 1] + p.exact_of[j, 1] > 0)


@kernel(inline=False)
def refined(
    i: int, j: int, buffer: float, gap: Any, growth: Any, p: Plan, s: Scratch, w: Place
) -> Any:
    """Distances of two primitives above their buffer, or of their exact shapes.

    Of these in the lanes in which the primitives, moved by a growth, are too near. The
    two links are as far apart as the larger of both distances.
    """
    best = load(w.best, 0)
    left = bits(gap - growth < least(best, splat(0.0)))
    if left == 0:
        return gap
    store(w.bound, 0, gap)
    while left != 0:
        lane = lowest(left)
        left &= left - 1
        exact = exact_gap(i, j, lane, p, s, w) - buffer
        # NaN leaves the primitives too near.
        if exact > w.bound[lane]:
            w.bound[lane] = exact
    return load(w.bound, 0)


@kernel(inline=False)
def exact_gap(i: int, j: int, lane: int, p: Plan, s: Scratch, w: Place) -> float:
    """Signed distance of the exact shapes of two primitives' links, in a lane [m]."""
    nearest = inf
    for m in range(max(p.exact_of[i, 1], 1)):
        kind_a = take_exact(i, m, 0, lane, p, s, w)
        for n in range(max(p.exact_of[j, 1], 1)):
            kind_b = take_exact(j, n, 1, lane, p, s, w)
            measure(kind_a, s.single[0], kind_b, s.single[1], s.single[2])
            if not s.single[2, 0] >= nearest:
                nearest = s.single[2, 0]
    return float(nearest)


@kernel(inline=False)
def take_exact(
    i: int, m: int, side: int, lane: int, p: Plan, s: Scratch, w: Place
) -> int:
    """Write the world row of the m-th exact shape of a primitive's link.

    Args:
        i: The primitive.
        m: Which of the exact shapes; the primitive where there is none.
        side: Row of `Scratch.single` that is written.
        lane: The configuration.
        p: The plan.
        s: The scratch.
        w: Where the bodies are.

    Returns:
        ShapeKind of that shape.
    """
    kind, row, body = p.kinds[i], p.rows[i], p.bodies[i]
    if p.exact_of[i, 1] > 0:
        e = p.exact_of[i, 0] + m
        kind, row = p.exact_kinds[e], p.exact_rows[e]
    if body < 0:
        for k in range(ROW_WIDTH):
            s.single[side, k] = row[k]
        return int(kind)
    for k in range(12):
        s.single[3, k] = w.T[(body * 12 + k) * WIDTH + lane]
    place_row(kind, row, s.single[3], s.single[side])
    return int(kind)
