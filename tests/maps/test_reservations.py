"""Reservations of space, against samples of Coal with errors at their worst."""

import re
from math import inf

import numpy as np
import pytest

from armguard.cells.occupied import FIRST, LAST, OUTSIDE, Visits, visit_cells
from armguard.errors import ArmguardError
from armguard.geometry import Box, Capsule, Cylinder, Sphere
from armguard.geometry.shapes.row import shape_row
from armguard.maps import regions
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.regions import AXIS_BITS, EDGE, MIDDLE, Carried, Rows
from armguard.maps.reservations import Blocker, Reservations, Starts
from armguard.scene import compile_scene
from armguard.scene.poses import body_poses
from armguard.table import Ledger
from coal_shapes import coal_request
from crossing import (
    FOLLOWING,
    SKEW,
    cell_of,
    headroom,
    plan_through,
    swings,
    worst_rows,
)
from peers.shapes import coal_pair
from verifying.plans import World

ERRORS = {"following_error": FOLLOWING, "skew": SKEW}


@pytest.fixture(scope="module")
def world():
    return World.of(cell_of())


def booked(world, plans, order=("left", "right"), **settings):
    """Reservations in turn, and starts by robot."""
    space = Reservations(world.scene, **settings)
    found = space.in_turn([space.region(robot, plans[robot]) for robot in order])
    return space, {one.robot: one for one in found}


def gaps(world, plans, starts, seed, following=FOLLOWING):
    """Least headroom by Coal at times of the cell, with errors at their worst [m]."""
    rng = np.random.default_rng(seed)
    clock = rng.uniform(-1.0, max(starts.values()) + 8.0, 4000)
    times = np.column_stack([clock - starts[robot] for robot in plans])
    return headroom(world, worst_rows(world, plans, times, rng, following))


@pytest.mark.parametrize("following", [0.0, 0.03])
def test_plans_that_start_in_turn_stay_apart_with_all_errors(world, following):
    waited, least = 0, inf
    for seed in range(3):
        errors = {"following_error": following, "skew": SKEW}
        plans = swings(world.scene, seed, rows=3, **errors)
        _, found = booked(world, plans, edge=0.01, floor=0.06)
        starts = {robot: one.start for robot, one in found.items()}
        least = min(least, gaps(world, plans, starts, seed, following).min())
        assert found["left"].start == 0.0
        waited += found["right"].start > 0.5
        assert found["right"].start < 3.0
    assert waited
    # Of the distance of 0.06 m the buffer is 0.01 m.
    assert 0.05 - 1e-7 <= least < 0.12


def test_a_start_that_is_much_earlier_leads_to_contact(world):
    early = close = 0
    for seed in range(6):
        plans = swings(world.scene, seed, **ERRORS)
        _, found = booked(world, plans)
        right = found["right"]
        if right.start == 0.0:
            continue
        early += 1
        starts = {"left": 0.0, "right": max(right.start - 0.8, 0.0)}
        close += bool((gaps(world, plans, starts, seed) < 0.02).any())
    assert close >= 0.7 * early > 0


def test_no_point_of_a_primitive_moves_farther_than_its_bound(world):
    tables, rng = compile_scene(world.scene), np.random.default_rng(5)
    ratios = []
    for i in range(tables.moving_count):
        body, row = tables.bodies[i], tables.local_rows[i]
        ends = row[1:7].reshape(2, 3)
        for _ in range(20):
            q, halves = rng.uniform(-1.0, 1.0, (2, len(tables.q_names)))
            halves = 0.05 * np.abs(halves)
            turned = q + halves * rng.choice([-1.0, 1.0], (200, len(q)))
            poses = np.array([body_poses(tables, one) for one in (q, *turned)])
            bound = Carried(i, tables).moved(poses[:1], halves[None])[0]
            T = poses.reshape(len(poses), -1, 3, 4)[:, body]
            places = ends @ T[:, :, :3].transpose(0, 2, 1) + T[:, None, :, 3]
            ways = np.linalg.norm(places[1:] - places[0], axis=2)
            assert ways.max() <= bound
            ratios.append(ways.max() / bound)
    assert max(ratios) > 0.8


