"""Pavings of boxes of parameters, against dense samples of Coal."""

import numpy as np
import pytest

import armguard as ag
from armguard.prove.paving import Paver
from armguard.prove.tile_search import FREE, LABEL, PAIR, PLACE, TOUCHING, UNKNOWN
from armguard.prove.tube import Tube
from armguard.prove.tube_tiles import SPAN
from tubes import arm_among_objects, random_tube
from verifying.oracle import Oracle


@pytest.fixture(scope="module")
def paver():
    return Paver(ag.Checker(arm_among_objects(apart=0.45)))


@pytest.fixture(scope="module")
def oracle(paver):
    return Oracle(paver.checker.tables)


def leaf_at(tubes, leaves, values):
    """Place of a leaf that holds values of the parameters, one for each."""
    inside = np.ones(len(leaves), dtype=bool)
    for d, (tube, value) in enumerate(zip(tubes, values, strict=True)):
        [segment], [share] = tube.place(np.array([value]))
        own = leaves[:, PLACE + SPAN * d : PLACE + SPAN * (d + 1)]
        inside &= own[:, 0] == segment
        inside &= (own[:, 1] <= share) & (share <= own[:, 2])
    assert inside.any()
    return int(np.argmax(inside))


def corner_of(tubes, leaf, rng):
    """Values of the parameters at a corner of a leaf."""
    values = []
    for d, tube in enumerate(tubes):
        segment, *ends = leaf[PLACE + SPAN * d : PLACE + SPAN * (d + 1)]
        values.append(tube.time(np.array([int(segment)]), rng.choice(ends, 1))[0])
    return values


def judge(paver, oracle, tubes, paving, rows_of, count):
    """Labels at random values, having compared each with the distances there.

    As many leaves are judged at one of their corners, where bounds are tightest.
    """
    rng, found = np.random.default_rng(0), []
    names, buffers = paver.links.names, [oracle.buffer(*p) for p in oracle.pairs]
    for k in range(2 * count):
        at = int(rng.integers(len(paving.leaves)))
        values = corner_of(tubes, paving.leaves[at], rng)
        if k % 2:
            values = [rng.uniform(tube.times[0], tube.times[-1]) for tube in tubes]
            at = leaf_at(tubes, paving.leaves, values)
            found.append(paving.leaves[at, LABEL])
        leaf = paving.leaves[at]
        below = oracle.distances(rows_of(values, rng)[None])[0] < buffers
        near = {pair for pair, one in zip(oracle.pairs, below, strict=True) if one}
        if leaf[LABEL] == FREE:
            assert not near
        elif leaf[LABEL] == TOUCHING:
            a, b = paving.pairs[int(leaf[PAIR])]
            widths = any(tube.wide.any() for tube in tubes)
            assert widths or tuple(sorted((names[a], names[b]))) in near
        else:
            open_pairs = paving.pairs[paving.open[paving.open[:, 0] == at, 1]]
            listed = {tuple(sorted((names[a], names[b]))) for a, b in open_pairs}
            assert near <= listed
    return np.array(found)


def on_curves(tubes, owner, wide=0.0):
    """Rows of joints, each on the curve of its own parameter, and off by a width."""

    def rows_of(values, rng):
        each = [
            tube.at(np.array([v]))[0] for tube, v in zip(tubes, values, strict=True)
        ]
        row = np.choose(owner, each)
        return row + wide * rng.choice([-1.0, 1.0], len(row))

    return rows_of


@pytest.mark.parametrize(("degree", "wide"), [(1, 0.0), (3, 0.0), (3, 0.01)])
def test_two_arms_on_parameters_of_their_own(paver, oracle, degree, wide):
    tubes = [random_tube(6, degree, 4, seed) for seed in (degree, degree + 10)]
    owner = np.repeat([0, 1], 3)
    tubes = [tube.widened(np.full(6, wide)) for tube in tubes]
    # The ball, the wall and the wire are left to a box of both parameters, too.
    paving = paver.pave_box(tubes, owner, 0.02)
    rows_of = on_curves(tubes, owner, wide)
    labels = judge(paver, oracle, tubes, paving, rows_of, 1500)
    for label in (FREE, TOUCHING):
        assert (labels == label).sum() > 100
    assert (labels == UNKNOWN).mean() < 0.1


def test_tiles_are_split_along_the_parameter_that_moves_the_pair(paver):
    """One arm stays where it is, so that its parameter is never split."""
    moving = random_tube(6, 1, 4, 1)
    still = Tube.straight(np.array([0.0, 1.0]), np.zeros((2, 6)))
    owner = np.repeat([0, 1], 3)
    leaves = paver.pave_box([moving, still], owner, 0.01).leaves
    sizes = leaves[:, PLACE + 1 :].reshape(len(leaves), -1)
    assert (sizes[:, 1] - sizes[:, 0]).min() < 0.1
    np.testing.assert_array_equal(sizes[:, [3, 4]], [[0.0, 1.0]] * len(leaves))


def test_a_box_of_three_joints_with_a_joint_anywhere(paver, oracle):
    """Each joint of an arm is a parameter; one of the other arm may be anywhere."""
    ends = np.array([[-0.8] * 6, [0.8] * 6])
    wide = np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0])
    tubes = [Tube.straight(np.array([0.0, 1.0]), ends).widened(wide) for _ in range(4)]
    owner = np.array([0, 1, 2, 3, 3, 3])
    tubes[3].control[...] = 0.0
    paving = paver.pave_box(tubes, owner, 0.05, turn=2.0)

    def rows_of(values, rng):
        row = -0.8 + 1.6 * np.array([*values[:3], 0.5, 0.5, 0.5])
        row[3] += rng.uniform(-0.1, 0.1)
        return row

    labels = judge(paver, oracle, tubes, paving, rows_of, 3000)
    assert (labels == FREE).sum() > 300
    assert (labels != FREE).sum() > 100


def test_fewer_segments_hold_the_curves_that_they_replace():
    curved = random_tube(6, 3, 12, 5)
    rows = np.sin(np.linspace(0.0, 6.0, 400)[:, None] * np.arange(1.0, 3.0))
    dense = Tube.straight(np.linspace(0.0, 3.0, 400), rows).widened(np.full(2, 0.01))
    for tube, segments in ((curved, 12), (dense, 60)):
        thin = tube.thinned(0.02)
        assert len(thin.control) <= segments
        np.testing.assert_array_equal(thin.wide.max(axis=0), tube.wide.max(axis=0))
        times = np.linspace(tube.times[0], tube.times[-1], 5001)
        off = np.abs(tube.at(times) - thin.at(times))
        segment, _ = thin.place(times)
        assert (off <= thin.bow[segment] + 1e-12).all()
    assert 0.01 < off.max() <= thin.bow.max() <= 0.02
