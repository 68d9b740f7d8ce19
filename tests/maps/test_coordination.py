"""Maps of two and three arms, against samples of Coal with errors at their worst."""

import numpy as np
import pytest

import armguard as ag
from armguard.maps.cell_plan import CellPlan, CoordinationError
from armguard.maps.coordination import Coordinator, coordination_map
from crossing import (
    FOLLOWING,
    SKEW,
    cell_of,
    headroom,
    pairs_between,
    plan_through,
    swings,
    worst_rows,
)
from verifying.oracle import Oracle, positions
from verifying.plans import World


@pytest.fixture(scope="module")
def world():
    return World.of(cell_of())


@pytest.fixture(scope="module")
def coordinator(world):
    return Coordinator(world.scene, ("left", "right"))


@pytest.mark.parametrize("errors", [{}, {"following_error": FOLLOWING, "skew": SKEW}])
def test_what_is_free_is_free_and_what_is_clear_is_found(world, coordinator, errors):
    rng, contacts, far, found = np.random.default_rng(0), 0, 0, 0
    for seed in range(4):
        plans = swings(world.scene, seed, **errors)
        cell = coordinator.map(plans, resolution=0.02)
        assert cell.free + cell.touching + cell.unknown == pytest.approx(1.0)
        times = rng.uniform(0.0, 6.0, (2000, 2))
        allowed = np.array([cell.allowed(*both) for both in times])
        assert cell.free - 0.08 < allowed.mean() < cell.free + 0.03
        off = (FOLLOWING, SKEW) if errors else (0.0, 0.0)
        gaps = headroom(world, worst_rows(world, plans, times, rng, *off))
        assert (gaps[allowed] >= -1e-7).all()
        contacts += int((gaps < 0.0).sum())
        far, found = far + (gaps > 0.04).sum(), found + allowed[gaps > 0.04].sum()
    assert contacts > 500
    assert errors or found >= 0.95 * far


@pytest.mark.parametrize("left_out", [{"following_error": 0.0}, {"skew": 0.0}])
def test_an_error_that_is_not_declared_leads_to_contacts(world, coordinator, left_out):
    rng, missed = np.random.default_rng(1), 0
    for seed in range(3):
        errors = {"following_error": FOLLOWING, "skew": SKEW} | left_out
        cell = coordinator.map(swings(world.scene, seed, **errors), resolution=0.01)
        # At the edges of what is free.
        blocked = np.pad(cell.diagrams[0].blocked, 1)
        beside = blocked[2:, 1:-1] | blocked[:-2, 1:-1]
        beside |= blocked[1:-1, 2:] | blocked[1:-1, :-2]
        cells = np.argwhere(beside & ~blocked[1:-1, 1:-1])
        times = cell.diagrams[0].step * (cells + rng.uniform(0.0, 1.0, cells.shape))
        rows = worst_rows(world, cell.plans, times, rng)
        missed += int((headroom(world, rows) < -1e-4).sum())
    assert missed > 0


def test_nothing_is_allowed_outside_the_plans(world, coordinator):
    cell = coordinator.map(swings(world.scene, 0))
    for both in ((-1e-9, 0.0), (0.0, 6.0 + 1e-9), (np.nan, 1.0), (1.0, np.inf)):
        assert not cell.allowed(*both)
    assert cell.allowed(0.0, 0.0)
    assert cell.allowed(6.0, 6.0)


def test_schedules_are_as_quick_as_they_can_be_and_free(world, coordinator):
    waiting = 0
    for seed in range(8):
        plans = swings(world.scene, seed, following_error=FOLLOWING, skew=SKEW)
        cell = coordinator.map(plans)
        schedule = cell.schedule()
        paces = np.diff(schedule.plan_times, axis=0) / np.diff(schedule.times)[:, None]
        assert paces.min() >= 0.0
        assert paces.max() <= 1.0 + 1e-9
        assert schedule.plan_times[0].tolist() == [0.0, 0.0]
        assert schedule.plan_times[-1] == pytest.approx([6.0, 6.0])
        assert 6.0 - 1e-9 <= schedule.makespan <= 12.0
        waiting += bool(schedule.waits)
        rng = np.random.default_rng(seed)
        times = np.array(
            [schedule.at(t) for t in np.linspace(0, schedule.makespan, 600)]
        )
        rows = worst_rows(world, plans, times, rng)
        assert (headroom(world, rows) >= -1e-7).all()
        for wait in schedule.waits:
            assert 0.0 < wait.scale <= 1.0
            before = schedule.at(wait.start)[cell.robots.index(wait.robot)]
            assert before == pytest.approx(wait.at)
    assert waiting >= 4


