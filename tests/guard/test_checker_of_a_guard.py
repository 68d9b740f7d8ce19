"""A guard's checker: the world as it is, with what is held, against boxes by hand."""

from itertools import combinations

import numpy as np
import pytest

import armguard as ag
from grippers import Loop, boxes_at, gap, guard_of, pick_scene

BLOCKS = {"block": (0.0, 0.0), "other": (0.25, 0.0)}

BUFFER = 0.005


@pytest.fixture(scope="module")
def loop():
    """A gantry that holds a block, 0.3 m above the table."""
    loop = Loop(guard_of(pick_scene(blocks=BLOCKS)))
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    assert loop.go({"arm/open_left": 0.02, "arm/open_right": 0.02}, speed=0.02)
    loop.guard.grasp("arm", "block")
    assert loop.go({"arm/z": 0.3}, speed=0.1)
    return loop


def rows_near(loop, count=2000):
    """Rows in which the gripper holds the block anywhere above the table."""
    rng = np.random.default_rng(0)
    rows = np.tile(loop.q, (count, 1))
    rows[:, :3] = rng.uniform((-0.1, -0.15, 0.06), (0.45, 0.15, 0.25), (count, 3))
    return rows


def least_gaps(loop, q, held):
    """Least distance of any two bodies that are checked, by their corners [m].

    At each row of joint positions.
    """
    guard = loop.guard
    T_held = guard.tables.T_parent_joint[guard.tables.holds.objects["block"].body]
    known = {"block": T_held[[3, 7, 11]]} if held else {}
    at = boxes_at(guard, q, {"block": "arm"} if held else None, known)
    arm = {"arm/hand", "arm/left", "arm/right"} | ({"block"} if held else set())
    checked = [(a, b) for a, b in combinations(at, 2) if (a in arm) != (b in arm)]
    checked.append(("arm/left", "arm/right"))
    return np.min(np.broadcast_arrays(*(gap(at[a], at[b]) for a, b in checked)), axis=0)


def test_a_held_block_moves_with_its_gripper_and_may_touch_it(loop):
    rows = rows_near(loop)
    checker = loop.guard.checker()
    gaps = least_gaps(loop, rows, held=True)
    sure = np.abs(gaps - BUFFER) > 1e-9
    assert np.array_equal(checker.clear(rows)[sure], gaps[sure] >= BUFFER)
    assert np.abs(checker.distances(rows).distance - gaps).max() < 1e-9
    below = least_gaps(loop, rows, held=False)
    assert np.count_nonzero((gaps < BUFFER) & (below >= BUFFER)) > 50


def test_motions_with_a_held_block_are_proven_as_their_samples_are_clear(loop):
    rows = rows_near(loop, 400)
    starts, ends = rows[:200], rows[200:]
    found = loop.guard.checker(threads=2).prove(starts, ends)
    assert 20 < np.count_nonzero(found.proven) < 180
    share = np.linspace(0.0, 1.0, 101)[:, None]
    for start, end, proven in zip(starts, ends, found.proven, strict=True):
        least = least_gaps(loop, start + share * (end - start), held=True).min()
        assert not (proven and least < BUFFER)
        assert proven or least < BUFFER + 1e-3


def test_it_has_objects_as_they_were_when_it_was_made():
    guard = guard_of(pick_scene(blocks=BLOCKS))
    # Closed fingers in the place of a block.
    rows = np.tile(guard.home, (2, 1))
    rows[:, 2:] = 0.13, 0.01, 0.01
    rows[1, 0] = 0.25
    before = guard.checker()
    guard.remove("block")
    guard.place("other", ag.Pose(xyz=(0.5, 0.0, 0.03)))
    assert before.clear(rows).tolist() == [False, False]
    assert guard.checker().clear(rows).tolist() == [True, True]
    guard.place("block", ag.Pose(xyz=(0.25, 0.0, 0.03)))
    assert guard.checker().clear(rows).tolist() == [True, False]
