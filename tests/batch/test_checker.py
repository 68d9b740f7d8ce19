"""The checker: distances against Coal and the guard, and rows that do not matter."""

import os
import subprocess
import sys

import coal
import numpy as np
import pinocchio as pin
import pytest

import armguard as ag
from armguard.batch.scratch import ROOM
from arms import simple_arm, wall_scene
from coal_shapes import coal_request
from peers.pinocchio_coal import build_models
from worlds_of_batches import mixed_scene, motion_rows, random_rows


@pytest.fixture(scope="module")
def bay():
    return ag.bay_scene()


@pytest.fixture(scope="module")
def checker(bay):
    return ag.Checker(bay)


@pytest.mark.parametrize(
    "make", [lambda bay: random_rows(bay, 1000), lambda bay: motion_rows(bay, 50, 0.3)]
)
def test_distances_are_those_of_coal(bay, checker, make):
    rows = make(bay)
    model, geometry = build_models(ag.Guard(bay).tables)
    data, results = model.createData(), pin.GeometryData(geometry)
    pairs = [(p.first, p.second) for p in geometry.collisionPairs]
    shapes = [one.geometry for one in geometry.geometryObjects]
    request, result = coal_request(), coal.DistanceResult()
    found = checker.distances(rows)
    for k, q in enumerate(rows):
        pin.updateGeometryPlacements(model, data, geometry, results, q)
        places = [coal.Transform3s(T.rotation, T.translation) for T in results.oMg]
        near = int(found.a[k]), int(found.b[k])
        least = np.inf
        for i, j in pairs:
            apart = np.linalg.norm(
                results.oMg[i].translation - results.oMg[j].translation
            )
            if (i, j) != near and apart - shapes[i].aabb_radius - shapes[
                j
            ].aabb_radius > (found.distance[k] + 1e-3):
                continue
            result.clear()
            coal.distance(shapes[i], places[i], shapes[j], places[j], request, result)
            least = min(least, result.min_distance)
        assert abs(least - found.distance[k]) <= 1e-9


@pytest.mark.parametrize("make", [ag.bay_scene, mixed_scene])
def test_answers_are_those_of_the_guard(make):
    scene = make()
    guard, checker = ag.Guard(scene), ag.Checker(scene)
    margin = guard.tables.margin
    rows = random_rows(scene, 300, seed=1)
    found, clear = checker.distances(rows, margin), checker.clear(rows)
    kinds = set()
    for k, q in enumerate(rows):
        near = guard.step(q).near
        least = min((p.primitive_distance for p in near), default=np.inf)
        assert clear[k] == all(p.primitive_distance >= p.buffer for p in near)
        if least >= margin:
            assert found.distance[k] == np.inf
            assert found.a[k] == found.b[k] == -1
            continue
        assert abs(found.distance[k] - least) <= 1e-12
        names = checker.labels[found.a[k]], checker.labels[found.b[k]]
        kinds.add(names[1])
        assert any(
            {p.primitive_a, p.primitive_b} == set(names)
            and abs(p.primitive_distance - least) <= 1e-12
            for p in near
        )
    assert 0 < clear.sum() < len(rows)
    assert len(kinds) >= 3


def test_bits_do_not_depend_on_count_order_or_place(bay, checker):
    rows = random_rows(bay, 61, seed=2)
    whole = checker.distances(rows)
    order = np.random.default_rng(3).permutation(61)
    mixed = checker.distances(rows[order])
    np.testing.assert_array_equal(mixed.distance, whole.distance[order])
    np.testing.assert_array_equal(mixed.a, whole.a[order])
    np.testing.assert_array_equal(mixed.b, whole.b[order])
    for first, end in ((0, 1), (3, 4), (5, 21), (60, 61)):
        part = checker.distances(rows[first:end])
        np.testing.assert_array_equal(part.distance, whole.distance[first:end])
    np.testing.assert_array_equal(
        checker.clear(rows[order]), checker.clear(rows)[order]
    )


@pytest.mark.parametrize("make", [ag.bay_scene, mixed_scene])
@pytest.mark.parametrize("length", [0.02, 0.2, 0.6])
def test_spans_change_no_bit_of_a_row(make, length):
    scene = make()
    checker = ag.Checker(scene)
    rows = motion_rows(scene, 30, length, seed=6)
    order = np.random.default_rng(7).permutation(len(rows))
    for margin in (np.inf, 0.1):
        found = checker.distances(rows, margin)
        alone = checker.distances(rows[order], margin)
        np.testing.assert_array_equal(alone.distance, found.distance[order])
        np.testing.assert_array_equal(alone.a, found.a[order])
        np.testing.assert_array_equal(alone.b, found.b[order])
    clear = checker.clear(rows)
    np.testing.assert_array_equal(checker.clear(rows[order]), clear[order])
    assert 0 < clear.sum() < len(rows)


