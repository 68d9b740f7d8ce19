"""Half-spaces in place of cells: as near as the cells, and enough in a narrow place."""

import numpy as np
import pytest

from armguard.geometry.shapes import ShapeKind
from armguard.guard import Level, Reason
from armguard.guard.sensed import GIVEN_UP, SLOTS, CellKind
from sensed import PERIOD, changes, feed, sensed_guard

CELL, SIZE = 0.025, 128
LOW = np.array([0.0, 0.0, 0.5]) - 0.5 * SIZE * CELL

# Middles of all cells [m].
MIDDLES = LOW + CELL * (np.stack(np.indices((SIZE,) * 3), axis=-1) + 0.5)


def distances(guard, q):
    """Distance of each cell's middle from the nearest link at q, by brute force [m]."""
    guard.judge_at_rest(q)
    world, best = guard._workspace.world, np.full(MIDDLES.shape[:3], np.inf)
    for k in range(guard.tables.moving_count):
        row = world.rows[k]
        way = MIDDLES - row[1:4]
        if world.kinds[k] == ShapeKind.BOX:
            inside = np.clip(way @ row[7:16].reshape(3, 3), -row[4:7], row[4:7])
            nearest = inside @ row[7:16].reshape(3, 3).T
        else:
            u = row[4:7] - row[1:4]
            t = np.clip(way @ u / max(u @ u, 1e-12), 0.0, 1.0)
            nearest = t[..., None] * u
        best = np.minimum(best, np.linalg.norm(way - nearest, axis=-1) - row[0])
    return best


@pytest.fixture(scope="module")
def guard():
    return sensed_guard(unknown="still", cell=CELL, size=SIZE)


def judged(guard, unknown, stamp):
    """The verdict on an arm at rest at home among unknown cells."""
    feed(guard, changes(np.zeros_like(unknown), unknown, stamp), stamp)
    guard.reset()
    still = np.zeros(len(guard.home))
    for k in range(5):
        verdict = guard.step(guard.home, stamp + k * PERIOD, velocity=still)
    return verdict


def hole(guard, clear):
    """Cells whose every point is farther than `clear` from all links at home [m]."""
    apart = distances(guard, guard.home)
    return apart, apart - 0.5 * np.sqrt(3.0) * CELL > clear


def next_stamp(guard):
    """A stamp after the last one [s]."""
    return max(float(guard._sensed.table.about.stamp), 0.0) + 1.0


def test_an_arm_in_a_narrow_hole_of_unknown_space_is_not_stopped(guard):
    apart, far = hole(guard, 0.024)
    verdict = judged(guard, far, next_stamp(guard))
    near = [pair for pair in verdict.near if "not known free" in pair.b]
    assert guard._sensed.table.coarse.max() == 1
    assert 0 < len(near) <= SLOTS[CellKind.UNSEEN]
    least = min(pair.distance for pair in near)
    # A plane may lie before its cells by a quarter of the distance, and not behind.
    assert 0.75 * 0.024 <= least <= apart[far].min() - 0.5 * CELL
    assert verdict.level < Level.STOP, verdict.why


def test_what_words_spend_on_proofs_is_left_for_planes():
    # By words the proofs take all tests, before the slots are full.
    guard = sensed_guard(unknown="still", cell=CELL, size=SIZE, budget=320)
    verdict = judged(guard, hole(guard, 0.024)[1], next_stamp(guard))
    assert guard._sensed.table.coarse.max() == 1
    assert verdict.level < Level.STOP, verdict.why


def test_an_arm_stops_in_a_hole_too_narrow_for_its_slots(guard):
    _, far = hole(guard, 0.003)
    verdict = judged(guard, far, next_stamp(guard))
    assert verdict.level >= Level.STOP
    assert verdict.reason == Reason.CROWDED
    assert "more cells" in verdict.why
    # Nothing moves in a path of one place, and yet not all of it can be judged.
    path = guard.check_path([guard.home])
    assert guard._sensed.table.coarse.max() == GIVEN_UP
    assert not path.clear
    assert "too much is near" in path.sentence


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_space_farther_than_the_margin_is_not_near(guard, share):
    far = hole(guard, 0.03)[1]
    far &= np.random.default_rng(4).random(far.shape) < share
    verdict = judged(guard, far, next_stamp(guard))
    assert verdict.level == Level.CLEAR, verdict.why
