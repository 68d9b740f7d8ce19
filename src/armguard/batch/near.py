"""Pairs of a batch with witness points, and the gradient of their distance."""

from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.batch.check import take_block, take_rows
from armguard.batch.plan import Plan
from armguard.batch.pose import Place, move_bodies, place, spread
from armguard.batch.scratch import Scratch
from armguard.batch.search import search
from armguard.batch.settle import gap_in_lane
from armguard.geometry.vec3 import Vec3, cross, dot, sub
from armguard.geometry.witness import WITNESS_WIDTH, turn_witness
from armguard.kernel import kernel
from armguard.lanes import WIDTH
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.table import LongMatrix, LongVector, Matrix, opener, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@table
class Listing(NamedTuple):
    """Pairs of primitives in rows of a batch.

    Attributes:
        total: How many there are, shape (1,).
        pairs: Row of the batch and the two primitives, the lower one first; -1 and -1
            for a row that cannot be judged, shape (k, 3).
        witness: Their witness rows, see `write_witness`; NaN for such a row, (k, 10).
        gradient: Derivative of the distance by each joint, shape (k, n) [m/rad or 1].
    """

    total: LongVector
    pairs: LongMatrix
    witness: Matrix
    gradient: Matrix


open_plan = opener(Plan)
open_place = opener(Place)
open_scratch = opener(Scratch)
open_listing = opener(Listing)


@kernel(inline=False, entry=True)
def list_near(
    q: Floats, start: int, plan: Longs, rows: Longs, scratch: Longs, listing: Longs
) -> int:
    """List every pair that is nearer than the margin, for as many rows as fit.

    Args:
        q: Joint positions, shape (rows, n) [rad or m].
        start: Row to begin with.
        plan: Ledger of the plan.
        rows: Ledger of a place of mode NEAR.
        scratch: Ledger of the scratch, with settings.
        listing: Ledger of the listing; pairs are added to it.

    Returns:
        The first row that did not fit: `rows` where all did.
    """
    p, w = open_plan(plan), open_place(rows)
    s, found = open_scratch(scratch), open_listing(listing)
    spread(p, w)
    spread(p, s.cells)
    for first in range(start, q.shape[0], WIDTH):
        move_rows(q, first, p, s, w)
        s.kept[:] = 0
        search(p, s, w)
        before, full = found.total[0], False
        for lane in range(min(WIDTH, q.shape[0] - first)):
            full = full or not list_row(first + lane, lane, p, s, w, found)
        if full:
            found.total[0] = before
            return first
    return len(q)


@kernel(inline=False, entry=True)
def measure_pairs(
    q: Floats, plan: Longs, rows: Longs, scratch: Longs, listing: Longs
) -> None:
    """Witness row and gradient of one given pair in each row.

    Args:
        q: Joint positions, shape (rows, n) [rad or m].
        plan: Ledger of the plan.
        rows: Ledger of a place.
        scratch: Ledger of the scratch, with settings.
        listing: Ledger of the listing, with a pair for each row or -1 for none; its
            witness rows and gradients are written.
    """
    p, w = open_plan(plan), open_place(rows)
    s, found = open_scratch(scratch), open_listing(listing)
    spread(p, w)
    for first in range(0, q.shape[0], WIDTH):
        move_rows(q, first, p, s, w)
        for lane in range(min(WIDTH, q.shape[0] - first)):
            write_pair(first + lane, lane, p, s, w, found)


@kernel
def move_rows(q: Floats, first: int, p: Plan, s: Scratch, w: Place) -> None:
    """Move the bodies of eight lanes to eight rows."""
    take_block(q, first, 1, s)
    take_rows(s.block, 0, q.shape[1], True, s, w)
    move_bodies(0, p, w)


@kernel(inline=False)
def list_row(
    row: int, lane: int, p: Plan, s: Scratch, w: Place, found: Listing
) -> bool:
    """Add the pairs of one row to the listing; returns False if they do not fit."""
    unjudged = w.pair[lane] == -2.0
    count, room = s.kept[lane], s.low.shape[0] // WIDTH
    if count < 0 and not unjudged:
        return False
    for k in range(1 if unjudged else count):
        at = found.total[0]
        if at == found.pairs.shape[0]:
            return False
        i, j = -1, -1
        if not unjudged:
            i, j = s.pairs[lane * room + k, 0], s.pairs[lane * room + k, 1]
        found.pairs[at, 0] = row
        found.pairs[at, 1], found.pairs[at, 2] = min(i, j), max(i, j)
        write_pair(at, lane, p, s, w, found)
        if unjudged or found.witness[at, 0] < s.settings.margin:
            found.total[0] = at + 1
    return True


@kernel(inline=False)
def write_pair(
    at: int, lane: int, p: Plan, s: Scratch, w: Place, found: Listing
) -> None:
    """Write witness row and gradient of a listed pair; NaN where there is no pair."""
    i, j = found.pairs[at, 1], found.pairs[at, 2]
    witness, gradient = found.witness[at], found.gradient[at]
    if i < 0 or w.pair[lane] == -2.0:
        witness[:] = nan
        gradient[:] = nan
        return
    place(i, p, w)
    place(j, p, w)
    gap_in_lane(i, j, lane, p, s, w)
    for k in range(WITNESS_WIDTH):
        witness[k] = s.single[2, k]
    if p.kinds[i] > p.kinds[j]:
        turn_witness(witness)
    gradient[:] = 0.0
    normal = witness[7], witness[8], witness[9]
    on_a = witness[1], witness[2], witness[3]
    on_b = witness[4], witness[5], witness[6]
    add_gradient(lane, p.bodies[i], -1.0, on_a, normal, p, w, gradient)
    add_gradient(lane, p.bodies[j], 1.0, on_b, normal, p, w, gradient)


@kernel
def add_gradient(
    lane: int,
    body: int,
    sign: float,
    point: Vec3,
    normal: Vec3,
    p: Plan,
    w: Place,
    gradient: Floats,
) -> None:
    """Add what each joint before a body moves one of its points along the normal."""
    T = w.T
    while body >= 0:
        if p.parent[body] >= 0 and p.joint_kind[body] != FIXED:
            f = body * 12 * WIDTH + lane
            axis = T[f + 2 * WIDTH], T[f + 6 * WIDTH], T[f + 10 * WIDTH]
            origin = T[f + 3 * WIDTH], T[f + 7 * WIDTH], T[f + 11 * WIDTH]
            rate = axis
            if p.joint_kind[body] != PRISMATIC:
                rate = cross(axis, sub(point, origin))
            gradient[p.q_index[body]] += sign * p.gain[body, 0] * dot(normal, rate)
        body = p.parent[body]
