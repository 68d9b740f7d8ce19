"""Lower bounds in cells, before distances that know nothing of cells."""

import numpy as np
import pytest

import armguard as ag
from armguard.batch.cells import CLOSE, STEP, UNKNOWN
from armguard.batch.grids import COARSE, FINE
from armguard.batch.rows import order_of
from worlds_of_batches import motion_rows, random_rows

# A distance may be below a bound by rounding, and some are not farther above it [m].
SLACK = 1e-9
NEAR = 0.02


@pytest.fixture(scope="module")
def checker():
    scene = ag.bay_scene()
    checker = ag.Checker(scene)
    checker.clear(random_rows(scene, 60, seed=20))
    return checker


def known(codes):
    """Places of cells with a bound, and the bounds [m]."""
    places = np.flatnonzero(codes > CLOSE)
    return places, (codes[places] - 2.0) * STEP


def digits(number, side, count):
    """Digits of a number to a base, the first one first."""
    return [number // side**d % side for d in range(count - 1, -1, -1)]


def test_gaps_of_links_are_not_below_those_of_their_cells(checker):
    plan, rng = checker.world, np.random.default_rng(21)
    tight = []
    for k, (first, count, *joints) in enumerate(plan.ways.tolist()):
        side = COARSE if count == 3 else FINE
        places, bounds = known(plan.gaps[first : first + side**count])
        primitives = [
            set(range(*plan.parts[part, :2].tolist())) for part in plan.pairs[k, :2]
        ]
        for place, bound in list(zip(places.tolist(), bounds, strict=True))[:8]:
            q = np.zeros((6, len(checker.q_names)))
            for joint, digit in zip(joints, digits(place, side, count), strict=False):
                low, per_cell = plan.grid[joint]
                width = FINE // side / per_cell
                q[:, joint] = low + width * (digit + rng.uniform(0.0, 1.0, 6))
            found = checker.near(q, bound + NEAR)
            mine = [
                d
                for a, b, d in zip(found.a, found.b, found.distance, strict=True)
                if a in primitives[0] and b in primitives[1]
            ]
            if mine:
                assert min(mine) >= bound - SLACK
                tight.append(min(mine) - bound)
    assert len(tight) > 10


def test_a_cell_at_the_edge_of_the_joints_has_no_bound(checker):
    plan = checker.world
    for first, count, *_ in plan.ways.tolist():
        side = COARSE if count == 3 else FINE
        codes = plan.gaps[first : first + side**count].reshape((side,) * count)
        for axis in range(count):
            for edge in (0, side - 1):
                assert np.all(np.take(codes, edge, axis) <= CLOSE)


def test_room_around_points_is_not_below_that_of_their_cells():
    scene = ag.bay_scene()
    for name in [name for name in scene.objects if not name.startswith("ball")]:
        scene.remove(name)
    rng = np.random.default_rng(22)
    balls = rng.uniform((-0.8, -0.8, 0.0, 0.02), (0.8, 0.8, 1.5, 0.1), (9, 4))
    for k, (*place, radius) in enumerate(balls):
        scene.add(ag.Sphere(radius=radius), name=f"ball{k}", pose=ag.Pose(xyz=place))
    checker = ag.Checker(scene)
    checker.clear(rng.uniform(checker.lower, checker.upper, (100, 14)))
    plan = checker.world
    places, bounds = known(plan.room)
    assert len(places) > 100
    numbers = np.array([digits(place, COARSE, 3) for place in places])
    low, per_cell = plan.region.T
    least = np.full(len(places), np.inf)
    for _ in range(50):
        points = low + (numbers + rng.uniform(0.0, 1.0, numbers.shape)) / per_cell
        apart = np.linalg.norm(points[:, None] - balls[:, :3], axis=2) - balls[:, 3]
        least = np.minimum(least, apart.min(axis=1))
    capped = bounds < bounds.max()
    assert np.all(least >= bounds - SLACK)
    assert np.all(least[capped] - bounds[capped] < np.linalg.norm(1.0 / per_cell))


def test_an_object_that_is_placed_empties_the_room():
    scene = ag.bay_scene()
    scene.add(ag.Sphere(radius=0.05), name="probe", pose=ag.Pose(xyz=(5.0, 0.0, 0.0)))
    checker = ag.Checker(scene)
    checker.clear(random_rows(scene, 20, seed=24))
    assert (checker.world.room != UNKNOWN).any()
    checker.place("probe", ag.Pose(xyz=(0.0, 0.0, 0.5)))
    assert np.all(checker.world.room == UNKNOWN)
    checker.clear(random_rows(scene, 20, seed=24))
    checker.remove("probe")
    assert np.all(checker.world.room == UNKNOWN)


def test_only_rows_far_from_each_other_are_sorted():
    scene = ag.bay_scene()
    rows = random_rows(scene, 600, seed=25)
    limits = rows.min(axis=0), rows.max(axis=0)
    assert order_of(motion_rows(scene, 20, 0.1), *limits) is None
    assert order_of(rows[:100], *limits) is None
    order = order_of(rows, *limits)
    np.testing.assert_array_equal(np.sort(order), np.arange(600))
    before, after = (np.abs(np.diff(q[:, 0])).mean() for q in (rows, rows[order]))
    assert after < 0.1 * before
