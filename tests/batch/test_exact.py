"""Exact shapes in the checker: they decide where the guard lets them decide."""

import numpy as np
import pytest

import armguard as ag


@pytest.fixture(scope="module")
def scene():
    """Two Pandas whose hands meet when both turn inwards."""
    scene = ag.Scene(mode="fixed")
    for name, y in (("left", 0.3), ("right", -0.3)):
        scene.add_robot("panda", name=name, base=ag.Pose(xyz=(0, y, 0)))
    return scene


@pytest.fixture(scope="module")
def guard(scene):
    return ag.Guard(scene, self_test=False)


def inwards(guard, count, seed=0):
    """Rows near home, at every turn inwards."""
    rng = np.random.default_rng(seed)
    rows = guard.home + rng.uniform(-0.05, 0.05, (count, len(guard.home)))
    turns = np.linspace(0.4, 1.0, count)
    rows[:, 0] -= turns
    rows[:, 8] += turns
    return np.clip(rows, guard.tables.lower, guard.tables.upper)


def judged(guard, rows):
    """By the guard: whether pairs keep their buffers, and whether primitives do."""
    near = [guard.step(q).near for q in rows]
    return (
        np.array([all(p.distance >= p.buffer for p in one) for one in near]),
        np.array([all(p.primitive_distance >= p.buffer for p in one) for one in near]),
    )


def test_rows_are_clear_where_the_guard_accepts_the_exact_shapes(scene, guard):
    rows = inwards(guard, 400)
    clear, coarse = judged(guard, rows)
    assert np.count_nonzero(clear & ~coarse) > 20
    assert np.count_nonzero(~clear) > 20
    checker = ag.Checker(scene)
    assert np.array_equal(checker.clear(rows), clear)
    # In spans of other rows, and alone.
    mixed = np.random.default_rng(1).permutation(len(rows))
    assert np.array_equal(checker.clear(rows[mixed]), clear[mixed])
    assert [checker.clear(rows[k : k + 1])[0] for k in range(0, 400, 40)] == [
        *clear[::40]
    ]


def test_distances_and_near_pairs_stay_those_of_the_primitives(scene, guard):
    rows = inwards(guard, 40)
    found = ag.Checker(scene).distances(rows, guard.tables.margin).distance
    for q, distance in zip(rows, found, strict=True):
        near = guard.step(q).near
        least = min((p.primitive_distance for p in near), default=np.inf)
        assert distance == pytest.approx(least, abs=1e-12)


def test_motions_are_proven_through_rows_that_only_exact_shapes_clear(scene, guard):
    rows = inwards(guard, 300, seed=2)
    clear, coarse = judged(guard, rows)
    starts = rows[clear]
    ends = starts + np.random.default_rng(3).uniform(-0.003, 0.003, starts.shape)
    proven = ag.Checker(scene).prove(starts, ends).proven
    assert np.count_nonzero(proven & ~coarse[clear]) > 10
    share = np.linspace(0.0, 1.0, 9)[:, None]
    for start, end in zip(starts[proven], ends[proven], strict=True):
        assert judged(guard, start + share * (end - start))[0].all()
    # Nearly all that stay clear are proven: none is refused for its primitives alone.
    stays = [
        judged(guard, a + share * (b - a))[0].all()
        for a, b in zip(starts, ends, strict=True)
    ]
    assert np.count_nonzero(proven) > 0.95 * np.count_nonzero(stays)
