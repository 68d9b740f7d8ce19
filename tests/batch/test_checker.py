"""The checker: distances against Coal and the guard, and rows that do not matter."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import armguard as ag
from arms import simple_arm, wall_scene
from coal_shapes import coal_request
from peers.pinocchio_coal import build_models


def random_rows(scene, count, seed=0):
    tables = ag.Guard(scene).tables
    rng = np.random.default_rng(seed)
    return rng.uniform(tables.lower, tables.upper, (count, len(tables.lower)))


def mixed_scene():
    """An arm between objects of every other kind."""
    scene = ag.Scene(mode="fixed", margin=1.0)
    scene.add_robot(simple_arm(), name="arm")
    shapes = {
        "cylinder": ag.Cylinder(radius=0.1, height=0.3),
        "cone": ag.Cone(radius=0.1, height=0.3),
        "egg": ag.Ellipsoid(semi_axes=(0.1, 0.2, 0.15)),
        "block": ag.Box(size=(0.2, 0.1, 0.3), rounding=0.02),
        "ball": ag.Sphere(radius=0.1),
    }
    for k, (name, shape) in enumerate(shapes.items()):
        angle = 1.2 * k - 1.8
        place = (0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.2 * k)
        scene.add(shape, name=name, pose=ag.Pose(xyz=place))
    scene.add(ag.HalfSpace(), name="floor", pose=ag.Pose(xyz=(0, 0, -0.1)))
    return scene


@pytest.fixture(scope="module")
def bay():
    return ag.bay_scene()


@pytest.fixture(scope="module")
def checker(bay):
    return ag.Checker(bay)


def test_distances_are_those_of_coal(bay, checker):
    rows = random_rows(bay, 2000)
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
