"""Near pairs with witness points and gradients, and objects placed and removed."""

import os
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import armguard as ag
from armguard.scene import two_pandas_scene
from arms import simple_arm
from peers.pinocchio_coal import build_models
from worlds_of_batches import mixed_scene, random_rows

MARGIN = 0.15

# Formulas in lanes and those of the guard round differently [m].
ROUNDING = 1e-14


def moved_scene():
    """An arm between boxes and balls, of which some are placed and removed."""
    scene = ag.Scene(mode="fixed", margin=2.0)
    scene.add_robot(simple_arm(), name="arm")
    rng = np.random.default_rng(5)
    for k in range(12):
        shape = ag.Box(size=(0.1, 0.2, 0.1)) if k % 2 else ag.Sphere(radius=0.1)
        pose = ag.Pose(xyz=rng.uniform(-1.0, 1.0, 3))
        scene.add(shape, f"object {k}", pose=pose, present=k % 4 != 0)
    scene.add(ag.Cylinder(radius=0.05, height=0.2), "tool", pose=pose, graspable=True)
    return scene


def pairs_of(found, row, labels):
    """Distances by the names of their pairs, of one row."""
    return {
        frozenset((labels[a], labels[b])): distance
        for a, b, distance in zip(
            found.a[found.row == row],
            found.b[found.row == row],
            found.distance[found.row == row],
            strict=True,
        )
    }


@pytest.mark.parametrize("make", [ag.bay_scene, mixed_scene])
def test_every_pair_below_the_margin_is_that_of_the_guard(make):
    scene = make()
    guard, checker = ag.Guard(scene), ag.Checker(scene)
    rows = random_rows(scene, 60, seed=11)
    found = checker.near(rows, guard.tables.margin)
    assert np.all(np.diff(found.row) >= 0)
    for k, q in enumerate(rows):
        near = guard.step(q).near
        expected = {
            frozenset((p.primitive_a, p.primitive_b)): p.primitive_distance
            for p in near
        }
        assert pairs_of(found, k, checker.labels) == pytest.approx(expected, abs=1e-12)


def test_a_listing_grows_with_its_pairs():
    scene = two_pandas_scene()
    checker = ag.Checker(scene)
    rows = random_rows(scene, 40, seed=2)
    found = checker.near(rows, 10.0)
    counts = np.bincount(found.row)
    assert counts[0] > 512 and np.all(counts == counts[0])
    nearest = checker.distances(rows)
    least = np.full(len(rows), np.inf)
    np.minimum.at(least, found.row, found.distance)
    np.testing.assert_allclose(least, nearest.distance, rtol=0.0, atol=ROUNDING)
    few = checker.near(rows, 0.1)
    kept = found.distance < 0.1
    np.testing.assert_array_equal(few.distance, found.distance[kept])
    np.testing.assert_array_equal(few.gradient, found.gradient[kept])
    threaded = ag.Checker(scene, threads=3).near(rows, 0.1)
    np.testing.assert_array_equal(threaded.row, few.row)
    np.testing.assert_array_equal(threaded.point_a, few.point_a)


@pytest.mark.parametrize("make", [ag.bay_scene, two_pandas_scene, mixed_scene])
def test_the_gradient_is_that_of_a_difference_quotient(make):
    scene = make()
    checker = ag.Checker(scene)
    rows = random_rows(scene, 40, seed=3)
    nearest = checker.distances(rows)
    found = checker.witnesses(rows, nearest)
    np.testing.assert_allclose(
        found.distance, nearest.distance, rtol=0.0, atol=ROUNDING
    )
    step, smooth = 1e-5, 0
    for k, q in enumerate(rows):
        for j in range(len(q)):
            sides = np.array([q, q])
            sides[:, j] += -step, step
            near = checker.near(sides, found.distance[k] + 0.1)
            same = (near.a == found.a[k]) & (near.b == found.b[k])
            low, high = near.distance[same]
            slope = (high - low) / (2.0 * step)
            # A shape's edge, where the nearest points jump, has no derivative.
            normals = near.normal[same]
            if np.dot(normals[0], normals[1]) < 1.0 - 1e-9:
                continue
            smooth += 1
            assert abs(found.gradient[k, j] - slope) < 1e-5
    assert smooth > 0.9 * rows.size


def test_witness_points_move_as_pinocchio_moves_them():
    scene = ag.bay_scene()
    checker, tables = ag.Checker(scene), ag.Guard(scene).tables
    model, geometry = build_models(tables)
    data, parts = model.createData(), geometry.geometryObjects
    rows = random_rows(scene, 50, seed=4)
    found = checker.witnesses(rows, checker.distances(rows))
    for k, q in enumerate(rows):
        pin.computeJointJacobians(model, data, q)
        gradient = np.zeros(len(q))
        sides = (found.a[k], found.point_a[k], -1), (found.b[k], found.point_b[k], 1)
        for primitive, point, sign in sides:
            joint = parts[int(primitive)].parentJoint
            J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.WORLD)
            gradient += sign * found.normal[k] @ (J[:3] + np.cross(J[3:].T, point).T)
        np.testing.assert_allclose(found.gradient[k], gradient, atol=1e-9)
        apart = found.point_b[k] - found.point_a[k]
        np.testing.assert_allclose(
            apart, found.distance[k] * found.normal[k], atol=1e-9
        )


