"""What operators mean to grip succeeds; what they do not mean is never touched."""

import numpy as np
import pytest

from armguard.benchmark.peers.coal_pairs import coal_pair
from armguard.geometry import Box, Cylinder
from gripping.records import Records
from gripping.solids import box, cylinder, gaps
from gripping.summary import is_broken, summed_up
from gripping_campaign import run


def test_a_sample_of_things_that_are_picked_and_placed():
    found = summed_up("placing", list(run("placing", range(6))))
    assert found["certified"] == found["episodes"] == 6
    assert found["grasps_done"] == found["placements_done"] == 6
    assert not is_broken(found)
    assert found["least_not_meant_mm"] >= 5.0


def test_a_sample_of_operators_who_change_their_minds():
    found = summed_up("changing", list(run("changing", range(6))))
    assert found["episodes"] == 6
    assert found["changes_of_mind"] > 20
    assert found["things_touched_as_meant"] > 0
    assert not is_broken(found)
    assert found["least_not_meant_mm"] >= 5.0


def test_the_same_seed_gives_the_same_episode():
    one, other = (next(run("changing", [3])) for _ in range(2))
    del one["worked_s"], other["worked_s"]
    assert one == other


def solid_and_shape(rng):
    """A solid of the judge, and the same as a shape."""
    at = rng.uniform(-0.05, 0.05, 3)
    half = rng.uniform(0.01, 0.05, 3)
    if rng.random() < 0.5:
        return box(half, at), Box(half_extents=tuple(half.tolist()))
    radius, half_height = float(half[0]), float(half[2])
    shape = Cylinder(radius=radius, height=2.0 * half_height)
    return cylinder(radius, half_height, at), shape


@pytest.mark.parametrize("seed", range(3))
def test_the_judge_sees_the_same_distances_as_coal(seed):
    rng = np.random.default_rng(seed)
    seen = {True: 0, False: 0}
    for _ in range(200):
        (a, shape_a), (b, shape_b) = solid_and_shape(rng), solid_and_shape(rng)
        T_a, T_b = np.eye(4), np.eye(4)
        T_a[:3, 3], T_b[:3, 3] = a.at, b.at
        pair = coal_pair(shape_a, T_a, shape_b, T_b)
        theirs = pair.functor(pair.T_a, pair.T_b, pair.request, pair.result)
        ours = float(gaps(a, b))
        seen[ours > 0.0] += 1
        assert (ours > 0.0) == (theirs > 0.0)
        if ours > 0.0:
            assert ours == pytest.approx(theirs, abs=1e-6)
    assert min(seen.values()) > 20


def test_an_episode_in_which_something_was_touched_breaks_the_promise():
    episodes = list(run("changing", [0]))
    assert not is_broken(summed_up("changing", episodes))
    episodes[0]["touched"] = [("hand", "thing00", 17)]
    assert is_broken(summed_up("changing", episodes))


def test_what_was_run_is_known_and_not_run_again(tmp_path):
    path = tmp_path / "found.json"
    episodes = list(run("changing", range(4)))
    records = Records(path, lambda kind: f"{kind} 1")
    assert list(records.todo("changing", 0, 4)) == [0, 1, 2, 3]
    records.add("changing", summed_up("changing", episodes[:1]))
    records.add("changing", summed_up("changing", episodes[2:]))
    again = Records(path, lambda kind: f"{kind} 1")
    assert list(again.todo("changing", 0, 6)) == [1, 4, 5]
    found = again.add("changing", summed_up("changing", episodes[1:2]))
    whole = summed_up("changing", episodes)
    for key in ("simulated_s", "worked_s"):
        assert found.pop(key) == pytest.approx(whole.pop(key))
    assert found.pop("version") == "changing 1"
    assert found == whole
    # With other kernels all of them are to be run again, and nothing is mixed.
    other = Records(path, lambda kind: f"{kind} 2")
    assert list(other.todo("changing", 0, 2)) == [0, 1]
    found = other.add("changing", summed_up("changing", episodes[:1]))
    assert found["episodes"] == 1
