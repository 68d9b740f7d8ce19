"""How far a tube is proven, part by part: never past a place that samples find."""

from math import inf

import numpy as np
import pytest

import armguard as ag
from armguard.prove import frontier
from armguard.prove.frontier import Frontier
from armguard.prove.paving import Paver
from tubes import arm_among_objects, random_tube

RESOLUTION = 1e-3


@pytest.fixture(scope="module")
def checker():
    return ag.Checker(arm_among_objects())


def run(made, steps=2000):
    """All times until which it is proven, call by call."""
    found = [made.until]
    for _ in range(steps):
        made.advance()
        found.append(made.until)
        if made.until == inf or made.pair[0] or made.crowded:
            break
    return found


@pytest.mark.parametrize(("tiles", "leaves"), [(64, 128), (1, 128), (3, 2), (1, 1)])
def test_it_ends_where_the_proof_of_the_whole_tube_begins_an_interval(
    checker, monkeypatch, tiles, leaves
):
    monkeypatch.setattr(frontier, "TILES", tiles)
    monkeypatch.setattr(frontier, "LEAVES", leaves)
    paver, near, clear = Paver(checker), 0, 0
    for seed in range(12):
        size = 0.3 + 0.05 * seed
        tube = random_tube(6, 1 + 2 * (seed % 2), 4, seed, size)
        tube = tube.widened(0.002 * (seed % 3 == 2))
        found = paver.intervals(paver.pave(tube, RESOLUTION), tube, RESOLUTION)
        made = Frontier(checker, tube, RESOLUTION)
        ends = run(made)
        assert ends == sorted(ends)
        assert not made.crowded
        if found:
            near += 1
            assert made.until == pytest.approx(found[0].start, abs=RESOLUTION)
            assert made.pair in [(i.nearest.a, i.nearest.b) for i in found]
        else:
            clear += 1
            assert made.until == inf
    assert min(near, clear) > 2


def test_no_sample_before_it_is_too_near_from_wherever_it_restarts(checker):
    tube = random_tube(6, 3, 6, 5, 0.8)
    made, rng = Frontier(checker, tube, RESOLUTION), np.random.default_rng(0)
    times = np.linspace(*tube.times[[0, -1]], 4001)
    clear = checker.clear(tube.at(times))
    assert 0.2 < clear.mean() < 0.95
    for start in rng.uniform(*tube.times[[0, -1]], 100):
        made.restart(start)
        assert made.until == pytest.approx(start, abs=1e-12)
        run(made)
        proven = (times >= start) & (times < made.until)
        assert clear[proven].all()
        # And what follows is too near indeed.
        if made.until < inf:
            later = tube.at(np.array([made.until + RESOLUTION]))
            assert not checker.clear(later).all()


def test_a_large_buffer_is_kept_as_well():
    wide = ag.Checker(arm_among_objects(buffer=0.2))
    near = 0
    for seed in range(30):
        tube = random_tube(6, 3, 6, seed, 0.4)
        times = np.linspace(*tube.times[[0, -1]], 2001)
        clear = wide.clear(tube.at(times))
        made = Frontier(wide, tube, RESOLUTION)
        run(made)
        first = float(times[np.argmin(clear)]) if not clear.all() else inf
        assert made.until <= first
        assert made.until == inf or made.until >= first - 0.01
        near += tube.times[0] < made.until < inf
    assert near > 2


def test_before_and_after_the_tube_it_begins_at_its_ends(checker):
    tube = random_tube(6, 1, 2, 3, 0.1)
    made = Frontier(checker, tube, RESOLUTION)
    made.restart(-5.0)
    assert made.until == tube.times[0]
    made.restart(tube.times[-1] + 5.0)
    assert made.until == tube.times[-1]
    made.advance()
    assert made.until == inf


def test_more_open_pairs_than_there_is_room_for_end_it(checker, monkeypatch):
    for seed in range(20):
        tube = random_tube(6, 3, 6, seed, 0.6)
        whole = Frontier(checker, tube, RESOLUTION)
        run(whole)
        if tube.times[1] < whole.until < inf:
            break
    assert tube.times[1] < whole.until < inf
    for name, most in (("MOST_OPEN", 0), ("MOST_PAIRS", 0), ("ROOM", 1)):
        with monkeypatch.context() as small:
            small.setattr(frontier, name, most)
            made = Frontier(checker, tube, RESOLUTION)
            run(made)
        assert made.until <= whole.until, name
        assert made.crowded or made.pair == whole.pair, name
        assert made.crowded or name == "MOST_OPEN"
