"""The walk beside the same cells as objects: as safe, and as exact where it can be."""

import numpy as np
import pytest

from armguard.cells.deltas import Delta
from armguard.guard import Level
from armguard.record import records
from sensed import (
    CELL,
    LOW,
    PERIOD,
    SIZE,
    at,
    boxed_guard,
    changes,
    feed,
    grid,
    middle,
    sensed_guard,
)

COUNT = 12

# Cells below are inside the arm's own base, which claims them [m].
CLAIMED = 0.3
NONE = records(0, Delta)

STATES = 300

# The middle of a box is computed in two ways [m].
ROUND_OFF = 1e-12


def judge(guard, q, v, t):
    """A verdict without what earlier cycles leave."""
    guard.reset()
    guard.step(q, t, velocity=v)
    return guard.step(q + PERIOD * v, t + PERIOD, velocity=v)


def random_state(rng, guard):
    """Positions within limits, and velocities up to a fifth of the top speeds."""
    low, high = guard.tables.lower, guard.tables.upper
    q = rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
    top = guard.tables.robots[0].stopping.velocity
    return q, rng.uniform(-0.2, 0.2, len(q)) * top * (rng.random() < 0.7)


def near_cells(rng, guard, q, count, apart):
    """Places of cells around the links; no two of them in a cube of `apart` cells."""
    guard.judge_at_rest(q)
    rows = guard._workspace.world.rows[: guard.tables.moving_count]
    found = {}
    while len(found) < count:
        start = rows[rng.integers(len(rows)), 1:4]
        cell = np.floor((start + rng.normal(0, 0.25, 3) - LOW) / CELL).astype(int)
        cell = np.clip(cell, 0, SIZE - 1)
        if middle(cell)[2] < CLAIMED:
            continue
        key = tuple(cell // apart)
        found.setdefault(key, tuple(cell))
    return list(found.values())


def headrooms(verdict, names):
    """Least headroom of any pair with one of the bodies; inf without one."""
    found = [p.headroom for p in verdict.near if p.b in names or p.a in names]
    return min(found, default=np.inf)


@pytest.fixture(scope="module")
def guards():
    return sensed_guard(budget=1 << 20), boxed_guard(COUNT)


def compared(guards, rng, apart, speed=1.0):
    """Verdicts of both guards on one random state."""
    sensed, boxed = guards
    q, v = random_state(rng, sensed)
    v *= speed
    cells = near_cells(rng, sensed, q, COUNT, apart)
    occupied = grid()
    for k, cell in enumerate(cells):
        occupied[cell] = True
        boxed.place(f"cell{k}", at(cell))
    start = float(sensed._sensed.table.about.stamp)
    t = 0.0 if start == -np.inf else start + 1.0
    feed(sensed, changes(occupied, grid(), t), t)
    feed(boxed, changes(grid(), grid(), t), t)
    return judge(sensed, q, v, t), judge(boxed, q, v, t)


def test_cells_alone_in_their_words_are_judged_as_boxes(guards):
    rng, near, stops = np.random.default_rng(1), 0, 0
    for _ in range(STATES):
        ours, theirs = compared(guards, rng, apart=4)
        names = {f"cell{k}" for k in range(COUNT)}
        mine, other = (headrooms(ours, {"something sensed"}), headrooms(theirs, names))
        if len(ours.near) < 40:
            assert mine == pytest.approx(other, abs=ROUND_OFF)
        assert ours.level >= theirs.level
        assert mine <= other + ROUND_OFF
        near += mine < np.inf
        stops += ours.level >= Level.STOP
    assert near > 0.75 * STATES
    assert 0.2 * STATES < stops < 0.98 * STATES


def test_an_arm_at_rest_is_blocked_by_cells_and_not_by_their_word(guards):
    rng, blocked, coarse = np.random.default_rng(3), 0, 0
    for _ in range(STATES):
        ours, theirs = compared(guards, rng, apart=2, speed=0.0)
        if len(ours.near) < 40:
            assert (ours.level >= Level.STOP) == (theirs.level >= Level.STOP)
            blocked += ours.level >= Level.STOP
            coarse += ours.level < Level.STOP
    assert blocked > 0.1 * STATES < coarse


def test_cells_that_share_words_are_judged_as_safely(guards):
    rng, near = np.random.default_rng(2), 0
    for _ in range(STATES):
        ours, theirs = compared(guards, rng, apart=1)
        names = {f"cell{k}" for k in range(COUNT)}
        mine = headrooms(ours, {"something sensed"})
        assert mine <= headrooms(theirs, names) + ROUND_OFF
        assert ours.level >= theirs.level
        near += mine < np.inf
    assert near > 0.75 * STATES