def test_a_wait_may_be_gone_more_slowly_instead(world, coordinator):
    slowed = 0
    for seed in range(8):
        plans = swings(world.scene, seed, following_error=FOLLOWING, skew=SKEW)
        cell = coordinator.map(plans)
        schedule = cell.schedule()
        for wait in schedule.waits:
            if wait.scale == 1.0:
                continue
            slowed += 1
            r = cell.robots.index(wait.robot)
            over = wait.start + wait.duration
            began = over - (wait.at - wait.since) / wait.scale
            times = np.linspace(began, over, 200)
            both = np.array([schedule.at(t) for t in times])
            both[:, r] = np.linspace(wait.since, wait.at, 200)
            rng = np.random.default_rng(seed)
            rows = worst_rows(world, plans, both, rng)
            assert (headroom(world, rows) >= -1e-7).all()
    assert slowed >= 4


def test_a_robot_with_a_higher_priority_waits_only_where_it_must(world, coordinator):
    for seed in range(6):
        plans = swings(world.scene, seed)
        for first in plans:
            mine = {
                robot: CellPlan(one.plan, priority=2 if robot == first else 1)
                for robot, one in plans.items()
            }
            schedule = coordinator.map(mine).schedule()
            assert not [wait for wait in schedule.waits if wait.robot == first]


def waits_in(cell, interlocks, seed):
    """Places of an execution at random paces."""
    rng = np.random.default_rng(seed)
    paces = dict(zip(cell.robots, rng.uniform(0.2, 1.0, len(cell.robots)), strict=True))
    return cell.execute(interlocks, paces=paces)


def let_in(cell, interlocks):
    """Blocked cells that interlocks let both robots into, somewhere."""
    diagram = cell.diagrams[0]
    low = diagram.step * np.argwhere(diagram.blocked)
    inside = np.ones(len(low), dtype=bool)
    for one in interlocks:
        w = cell.robots.index(one.waiting.robot)
        # All of a cell is kept out if its corners are that are nearest to what is not.
        past = np.minimum(low[:, 1 - w] + diagram.step, 6.0)
        inside &= ~((low[:, w] >= one.at) & (past <= one.until))
    return inside


@pytest.mark.parametrize("slack", [0.0, 0.05])
def test_interlocks_keep_robots_apart_at_any_pace_and_each_is_needed(
    world, coordinator, slack
):
    count = 0
    for seed in range(3):
        plans = swings(world.scene, seed, following_error=FOLLOWING, skew=SKEW)
        cell = coordinator.map(plans)
        schedule, interlocks = cell.schedule(), cell.interlocks(slack=slack)
        count += len(interlocks)
        for k in range(3):
            run = waits_in(cell, interlocks, k)
            assert run.finished
            assert all(cell.allowed(*both) for both in run.plan_times)
        full = cell.execute(interlocks)
        assert full.times[-1] <= (1.0 + slack) * schedule.makespan + 0.1
        assert not let_in(cell, interlocks).any()
        for left_out in interlocks:
            rest = [one for one in interlocks if one is not left_out]
            assert let_in(cell, rest).any()
    assert count >= 3


def test_interlocks_are_at_named_segments_where_that_costs_little():
    scene = cell_of()
    names = {0: "pick", 2: "carry", 4: "place"}
    plans = {
        "left": plan_through(scene, "left", [0.5, 0.5, -1.2, 0.5, 0.5, 0.5]),
        "right": plan_through(scene, "right", [-0.5, -0.5, -0.5, 1.2, -0.5, -0.5]),
    }
    named = {r: CellPlan(one.plan, names=names) for r, one in plans.items()}
    cell = coordination_map(scene, **named)
    assert [one.name for one in cell.segments["left"]] == ["pick", "carry", "place"]
    [one] = cell.interlocks(slack=0.5)
    assert one.sentence == "right waits before `carry` until left has passed `carry`"


