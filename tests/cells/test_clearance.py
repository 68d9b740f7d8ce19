"""Distances to cells, before each cell alone, and FCL's octree."""

import fcl
import numpy as np
import pytest

import armguard as ag
from armguard.geometry import ShapeKind
from cell_frames import occupy, random_cells
from oracle import surface
from sensing.octomap_files import body_of
from worlds import random_pose, random_shape

SIDE, CELL = 64, 0.02
HALF = 0.5 * SIDE * CELL


def filled(seed, count=600):
    """A map with random occupied cells, and their lower corners, shape (n, 3) [m]."""
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    chosen = random_cells(np.random.default_rng(seed), SIDE, count)
    occupy(cells, chosen)
    return cells, CELL * chosen - HALF


def capsule(rng):
    half = rng.uniform(0.0, 0.3)
    return ag.Capsule(start=(0, 0, -half), end=(0, 0, half), radius=0.03)


def segment_gaps(start, end, lows):
    """Distance of a segment to each cell [m], by bisection of its slope."""
    way = end - start
    t0, t1 = np.zeros(len(lows)), np.ones(len(lows))

    def apart(t):
        point = start + t[:, None] * way
        return point - np.clip(point, lows, lows + CELL)

    for _ in range(60):
        t = 0.5 * (t0 + t1)
        rises = apart(t) @ way > 0.0
        t0, t1 = np.where(rises, t0, t), np.where(rises, t, t1)
    ends = [apart(t) for t in (0 * t0, 0 * t0 + 1, t0, t1)]
    return np.min([np.linalg.norm(a, axis=1) for a in ends], axis=0)


def test_a_capsule_has_the_distance_of_its_nearest_cell():
    rng = np.random.default_rng(10)
    near = 0
    for seed in range(4):
        cells, lows = filled(seed, 80)
        for _ in range(50):
            shape, T = capsule(rng), random_pose(rng, 0.6)
            ends = np.array([shape.start, shape.end]) @ T[:3, :3].T + T[:3, 3]
            expected = segment_gaps(*ends, lows).min() - shape.radius
            limit = rng.choice([0.02, 0.1, 1.0])
            found = cells.distance(shape, T, limit)
            if expected > limit:
                assert found.distance == np.inf
                assert found.cell is None
            else:
                assert abs(found.distance - expected) < 1e-12
                near += expected > -shape.radius
    assert near > 60


# GJK proves the distance of a curved core to a share of 1e-9 of itself.
KINDS = [kind for kind in ShapeKind if kind != ShapeKind.SUPPORT]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_has_the_distance_of_its_nearest_cell(kind):
    rng = np.random.default_rng(11)
    cells, lows = filled(5, 40)
    apart = 0
    for _ in range(12):
        shape, T = random_shape(rng, kind, 0.25), random_pose(rng, 0.8)
        found = cells.distance(shape, T, 1.0)
        poses = np.tile(np.eye(4), (len(lows), 1, 1))
        poses[:, :3, 3] = lows + 0.5 * CELL
        box = ag.Box(size=(CELL,) * 3)
        each = ag.distances(shape, T, box, poses).distance
        expected = max(each.min(), -shape.core_radius)
        if expected > 1.0:
            assert found.cell is None
            continue
        assert abs(found.distance - expected) < 1e-12 + 2e-9 * abs(expected)
        apart += found.distance > 0.0
    assert apart > 2


def test_a_box_has_the_distance_of_sampled_points():
    rng = np.random.default_rng(12)
    cells, lows = filled(6, 30)
    for _ in range(10):
        shape, T = ag.Box(size=tuple(rng.uniform(0.05, 0.3, 3))), random_pose(rng, 0.7)
        found = cells.distance(shape, T, 2.0)
        # Corners of either one reach the other at best; edges may be nearer.
        corners = surface(shape, T)
        gaps = corners[:, None] - np.clip(corners[:, None], lows, lows + CELL)
        assert found.distance <= np.linalg.norm(gaps, axis=2).min() + 1e-12
        both = np.linalg.norm(found.point_shape - found.point_cell)
        assert abs(both - found.distance) < 1e-9
        inside = np.abs((found.point_shape - T[:3, 3]) @ T[:3, :3])
        assert (inside <= np.array(shape.size) / 2 + 1e-9).all()
        low = CELL * np.array(found.cell) - HALF
        assert (found.point_cell >= low - 1e-9).all()
        assert (found.point_cell <= low + CELL + 1e-9).all()


