"""Proofs over tubes: against dense samples of Coal, at the ends of their intervals."""

import numpy as np
import pytest
from scipy.optimize import brentq

import armguard as ag
from armguard.prove.paving import Paver
from armguard.prove.tube import Tube
from tubes import arm_among_objects, random_tube
from verifying.oracle import Oracle, positions

RESOLUTION = 5e-5

# How far Coal's distances may be off [m].
ACCURACY = 1e-7


@pytest.fixture(scope="module")
def paver():
    return Paver(ag.Checker(arm_among_objects()))


@pytest.fixture(scope="module")
def oracle(paver):
    return Oracle(paver.checker.tables)


def intervals_of(paver, tube):
    return paver.intervals(paver.pave(tube, RESOLUTION), tube, RESOLUTION)


def names_of(one):
    return tuple(sorted((one.nearest.a, one.nearest.b)))


def too_near_outside(oracle, tube, found, times, rows):
    """How far the worst pair is below its buffer at times outside its intervals [m]."""
    distances = oracle.distances(rows)
    worst = np.inf
    for k, pair in enumerate(oracle.pairs):
        outside = np.ones(len(times), dtype=bool)
        for one in found:
            if names_of(one) == pair:
                outside &= ~((times >= one.start) & (times <= one.end))
        room = distances[outside, k] - oracle.buffer(*pair)
        worst = min(worst, room.min(initial=np.inf))
    return worst


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_intervals_are_complete_and_end_where_a_root_finder_has_it(
    paver, oracle, degree
):
    tube = random_tube(6, degree, 12, seed=degree)
    found = intervals_of(paver, tube)
    assert len(found) > 4
    times = np.linspace(tube.times[0], tube.times[-1], 3001)
    rows = positions(tube, times)
    assert too_near_outside(oracle, tube, found, times, rows) >= -ACCURACY
    ends = 0
    for one in found:
        pair, room = names_of(one), one.buffer
        assert room == pytest.approx(oracle.buffer(*pair))

        def headroom(t, pair=pair, room=room):
            return oracle.distance(positions(tube, np.array([t])), *pair)[0] - room

        within = times[(times > one.start + 1e-3) & (times < one.end - 1e-3)]
        inside = oracle.distance(positions(tube, within), *pair)
        assert (inside <= room + ACCURACY).all()
        for end, out in ((one.start, -1e-3), (one.end, 1e-3)):
            if tube.times[0] < end < tube.times[-1] and headroom(end + out) > 0.0:
                low, high = sorted((end + out, end - out))
                root = brentq(headroom, low, high, xtol=1e-9)
                assert abs(root - end) <= RESOLUTION
                assert (root - end) * out <= 1e-9
                ends += 1
    assert ends > 6


@pytest.mark.parametrize("degree", [1, 3])
def test_the_nearest_place_and_first_contact_are_those_of_dense_samples(
    paver, oracle, degree
):
    tube = random_tube(6, degree, 12, seed=10 + degree)
    found = intervals_of(paver, tube)
    touching = 0
    for one in found:
        pair, near = names_of(one), one.nearest
        times = np.linspace(one.start, one.end, 2001)
        sampled = oracle.distance(positions(tube, times), *pair)
        assert near.bound - ACCURACY <= sampled.min()
        slack = 1.6e-5 + 4e-3 * max(-near.distance, 0.0)
        assert near.distance - slack <= near.bound <= near.distance
        at = oracle.distance(positions(tube, np.array([near.time])), *pair)[0]
        assert near.bound - ACCURACY <= at <= near.distance + ACCURACY
        if sampled.min() > 1e-5:
            assert one.contact is None
        elif sampled.min() < -1e-5:
            touching += 1
            first = times[np.argmax(sampled <= 0.0)]
            step = times[1] - times[0]
            assert first - step - RESOLUTION <= one.contact <= first + RESOLUTION
    assert touching >= 3
    times = np.linspace(tube.times[0], tube.times[-1], 4001)
    sampled = oracle.distances(positions(tube, times)).min()
    least = paver.least(tube)
    assert least.bound - ACCURACY <= sampled
    at = oracle.distances(positions(tube, np.array([least.time]))).min()
    assert least.bound - ACCURACY <= at <= least.distance + ACCURACY


def outermost(oracle, tube, times, wide, seed):
    """Rows off the curves by their widths, each joint to one side or the other."""
    rng = np.random.default_rng(seed)
    rows = positions(tube, times)
    return rows + wide * rng.choice([-1.0, 1.0], rows.shape)


def test_joints_off_their_curves_by_the_width_are_covered_and_only_by_the_width(
    paver, oracle
):
    tube, wide = random_tube(6, 3, 4, seed=3), 0.01
    found = intervals_of(paver, tube.widened(np.full(6, wide)))
    alone = intervals_of(paver, tube)
    times = np.linspace(tube.times[0], tube.times[-1], 1500)
    missed = np.inf
    for seed in range(4):
        rows = outermost(oracle, tube, times, wide, seed)
        assert too_near_outside(oracle, tube, found, times, rows) >= -ACCURACY
        missed = min(missed, too_near_outside(oracle, tube, alone, times, rows))
    assert missed < -1e-3
    # And hardly more than the width: in each interval a position is too near.
    for one in found:
        assert one.nearest.distance < one.buffer
        if one.nearest.distance > 0.0:
            assert one.nearest.bound >= one.nearest.distance - 5e-4


def test_the_bow_of_a_curve_counts(paver, oracle):
    """With the chord in place of the curve, contacts appear outside the intervals."""
    tube = random_tube(6, 3, 6, seed=3)
    chords = Tube(tube.times, np.ascontiguousarray(tube.control[:, [0, -1]]), tube.wide)
    times = np.linspace(tube.times[0], tube.times[-1], 1500)
    rows = positions(tube, times)
    assert (
        too_near_outside(oracle, tube, intervals_of(paver, chords), times, rows) < -0.01
    )


def test_a_straight_tube_that_keeps_its_buffers_has_no_interval(paver):
    rows = np.array([[0.0] * 6, [0.05] * 6, [-0.05] * 6])
    rows[:, 3:] += 1.8
    tube = Tube.straight(np.array([0.0, 1.0, 3.0]), rows)
    paving = paver.pave(tube, RESOLUTION)
    assert paver.checker.prove(rows[:-1], rows[1:]).proven.all()
    assert paver.intervals(paving, tube, RESOLUTION) == []
    assert paver.least(tube).bound > paver.checker.tables.buffers.max()


def test_exact_shapes_decide_as_they_do_for_rows():
    scene = ag.Scene(mode="fixed")
    for name, y in (("left", 0.3), ("right", -0.3)):
        scene.add_robot("panda", name=name, base=ag.Pose(xyz=(0, y, 0)))
    checker = ag.Checker(scene)
    paver = Paver(checker)
    rows = np.tile(checker.tables.home, (2, 1))
    rows[:, 0] -= (0.4, 1.0)
    rows[:, 8] += (0.4, 1.0)
    tube = Tube.straight(np.array([0.0, 1.0]), rows)
    found = intervals_of(paver, tube)
    start = min(one.start for one in found)
    before, after = tube.at(np.array([start - 1e-3, start + 1e-3]))
    times = np.linspace(0.0, start, 500)
    assert checker.clear(tube.at(times)).all()
    assert not checker.clear([after])[0]
    assert checker.distances([before]).distance[0] < checker.tables.buffers.max()