def test_three_robots_are_apart_pair_by_pair():
    robots = ("left", "right", "third")
    scene = cell_of(robots)
    plans = {
        "left": plan_through(scene, "left", [0.6, -1.0, 0.6, 0.6]),
        "right": plan_through(scene, "right", [-0.6, -0.6, 1.0, -0.6]),
        "third": plan_through(scene, "third", [-1.2, 0.0, 0.0, -1.2]),
    }
    cell = coordination_map(scene, **plans)
    assert len(cell.diagrams) == 3
    oracle = Oracle(cell_tables(scene))
    schedule, interlocks = cell.schedule(), cell.interlocks()
    assert {one.waiting.robot for one in interlocks} >= {"third"}
    assert schedule.makespan < 0.95 * cell.one_after_another
    for paces in (None, {"left": 0.4}, {"third": 0.3}, {"right": 0.5, "left": 0.9}):
        run = cell.execute(interlocks, paces=paces)
        assert run.finished
        rows = np.zeros((len(run.times), 6))
        for r, robot in enumerate(robots):
            own = positions(plans[robot].plan.tube, run.plan_times[:, r])
            chosen = [name.startswith(f"{robot}/") for name in scene.q_names]
            rows[:, chosen] = own[:, chosen]
        between = np.array(pairs_between(oracle))
        buffers = np.array([oracle.buffer(*pair) for pair in oracle.pairs])
        gaps = (oracle.distances(rows) - buffers)[:, between]
        assert gaps.min() >= -1e-7


def cell_tables(scene):
    """Tables of a scene whose arms have primitives only."""
    return World.of(scene).oracle.tables


def test_a_floor_is_kept_between_robots(world):
    plans = swings(world.scene, 1)
    wide = coordination_map(world.scene, floor=0.08, **plans)
    usual = coordination_map(world.scene, **plans)
    assert wide.free < usual.free - 0.005
    rng = np.random.default_rng(0)
    times = rng.uniform(0.0, 6.0, (2000, 2))
    chosen = np.array([wide.allowed(*both) for both in times])
    rows = worst_rows(world, plans, times[chosen], rng, 0.0, 0.0)
    assert headroom(world, rows).min() >= 0.08 - 0.01 - 1e-7


def test_own_links_and_static_objects_are_reported_for_each_plan_alone(world):
    scene = cell_of()
    ball = ag.Sphere(radius=0.2)
    scene.add(ball, name="ball", pose=ag.Pose(xyz=(0.0, 0.7, 0.0)))
    plans = {
        "left": plan_through(scene, "left", [0.0, 1.5, 0.0]),
        "right": plan_through(scene, "right", [0.0, -0.2, 0.0]),
    }
    cell = coordination_map(scene, **plans)
    assert cell.free == 1.0
    assert cell.alone["right"] == ()
    touched = {
        name for one in cell.alone["left"] for name in (one.nearest.b, one.nearest.a)
    }
    assert "ball" in touched
    proof = ag.verify(plans["left"].plan, scene)
    assert [one.start for one in proof.intervals] == pytest.approx(
        [one.start for one in cell.alone["left"]], abs=1e-4
    )


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        (([-1.3, 0.5], [1.3, -0.5]), "no way: left and right begin too near"),
        (([0.5, -1.3], [-0.5, 1.3]), "no way: left and right end too near"),
        # Each arm has to pass where the other waits.
        (
            ([-0.35, -0.8, 0.6], [0.35, 0.8, -0.6]),
            "no way: left cannot go on at .* for right, left/link. and right/link.; "
            "right cannot go on at .* for left, ",
        ),
    ],
)
def test_a_diagram_without_a_way_says_what_blocks_it(world, coordinator, turns, words):
    left, right = turns
    plans = {
        "left": plan_through(world.scene, "left", left),
        "right": plan_through(world.scene, "right", right),
    }
    cell = coordinator.map(plans)
    with pytest.raises(CoordinationError, match=words):
        cell.schedule()
    assert "no way" in cell.sentence


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s, p: {"left": p["left"]}, "give two robots"),
        (lambda s, p: {**p, "middle": p["left"]}, "'middle' is no robot"),
        (
            lambda s, p: {**p, "left": CellPlan(p["left"].plan, names={9: "late"})},
            "row 9 begins no segment",
        ),
        (
            lambda s, p: {**p, "left": p["right"]},
            "the plan of 'left' moves 'right/joint1'",
        ),
        (
            lambda s, p: {**p, "left": CellPlan(p["left"].plan, skew=-1.0)},
            "skew is -1",
        ),
        (lambda s, p: {**p, "left": without_time(s)}, "it has no times"),
    ],
)
def test_what_cannot_be_mapped_is_refused_in_words(world, change, words):
    plans = change(world.scene, swings(world.scene, 0))
    with pytest.raises(ag.ArmguardError, match=words):
        coordination_map(world.scene, **plans)


def without_time(scene):
    """A path of one arm."""
    names = ("left/joint1", "left/joint2")
    path = ag.Trajectory(names, np.zeros((2, 2)), None, "path")
    return ag.Plan.of(path, scene, hold_home=True)