def test_a_row_that_cannot_be_judged_is_one_entry_without_a_pair():
    scene = ag.bay_scene()
    checker = ag.Checker(scene)
    rows = random_rows(scene, 30, seed=6)
    clean = checker.near(rows, MARGIN)
    for bad in (np.nan, np.inf, 1e7):
        spoilt = rows.copy()
        spoilt[[3, 17], 2] = bad
        found = checker.near(spoilt, MARGIN)
        lost = np.isin(found.row, (3, 17))
        assert found.row[lost].tolist() == [3, 17]
        assert np.all(found.a[lost] == -1) and np.all(np.isnan(found.distance[lost]))
        assert np.all(np.isnan(found.gradient[lost]))
        others = ~np.isin(clean.row, (3, 17))
        np.testing.assert_array_equal(found.distance[~lost], clean.distance[others])
        none = checker.witnesses(spoilt, checker.distances(spoilt))
        assert np.all(np.isnan(none.distance[[3, 17]]))
        assert np.isfinite(none.gradient[4]).all()


def test_wrong_arguments_are_named():
    scene = ag.bay_scene()
    checker = ag.Checker(scene)
    rows = random_rows(scene, 3, seed=7)
    with pytest.raises(ag.SceneError, match="3 rows and 2 pairs"):
        checker.witnesses(rows, checker.distances(rows[:2]))
    with pytest.raises(ag.SceneError, match="margin is nan"):
        checker.near(rows, np.nan)
    with pytest.raises(ag.UnknownNameError, match="no fixed object is named 'tabel'"):
        checker.place("tabel", ag.Pose())
    with pytest.raises(ag.UnknownNameError):
        checker.remove("tabel")
    empty = checker.near(np.zeros((0, rows.shape[1])), MARGIN)
    assert len(empty.row) == 0 and empty.gradient.shape == (0, rows.shape[1])


def test_placed_and_removed_objects_are_those_of_the_guard():
    scene = moved_scene()
    guard, checker = ag.Guard(scene), ag.Checker(scene)
    rng = np.random.default_rng(8)
    rows = random_rows(scene, 24, seed=8)
    names = [name for name in guard.tables.standing if name != "tool"] + ["tool"]
    for step in range(40):
        name = names[step % len(names)]
        if step % 3 == 2:
            guard.remove(name)
            checker.remove(name)
        else:
            pose = ag.Pose(xyz=rng.uniform(-1.0, 1.0, 3), rpy=rng.uniform(-3, 3, 3))
            box = isinstance(scene.objects[name].shapes[0].shape, ag.Box)
            shape = ag.Box(size=rng.uniform(0.05, 0.3, 3)) if box else None
            guard.place(name, pose, shape=shape)
            checker.place(name, pose, shape=shape)
        found = checker.near(rows, guard.tables.margin)
        nearest, clear = checker.distances(rows), checker.clear(rows)
        for k, q in enumerate(rows):
            near = guard.step(q).near
            expected = {
                frozenset((p.primitive_a, p.primitive_b)): p.primitive_distance
                for p in near
            }
            listed = pairs_of(found, k, checker.labels)
            assert listed == pytest.approx(expected, abs=1e-12)
            assert abs(nearest.distance[k] - min(listed.values())) <= ROUNDING
            assert clear[k] == all(p.primitive_distance >= p.buffer for p in near)


def test_a_removed_object_is_not_where_a_search_begins():
    scene = moved_scene()
    checker = ag.Checker(scene)
    rows = random_rows(scene, 400, seed=9)
    for name in checker._objects:
        before = checker.distances(rows)
        checker.remove(name)
        fresh = ag.Checker(scene)
        for gone in list(checker._objects):
            fresh.remove(gone)
            if gone == name:
                break
        after = checker.distances(rows)
        np.testing.assert_array_equal(after.distance, fresh.distances(rows).distance)
        assert np.all(after.distance >= before.distance)
    assert np.all(np.array(checker.labels)[after.b] != "tool")


def test_near_pairs_are_the_same_without_compilation():
    code = (
        "import numpy as np, armguard as ag\n"
        "from worlds_of_batches import mixed_scene, random_rows\n"
        "scene = mixed_scene()\n"
        "found = ag.Checker(scene).near(random_rows(scene, 10, seed=1), 0.3)\n"
        "print(found.row.tolist(), found.a.tolist(), found.distance.tolist())\n"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ
            | {"NUMBA_DISABLE_JIT": off, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            check=True,
            text=True,
        ).stdout
        for off in ("0", "1")
    ]
    assert said[0] == said[1] and len(said[0]) > 100