def test_a_search_that_begins_elsewhere_has_the_same_bits():
    rng = np.random.default_rng(13)
    cells, _ = filled(7, 3000)
    poses = np.stack([random_pose(rng, 0.6) for _ in range(300)])
    ball, rod = ag.Sphere(radius=0.02), capsule(rng)
    for shape in (ball, rod, ag.Cylinder(radius=0.05, height=0.3)):
        cold = []
        for pose in poses:
            cells._first[0] = -1
            found = cells.distances(shape, pose, 0.2)
            cold.append((found.distance.tobytes(), found.cell.tobytes()))
        warm = cells.distances(shape, poses, 0.2)
        for k in rng.permutation(len(poses)):
            # The last nearest word is that of another pose.
            again = cells.distances(shape, poses[k], 0.2)
            assert (again.distance.tobytes(), again.cell.tobytes()) == cold[k]
            assert warm.distance[k].tobytes() == cold[k][0]
            assert warm.cell[k].tobytes() == cold[k][1]


def test_of_cells_at_one_distance_the_first_is_given():
    # Edges that are powers of two have no rounding.
    cells = ag.CellMap((0, 0, 0), 2.0**-6, SIDE)
    places = (26, 37)
    occupy(cells, [(x, y, z) for x in places for y in places for z in places])
    ball = ag.Sphere(radius=0.01)
    for first in (-1, *np.flatnonzero(cells.claims.occupied.words)):
        cells._first[0] = first
        assert cells.distance(ball, ag.Pose(), 1.0).cell == (26, 26, 26)


def test_few_cells_are_measured():
    rng = np.random.default_rng(14)
    cells, lows = filled(8, 20_000)
    poses = np.stack([random_pose(rng, 0.6) for _ in range(200)])
    found = cells.distances(capsule(rng), poses, 0.1)
    assert len(lows) > 10_000
    assert found.measured.mean() < 0.01 * len(lows)


def test_a_number_that_is_not_finite_gives_nan():
    cells, _ = filled(9)
    pose = np.eye(4)
    pose[0, 3] = np.nan
    found = cells.distances(ag.Sphere(radius=0.1), [pose, np.eye(4)], 1.0)
    assert np.isnan(found.distance[0])
    assert found.cell[0].tolist() == [-1, -1, -1]
    assert np.isfinite(found.distance[1])


def test_distance_to_unknown_cells_is_that_of_the_border_of_free_space():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    ball = ag.Sphere(radius=0.05)
    assert cells.distance(ball, ag.Pose(), 1.0, unknown=True).distance == -0.05
    image = np.full((60, 80), 1.0, dtype=np.float32)
    T = np.eye(4)
    T[:3, 3] = (0, 0, -HALF)
    cells.depth(image, T, 60.0, (39.5, 29.5), 0.0)
    assert cells.distance(ball, ag.Pose(), 1.0).distance == pytest.approx(
        1.0 - HALF - 0.05
    )
    free = np.argwhere(~cells.known_free() & ~cells.occupied())
    lows = CELL * free - HALF
    centre = np.array([0.02, 0.03, -0.1])
    expected = np.linalg.norm(centre - np.clip(centre, lows, lows + CELL), axis=1).min()
    found = cells.distance(ball, ag.Pose(xyz=centre), 1.0, unknown=True)
    assert abs(found.distance - (expected - 0.05)) < 1e-12
    assert expected > 0.15


def test_distances_are_those_of_the_octree_of_fcl():
    rng = np.random.default_rng(15)
    cells, _ = filled(10, 400)
    tree = fcl.OcTree(CELL, body_of(cells.occupied()))
    still = fcl.CollisionObject(tree)
    compared = 0
    for _ in range(12):
        shape, T = capsule(rng), random_pose(rng, 0.7)
        found = cells.distance(shape, T, 2.0).distance
        if found <= 0.0:
            continue
        length = 2.0 * shape.end[2]
        moved = fcl.CollisionObject(
            fcl.Capsule(shape.radius, length),
            fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()),
        )
        theirs = fcl.distance(moved, still, fcl.DistanceRequest(), fcl.DistanceResult())
        assert abs(found - theirs) < 2e-5
        compared += 1
    assert compared > 4