def test_forbidden_starts_are_those_of_overlapping_intervals():
    rng = np.random.default_rng(0)
    for _ in range(30):
        own, other = (random_rows(rng, 40) for _ in range(2))
        lows, highs, cells = own.forbids(other)
        assert np.isin(cells, own.cells).all()
        for delay in rng.uniform(-12.0, 12.0, 60):
            late = other.delayed(delay)
            overlap = any(
                a == b and low < end and begin < high
                for a, low, high in zip(own.cells, own.begins, own.ends, strict=True)
                for b, begin, end in zip(
                    late.cells, late.begins, late.ends, strict=True
                )
            )
            assert ((lows < delay) & (delay < highs)).any() == overlap


def random_rows(rng, count):
    """Rows of few cells, some of them without begin or end."""
    begins = np.round(rng.uniform(0.0, 5.0, count), 1)
    ends = begins + np.round(rng.uniform(0.1, 1.0, count), 1)
    begins[rng.random(count) < 0.03] = -inf
    ends[rng.random(count) < 0.03] = inf
    return Rows(np.sort(rng.integers(0, 30, count)), begins, ends)


BLOCKERS = [Blocker(name, (0.0, 0.0, 0.0)) for name in ("a", "b", "c")]


def test_the_earliest_start_is_allowed_and_none_is_before_it():
    starts = Starts((-inf, 2.0, 5.0), (1.0, 3.5, inf), tuple(BLOCKERS))
    assert starts.earliest(0.0) == 1.0
    assert starts.earliest(1.0) == 1.0
    assert starts.earliest(1.5) == 1.5
    assert starts.earliest(2.0) == 2.0
    assert starts.earliest(2.1) == 3.5
    assert starts.earliest(6.0) == inf
    assert [starts.blocker(t) for t in (0.0, 1.5, 2.1, 6.0)] == [
        BLOCKERS[0],
        None,
        *BLOCKERS[1:],
    ]
    assert starts.allowed(4.0)
    assert not starts.allowed(2.5)
    assert not starts.allowed(np.nan)


