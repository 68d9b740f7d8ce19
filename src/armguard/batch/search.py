"""Pairs of eight configurations or spans: which parts are near enough to compare."""

from math import inf
from typing import Any

from armguard.batch.balls import SLACK
from armguard.batch.cells import find_cells, free_gap, free_room
from armguard.batch.plan import Plan
from armguard.batch.pose import MOTIONS, Place, place
from armguard.batch.scratch import Scratch
from armguard.batch.settle import (
    CODE,
    SHIFT,
    compare_parts,
    growth_of,
    number,
    settle,
)
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import WIDTH, either, item, load, size, some, splat, store


@kernel(inline=False)
def search(p: Plan, s: Scratch, w: Place) -> None:
    """Settle every pair that may matter: balls of parts, then their primitives.

    What a lane finds does not depend on the others: a pair is settled only in those
    lanes in which no ball has shown it apart. Pairs that may be near are listed before
    they are compared: a list is written without branches.
    """
    find_cells(p, w)
    if w.mode[0] != MOTIONS:
        try_leads(p, s, w)
    for a in range(p.loose.shape[0]):
        place(item(p.parts, 4 * a + 2), p, w)
    count = list_by_cells(p, s, w)
    compare_listed(0, list_by_balls(count, p, s, w), p, s, w)
    count = list_standing(p, s, w)
    for at in range(count):
        compare_nodes(w.open[at], load(w.apart, at * WIDTH), count, p, s, w)


@kernel(inline=False)
def compare_listed(begin: int, count: int, p: Plan, s: Scratch, w: Place) -> None:
    """Compare the pairs of parts that are listed, from a place on."""
    for at in range(begin, count):
        if not some(load(w.best, 0) > -inf):
            return
        compare_parts(w.open[at], load(w.apart, at * WIDTH), p, s, w)


@kernel
def listed(near: Any, k: int, count: int, w: Place) -> int:
    """Write a number to the list; returns the next place if any lane is near."""
    w.open[count] = k
    store(w.apart, count * WIDTH, either(near, splat(0.0), -inf))
    return count + int(some(near))


@kernel
def grown(k: int, reach_a: float, reach_b: float, p: Plan, w: Place) -> Any:
    """How far a span may carry points of both bodies of a listed pair [m]."""
    first, second = item(p.ends, 4 * k), item(p.ends, 4 * k + 1)
    return (
        load(w.shift, first)
        + load(w.swing, first) * reach_a
        + (load(w.shift, second) + load(w.swing, second) * reach_b)
    )


@kernel(inline=False)
def list_by_cells(p: Plan, s: Scratch, w: Place) -> int:
    """List the pairs with cells that may be near; returns how many."""
    count, strict, best = 0, s.settings.strict, load(w.best, 0)
    for k in range(item(p.listed, 0)):
        a, b = item(p.pairs, 3 * k), item(p.pairs, 3 * k + 1)
        growth = grown(k, item(p.sways, 2 * a + 1), item(p.sways, 2 * b + 1), p, w)
        need = best + (growth + (item(p.buffers, k) * strict + SLACK))
        count = listed(need > free_gap(k, p, s, w), k, count, w)
    return count


@kernel(inline=False)
def list_by_balls(count: int, p: Plan, s: Scratch, w: Place) -> int:
    """List those without cells as well; returns how many there are in all."""
    strict, best = s.settings.strict, load(w.best, 0)
    for k in range(item(p.listed, 0), item(p.listed, 1)):
        a, b = item(p.pairs, 3 * k), item(p.pairs, 3 * k + 1)
        own, other = item(p.ends, 4 * k + 2), item(p.ends, 4 * k + 3)
        radii = item(p.rows, own // WIDTH - 1) + item(p.rows, other // WIDTH - 1)
        swayed = item(p.sways, 2 * b) if b < p.loose.shape[0] else 0.0
        growth = grown(k, item(p.sways, 2 * a), swayed, p, w)
        reach = best + (growth + (radii + (item(p.buffers, k) * strict + SLACK)))
        x = load(w.rows, own) - load(w.rows, other)
        y = load(w.rows, own + WIDTH) - load(w.rows, other + WIDTH)
        z = load(w.rows, own + 2 * WIDTH) - load(w.rows, other + 2 * WIDTH)
        near = reach * size(reach) > x * x + y * y + z * z
        count = listed(near, k, count, w)
    return count


@kernel
def reach_of(a: int, p: Plan, s: Scratch, w: Place) -> Any:
    """Radius and growth of a part's ball, with its largest buffer [m]."""
    ball = item(p.parts, 4 * a + 2)
    own = item(p.loose, a) * s.settings.strict + SLACK
    own = own + item(p.rows, ROW_WIDTH * ball)
    return growth_of(item(p.bodies, ball), item(p.sways, 2 * a), 0, p, w) + own


@kernel(inline=False)
def list_standing(p: Plan, s: Scratch, w: Place) -> int:
    """List the parts that may be near what does not move; returns how many."""
    count, best = 0, load(w.best, 0)
    for a in range(p.loose.shape[0]):
        ball = item(p.parts, 4 * a + 2)
        x, y = number(w.rows, ball, 1), number(w.rows, ball, 2)
        room = free_room(x, y, number(w.rows, ball, 3), p, s)
        count = listed(best + reach_of(a, p, s, w) > room, a, count, w)
    return count


@kernel(inline=False)
def compare_nodes(
    a: int, apart: Any, begin: int, p: Plan, s: Scratch, w: Place
) -> None:
    """Settle the pairs of a part with what does not move.

    Args:
        a: The part.
        apart: 0, or minus infinity in lanes in which all that is known to be apart.
        begin: First place of the list that is not in use.
        p: The plan.
        s: The scratch.
        w: Where the part is.
    """
    ball, parts, nodes = p.parts[a, 2], p.pair_at.shape[1], p.nodes.shape[0]
    u, v = number(w.rows, ball, 1), number(w.rows, ball, 2)
    t = number(w.rows, ball, 3)
    reach = reach_of(a, p, s, w) + apart
    far, at, count = load(w.best, 0) + reach, 0, begin
    while at < nodes:
        x, y = u - item(p.nodes, 4 * at), v - item(p.nodes, 4 * at + 1)
        z = t - item(p.nodes, 4 * at + 2)
        wide = far + item(p.nodes, 4 * at + 3)
        near = wide * size(wide) > x * x + y * y + z * z
        b = item(p.links, 2 * at + 1)
        if b >= 0:
            k = item(p.pair_at, a * parts + b)
            count += (listed(near, k, count, w) - count) * int(k >= 0)
            at += 1
        elif some(near):
            at += 1
        else:
            at = item(p.links, 2 * at)
        if count == w.open.shape[0]:
            compare_listed(begin, count, p, s, w)
            far, count = load(w.best, 0) + reach, begin
    compare_listed(begin, count, p, s, w)


@kernel(inline=False)
def try_leads(p: Plan, s: Scratch, w: Place) -> None:
    """Begin with the pairs that decided last."""
    last = -1.0
    for lane in range(WIDTH):
        code = w.lead[lane]
        if code < 0.0 or code == last:
            continue
        last = code
        i, j = int(code) >> SHIFT, int(code) & (CODE - 1)
        a, b = p.part[i], p.part[j]
        k = p.pair_at[a, b]
        growth = growth_of(p.bodies[i], p.spread[i], p.pairs[k, 2], p, w)
        if b < p.loose.shape[0]:
            growth = growth + growth_of(p.bodies[j], p.spread[j], p.pairs[k, 2], p, w)
        settle(i, j, p.buffers[k] * s.settings.strict, growth, 0, p, s, w)