def test_bits_do_not_depend_on_threads(bay, checker):
    rows = motion_rows(bay, 20, 0.2, seed=8)
    rows[77] = np.nan
    whole = checker.distances(rows)
    for threads in (2, 3, 40):
        many = ag.Checker(bay, threads=threads)
        found = many.distances(rows)
        np.testing.assert_array_equal(found.distance, whole.distance)
        np.testing.assert_array_equal(found.a, whole.a)
        np.testing.assert_array_equal(many.clear(rows), checker.clear(rows))
        assert many.clear(rows[:0]).shape == (0,)
    with pytest.raises(ag.SceneError, match="threads is 0"):
        ag.Checker(bay, threads=0)


def test_a_span_with_too_many_near_pairs_is_searched_row_by_row():
    scene = ag.Scene(mode="fixed")
    scene.add_robot(simple_arm(), name="arm")
    for k in range(2 * ROOM):
        place = (1.0 + 1e-6 * k, 0.0, 0.3)
        scene.add(ag.Sphere(radius=0.05), name=f"ball{k}", pose=ag.Pose(xyz=place))
    rows = np.linspace(-0.3, 0.3, 24)[:, None] * np.ones(len(scene.home))
    checker = ag.Checker(scene)
    whole = checker.distances(rows)
    alone = [checker.distances(rows[k : k + 1]).distance[0] for k in range(24)]
    np.testing.assert_array_equal(whole.distance, alone)


PLAIN = """
import sys
import numpy as np
import armguard as ag
rows = np.load(sys.argv[1])
checker = ag.Checker(ag.bay_scene())
found = checker.distances(rows, 0.2)
np.savez(sys.argv[2], clear=checker.clear(rows), distance=found.distance, a=found.a)
"""


def test_without_compilation_the_bits_are_the_same(bay, checker, tmp_path):
    rows = motion_rows(bay, 1, 0.1, seed=9)[:17]
    np.save(tmp_path / "rows.npy", rows)
    files = [str(tmp_path / "rows.npy"), str(tmp_path / "found.npz")]
    subprocess.run(
        [sys.executable, "-c", PLAIN, *files],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        check=True,
    )
    plain, found = np.load(files[1]), checker.distances(rows, 0.2)
    np.testing.assert_array_equal(plain["distance"], found.distance)
    np.testing.assert_array_equal(plain["a"], found.a)
    np.testing.assert_array_equal(plain["clear"], checker.clear(rows))
    assert np.isfinite(found.distance).any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e6])
def test_a_bad_row_spoils_no_other(bay, checker, bad):
    rows = np.repeat(bay.home[None], 11, axis=0)
    rows[4, 2] = bad
    clear, found = checker.clear(rows), checker.distances(rows)
    assert clear.tolist() == [k != 4 for k in range(11)]
    right = checker.distances([bay.home]).distance[0]
    assert np.isnan(found.distance[4])
    assert found.a[4] == -1
    assert np.all(np.delete(found.distance, 4) == right)
    assert np.isnan(checker.distances(rows, margin=0.0).distance[4])


def test_arrays_of_any_layout_and_of_numbers_only(bay, checker):
    rows = random_rows(bay, 40, seed=4)
    whole = checker.distances(rows).distance
    np.testing.assert_array_equal(checker.distances(rows[::3]).distance, whole[::3])
    column_first = np.asfortranarray(rows)
    np.testing.assert_array_equal(checker.distances(column_first).distance, whole)
    assert checker.clear(rows[:0]).shape == (0,)
    assert checker.clear(np.zeros((1, rows.shape[1]), dtype=int)).shape == (1,)
    for wrong in (bay.home, rows[:, :-1], rows[None]):
        with pytest.raises(ag.SceneError, match="q has shape"):
            checker.clear(wrong)
    for wrong in (rows.astype(str), rows > 0.0, rows.astype(complex)):
        with pytest.raises(ag.SceneError, match="must hold numbers"):
            checker.distances(wrong)
    with pytest.raises(ag.SceneError, match="margin"):
        checker.distances(rows, margin=np.nan)


def test_a_scene_with_nothing_to_check_is_clear():
    scene = ag.Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1), name="arm")
    checker = ag.Checker(scene)
    rows = np.array([[0.1], [np.nan]])
    assert checker.clear(rows).tolist() == [True, False]
    found = checker.distances(rows)
    assert found.distance[0] == np.inf
    assert np.isnan(found.distance[1])


def test_a_buffer_of_a_pair_decides_what_is_clear():
    scene = wall_scene()
    rows = random_rows(scene, 200, seed=5)
    before = ag.Checker(scene).clear(rows)
    scene.set_buffer("arm/link3", "wall", 0.3)
    after = ag.Checker(scene).clear(rows)
    assert after.sum() < before.sum()
    assert not np.any(after & ~before)