SHAPES = [
    Sphere(radius=0.07),
    Capsule(start=(0.0, 0.0, -0.15), end=(0.0, 0.0, 0.15), radius=0.05),
    Box(size=(0.1, 0.2, 0.05)),
    Cylinder(radius=0.06, height=0.25),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_every_cell_that_a_primitive_touches_is_visited_and_no_far_one(shape):
    rng = np.random.default_rng(0)
    edge, growth = 0.02, 0.013
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, rng.uniform(-0.3, 0.3, 3)
    first, counts = np.full(3, -48), np.full(3, 96)
    visits = Visits(
        first=first,
        counts=counts,
        open=np.full(96**3, -1, dtype=np.int32),
        runs=np.empty((100_000, 3), dtype=np.int64),
        size=np.zeros(1, dtype=np.int64),
    )
    given = (
        np.array([shape.kind], dtype=np.int32),
        shape_row(shape)[None],
        np.zeros(1, dtype=np.int32),
        T[:3].reshape(1, 12),
        np.array([growth]),
        edge,
    )
    lines = Ledger(visits).lines
    for tile in (3, 4, 6):
        assert visit_cells(*given, tile, lines) > 0
    runs = visits.runs[: int(visits.size[0])]
    half = len(runs) // 2
    assert (runs[:half, FIRST] == 3).all()
    assert (runs[:half, LAST] == 4).all()
    assert (runs[half:, FIRST] == 6).all()
    visited = np.zeros(96**3, dtype=bool)
    visited[runs[:, 0]] = True
    visited = visited.reshape(96, 96, 96)
    # Cells about the surface and elsewhere.
    near = np.argwhere(visited)[rng.integers(0, int(visited.sum()), 400)]
    cells = np.unique(near + rng.integers(-2, 3, near.shape), axis=0)
    inside, cell = 0, Box(size=(edge, edge, edge))
    for z, y, x in cells:
        middle = np.eye(4)
        middle[:3, 3] = (np.array([x, y, z]) - 48 + 0.5) * edge
        pair = coal_pair(shape, T, cell, middle)
        gap = pair.functor(pair.T_a, pair.T_b, coal_request(), pair.result)
        if gap <= growth - 1e-6:
            assert visited[z, y, x]
            inside += 1
        elif visited[z, y, x]:
            assert gap <= growth + 0.5 * np.sqrt(3.0) * edge + 1e-6
    assert 100 < inside < len(cells)


def test_what_reaches_beyond_the_cells_is_said():
    visits = Visits(
        first=np.zeros(3, dtype=np.int64),
        counts=np.full(3, 16),
        open=np.full(16**3, -1, dtype=np.int32),
        runs=np.empty((10, 3), dtype=np.int64),
        size=np.zeros(1, dtype=np.int64),
    )
    T = np.eye(4)[:3].reshape(1, 12)
    row = shape_row(Sphere(radius=0.05))[None]
    kind, body = np.zeros((2, 1), dtype=np.int32)
    kind[0] = Sphere(radius=0.05).kind
    given = kind, row, body, T, np.zeros(1), 0.02, 0, Ledger(visits).lines
    assert visit_cells(*given) == OUTSIDE
    assert visits.size[0] == 0


def test_a_robot_that_rests_in_the_way_goes_first(world):
    left = plan_through(world.scene, "left", [0.0, -0.7, 0.0])
    right = plan_through(world.scene, "right", [0.6, -0.7], step=4.0)
    space, found = booked(world, {"left": left, "right": right})
    assert list(found) == ["right", "left"]
    assert found["right"].start == 0.0
    assert 0.3 < found["left"].start < 3.0
    # For ever where it stays.
    region = space.region("left", left)
    space.rest("left", region.first)
    stays = np.where(np.arange(4) == 2, 0.6, 0.0)
    space.rest("right", stays)
    starts = space.starts(region)
    assert starts.earliest(0.0) == inf
    assert starts.blocker(0.0).robot == "right"


def test_a_robot_stays_in_the_way_where_its_plan_ends(world):
    space = Reservations(world.scene)
    left = space.region("left", plan_through(world.scene, "left", [0.0, -0.7]))
    right = space.region("right", plan_through(world.scene, "right", [0.0, 0.7, 0.0]))
    space.reserve(left, 10.0)
    starts = space.starts(right)
    assert starts.earliest(0.0) == 0.0
    # Too late to be back before the left arm comes.
    assert 8.0 < starts.lows[0] < 10.0
    assert starts.highs == (inf,)
    assert starts.blocker(12.0) == starts.blockers[0]


def test_a_robot_waits_with_its_following_error(world):
    first = []
    for error in (0.0, 0.3):
        left = plan_through(world.scene, "left", [0.0, -0.45, 0.0])
        turns, errors = [0.0, -0.6], {"following_error": error}
        right = plan_through(world.scene, "right", turns, **errors)
        _, found = booked(world, {"left": left, "right": right})
        first.append(next(iter(found)))
    assert first == ["left", "right"]


def test_a_robot_does_not_wait_where_a_plan_is_reserved(world):
    space = Reservations(world.scene)
    left = plan_through(world.scene, "left", [0.0, -0.7, 0.0])
    right = plan_through(world.scene, "right", [0.6, 0.0])
    space.reserve(space.region("left", left), 5.0)
    region = space.region("right", right)
    with pytest.raises(CoordinationError, match="'right' would wait where 'left'"):
        space.in_turn([region])
    space.forget(10.0)
    assert space.in_turn([region], after=10.0)[0].start == 10.0


def test_what_forbids_an_earlier_start_is_the_last_to_leave(world):
    named = 0
    for seed in range(6):
        plans = swings(world.scene, seed, **ERRORS)
        space, found = booked(world, plans)
        right = found["right"]
        if right.blocker is None:
            continue
        named += 1
        regions = [space.region(robot, plans[robot]).rows for robot in plans]
        x, y, z = (np.floor(np.array(right.blocker.place) / EDGE)).astype(int) + MIDDLE
        cell = x << 2 * AXIS_BITS | y << AXIS_BITS | z
        left, own = (rows.chosen(rows.cells == cell) for rows in regions)
        apart = left.ends[:, None] - own.begins
        assert np.isclose(apart, right.start).any()
    assert named >= 3


def test_plans_that_block_each_other_are_named(world):
    plans = {
        "left": plan_through(world.scene, "left", [-0.6, 0.6]),
        "right": plan_through(world.scene, "right", [0.6, -0.6]),
    }
    with pytest.raises(
        CoordinationError, match=r"no plan can start: 'right' near .* blocks 'left'"
    ):
        booked(world, plans)


def test_a_robot_has_several_plans_one_after_the_other(world):
    there, back = [0.0, -0.6], [-0.6, 0.0]
    plans = [plan_through(world.scene, "left", one, **ERRORS) for one in (there, back)]
    space = Reservations(world.scene)
    regions = [space.region("left", one) for one in plans]
    right = space.region("right", plan_through(world.scene, "right", [0.0, 0.6, 0.0]))
    found = space.in_turn([*regions, right])
    assert [one.robot for one in found] == ["left", "left", "right"]
    assert found[1].start == found[0].end == 1.0
    # It gets there when the left arm is back.
    assert 0.5 < found[2].start < 2.0
    space.forget(100.0)
    again = space.starts(right)
    assert again.earliest(0.0) == 0.0


@pytest.mark.parametrize(
    ("start", "why"),
    [
        (0.1, "'left' near .* has reserved a cell; the earliest start is [0-9.]+ s"),
        (np.nan, "a start is finite"),
        (inf, "a start is finite"),
    ],
)
def test_a_start_that_is_forbidden_is_refused(world, start, why):
    plans = swings(world.scene, 0, **ERRORS)
    space = Reservations(world.scene)
    regions = {robot: space.region(robot, plan) for robot, plan in plans.items()}
    for one in regions.values():
        space.rest(one.robot, one.first, one.error)
    space.reserve(regions["left"], 0.0)
    before = space.starts(regions["right"])
    with pytest.raises(CoordinationError, match=why):
        space.reserve(regions["right"], start)
    assert space.starts(regions["right"]) == before


def test_a_region_with_cells_left_out_is_refused(world, monkeypatch):
    plan = plan_through(world.scene, "left", [0.0, 0.3])
    space = Reservations(world.scene)
    monkeypatch.setattr(regions, "visit_cells", lambda *given: OUTSIDE)
    with pytest.raises(CoordinationError, match="'left' leaves the box of its cells"):
        space.region("left", plan)


def test_mistakes_are_named(world):
    plan = plan_through(world.scene, "left", [0.3, -0.6])
    space = Reservations(world.scene)
    region = space.region("left", plan)
    with pytest.raises(CoordinationError, match=r"begins 0.3 from where 'left/joint1'"):
        space.reserve(region, 0.0)
    with pytest.raises(
        CoordinationError, match=r"'lift' is no robot of the scene; .*left"
    ):
        space.region("lift", plan)
    for edge in (0.0, -0.1, np.nan, inf):
        with pytest.raises(CoordinationError, match="it must be positive"):
            Reservations(world.scene, edge=edge)
    with pytest.raises(ArmguardError, match=re.escape("too far for cells of 0.0001 m")):
        Reservations(world.scene, edge=1e-4)
