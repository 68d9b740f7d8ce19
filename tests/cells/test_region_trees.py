"""Region octrees: no arm that is too near is called clear, and few others are not."""

import numpy as np
import pytest

import armguard as ag
from armguard.errors import CellMapError
from armguard.plans.coal_world import CoalWorld
from armguard.scene.compile import compile_scene
from arms import simple_arm

CELL, CENTRE, SIZE = 0.02, (0.3, 0.0, 0.3), 128
DIAGONAL = np.sqrt(3.0) * CELL

WAYS = pytest.mark.parametrize("rasterised", [False, True])


def cell_of():
    """An arm among objects: two pairs have other buffers, one is never checked."""
    scene = ag.Scene(mode="fixed", buffer=0.01)
    scene.add_robot(simple_arm(radius=0.03), name="arm")
    post = ag.Capsule(start=(0, 0, -0.3), end=(0, 0, 0.3), radius=0.04)
    scene.add(post, name="post", pose=ag.Pose(xyz=(0.6, 0.5, 0.4), rpy=(0.3, 0.1, 0)))
    box = ag.Box(size=(0.3, 0.1, 0.2))
    scene.add(box, name="box", pose=ag.Pose(xyz=(0.7, -0.5, 0.6), rpy=(0.2, 0.4, 0.5)))
    drum = ag.Cylinder(radius=0.1, height=0.2)
    scene.add(drum, name="drum", pose=ag.Pose(xyz=(-0.3, 0.4, 0.6), rpy=(0.5, 0, 0)))
    scene.add(ag.Box(size=(0.4, 0.4, 0.1)), name="stand", pose=ag.Pose(xyz=(0, 0, 0.2)))
    away = ag.Pose(xyz=(0.8, 0.1, 0.4))
    scene.add(ag.Sphere(radius=0.2), name="away", pose=away, present=False)
    scene.allow("arm/link1", "stand", reason="it turns on it")
    scene.set_buffer("arm/link3", "drum", 0.06)
    return scene


@pytest.fixture(scope="module")
def compared():
    """The trees, configurations, and how far above its buffer the nearest pair is."""
    scene = cell_of()
    t, rng = compile_scene(scene), np.random.default_rng(3)
    q = rng.uniform(t.lower, t.upper, (1500, len(t.q_names)))
    world, moving = CoalWorld(t), t.moving_count
    absent = t.standing["away"].places
    pairs = [
        (i, j)
        for i in range(moving)
        for j in range(moving, len(t.kinds))
        if t.checked[t.groups[i], t.groups[j]] and not absent.start <= j < absent.stop
    ]
    left = np.full(len(q), np.inf)
    for k, row in enumerate(q):
        world.place(row)
        for i, j in pairs:
            buffer = t.buffers[t.groups[i], t.groups[j]]
            left[k] = min(left[k], world.distance(i, j) - buffer)
    assert 300 < (left < 0.0).sum() < 1200
    return ag.RegionTrees(scene, CENTRE, CELL, SIZE), q, left


@WAYS
def test_none_is_missed_and_needless_ones_are_within_a_diagonal(compared, rasterised):
    trees, q, left = compared
    found = trees.compare(q, rasterised=rasterised)
    assert (left[found.clear] > -1e-9).all()
    assert (left[~found.clear] < DIAGONAL + 1e-6).all()
    # The bound is used, and not by far too much.
    assert 0.25 * DIAGONAL < left[~found.clear].max()
    assert found.clear.mean() > 0.5 * (left > 0.0).mean()
    # The cells that are named are black, and those of clear rows are none.
    black = np.any([one.occupied() for one in trees.trees], axis=0)
    assert black[tuple(found.cell[~found.clear].T)].all()
    assert (found.cell[found.clear] == -1).all()


@WAYS
def test_each_row_is_judged_alone(compared, rasterised):
    trees, q, _ = compared
    every = trees.compare(q[:40], rasterised=rasterised)
    again = trees.compare(q[:40][::-1], rasterised=rasterised)
    assert (every.clear == again.clear[::-1]).all()
    assert (every.visited == again.visited[::-1]).all()
    assert 0 < every.clear.sum() < 40


@WAYS
def test_an_arm_that_leaves_the_cube_or_is_nowhere_is_not_clear(rasterised):
    scene = ag.Scene(mode="fixed", buffer=0.01)
    scene.add_robot(simple_arm(joints=1, length=0.4), name="arm")
    far = ag.Pose(xyz=(-0.6, 0.0, 0.2))
    scene.add(ag.Sphere(radius=0.05), name="ball", pose=far)
    # The cube ends at x = 0.34 m; the arm reaches 0.44 m.
    trees = ag.RegionTrees(scene, (-0.3, 0.0, 0.2), 0.02, 64)
    q = [[1.9], [0.0], [np.nan], [np.inf]]
    found = trees.compare(q, rasterised=rasterised)
    assert found.clear.tolist() == [True, False, False, False]
    assert (found.cell == -1).all()
    assert trees.compare(q[:1], rasterised=rasterised).clear[0]


def test_what_has_no_cells_and_what_is_no_configuration_is_refused(compared):
    trees, q, _ = compared
    for wrong in (q[0], q[:, :2], [["a"] * 3], [[1.0], [1.0, 2.0]]):
        with pytest.raises(CellMapError, match=r"must be .*\(rows, 3\)"):
            trees.compare(wrong)
    scene = cell_of()
    scene.add(ag.HalfSpace(), name="ground", pose=ag.Pose(xyz=(0, 0, -0.5)))
    with pytest.raises(CellMapError, match="no end"):
        ag.RegionTrees(scene, CENTRE, CELL, SIZE)
    with pytest.raises(CellMapError, match="must be one of"):
        ag.RegionTrees(cell_of(), CENTRE, CELL, 100)
