"""Proven motions: against dense samples, near the bound, and bad rows."""

import os
import subprocess
import sys

import numpy as np
import pytest

import armguard as ag
from armguard.batch.balls import SLACK
from armguard.batch.results import primitives_of
from armguard.scene import two_pandas_scene
from arms import simple_arm
from worlds_of_batches import mixed_scene, motions_of

SAMPLES = 400


@pytest.fixture(scope="module")
def bay():
    return ag.bay_scene()


def headroom(checker, starts, ends, samples=SAMPLES):
    """Least distance above the buffer along each motion, of samples."""
    share = np.linspace(0.0, 1.0, samples)[None, :, None]
    rows = starts[:, None] + share * (ends - starts)[:, None]
    flat = rows.reshape(-1, starts.shape[1])
    return checker._found(flat, np.inf, 1, 0.0)[0].reshape(len(starts), samples)


@pytest.mark.parametrize("make", [ag.bay_scene, two_pandas_scene, mixed_scene])
@pytest.mark.parametrize("length", [0.05, 0.6])
def test_samples_of_proven_motions_keep_their_buffers(make, length):
    scene = make()
    checker = ag.Checker(scene)
    starts, ends = motions_of(scene, 150, length)
    found = checker.prove(starts, ends)
    upto = starts + found.share[:, None] * (ends - starts)
    clear = found.share > 0.0
    assert np.all(headroom(checker, starts[clear], upto[clear]) >= -SLACK)
    assert np.array_equal(found.proven, found.share == 1.0)
    room = headroom(checker, starts, ends).min(axis=1)
    assert 5 < found.proven.sum() < len(starts)
    assert not np.any(found.proven & (room < 0.0))
    assert np.all(found.proven[room > 0.005])


@pytest.mark.parametrize("make", [ag.bay_scene, mixed_scene])
def test_the_pair_that_ends_a_proof_is_at_its_buffer_there(make):
    scene = make()
    checker = ag.Checker(scene)
    starts, ends = motions_of(scene, 80, 0.6, seed=3)
    starts, ends = starts[checker.clear(starts)], ends[checker.clear(starts)]
    found = checker.prove(starts, ends)
    stopped = ~found.proven
    assert 5 < stopped.sum()
    place = starts + found.share[:, None] * (ends - starts)
    room, pairs = checker._found(place[stopped], np.inf, 1, 0.0)
    a, b = primitives_of(pairs)
    np.testing.assert_array_equal(a, found.a[stopped])
    np.testing.assert_array_equal(b, found.b[stopped])
    assert np.all(room >= -SLACK)
    assert np.all(room < 1e-3)
    assert np.all(found.a[found.proven] == -1)


def turning_arm(buffer):
    """One joint that turns a link of 0.4 m towards a ball."""
    scene = ag.Scene(mode="fixed", buffer=buffer)
    scene.add_robot(simple_arm(joints=1), name="arm")
    scene.add(ag.Sphere(radius=0.1), name="ball", pose=ag.Pose(xyz=(0.2, 0.4, 0.2)))
    return ag.Checker(scene)


@pytest.mark.parametrize("way", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("above", [-1e-4, 1e-4])
def test_a_motion_that_ends_at_the_buffer_is_proven_on_one_side_only(way, above):
    free = turning_arm(0.0)
    angles = np.linspace(-0.5, 1.0, 1501)[:, None]
    gap = free.distances(angles).distance
    end = angles[np.argmax(gap < 0.05)]
    assert end > 0.0
    buffer = free.distances([end]).distance[0] - above
    found = turning_arm(buffer).prove([end - way], [end])
    assert found.proven[0] == (above > 0.0)
    assert found.share[0] > 0.9


@pytest.mark.parametrize(("scale", "proven"), [(0.99, True), (1.01, False)])
def test_a_motion_that_grazes_a_ball_is_proven_below_its_least_distance(scale, proven):
    scene = ag.Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=2), name="arm")
    place = ag.Pose(xyz=(0.825, 0.495, 0.4))
    scene.add(ag.Sphere(radius=0.1), name="ball", pose=place)
    start, end = np.array([[0.0, 1.2]]), np.array([[1.2, -1.2]])
    share = np.linspace(0.0, 1.0, 10001)[:, None]
    rows = start + share * (end - start)
    gap = ag.Checker(scene).distances(rows).distance
    assert 0 < gap.argmin() < len(gap) - 1
    assert gap.min() > 0.01
    scene.set_buffer("arm", "ball", scale * gap.min())
    found = ag.Checker(scene).prove(start, end)
    assert found.proven[0] == proven
    if not proven:
        first = share[np.argmax(gap < scale * gap.min()), 0]
        assert first - 1e-3 <= found.share[0] <= first


def test_bits_do_not_depend_on_order_count_or_threads(bay):
    starts, ends = motions_of(bay, 67, 0.4, seed=5)
    checker = ag.Checker(bay)
    whole = checker.prove(starts, ends)
    order = np.random.default_rng(6).permutation(len(starts))
    mixed = checker.prove(starts[order], ends[order])
    for name in ("proven", "share", "a", "b"):
        right = getattr(whole, name)
        np.testing.assert_array_equal(getattr(mixed, name), right[order])
        for first, end in ((0, 1), (5, 21), (66, 67)):
            part = checker.prove(starts[first:end], ends[first:end])
            np.testing.assert_array_equal(getattr(part, name), right[first:end])
        for threads in (2, 5):
            many = ag.Checker(bay, threads=threads).prove(starts, ends)
            np.testing.assert_array_equal(getattr(many, name), right)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e6])
@pytest.mark.parametrize("side", [0, 1])
def test_a_bad_row_is_not_proven_and_spoils_no_other(bay, bad, side):
    rows = np.repeat(bay.home[None, None], 11, axis=1).repeat(2, axis=0)
    rows[side, 4, 2] = bad
    found = ag.Checker(bay).prove(*rows)
    assert found.proven.tolist() == [k != 4 for k in range(11)]
    assert found.share[4] == 0.0
    assert found.a[4] == found.b[4] == -1


def test_arrays_of_any_layout_and_of_numbers_only(bay):
    checker = ag.Checker(bay)
    starts, ends = motions_of(bay, 12, 0.2)
    whole = checker.prove(starts, ends).share
    np.testing.assert_array_equal(
        checker.prove(np.asfortranarray(starts)[::3], ends[::3]).share, whole[::3]
    )
    assert checker.prove(starts[:0], ends[:0]).proven.shape == (0,)
    with pytest.raises(ag.SceneError, match="ends has shape"):
        checker.prove(starts, ends[:, :-1])
    with pytest.raises(ag.SceneError, match="12 starts and 11 ends"):
        checker.prove(starts, ends[:-1])
    with pytest.raises(ag.SceneError, match="starts holds"):
        checker.prove(starts.astype(str), ends)


def test_a_scene_with_nothing_to_check_is_proven():
    scene = ag.Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1), name="arm")
    found = ag.Checker(scene).prove([[0.0], [np.nan]], [[1.0], [1.0]])
    assert found.proven.tolist() == [True, False]
    assert found.share.tolist() == [1.0, 0.0]


def test_proofs_near_the_bound_are_the_same_without_compilation():
    chosen = ("-q", "-p", "no:cacheprovider", "-k", "side_only or grazes")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *chosen, __file__],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
