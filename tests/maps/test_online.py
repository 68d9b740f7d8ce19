"""Two arms on line: apart by Coal, never both yielding, never stuck, at a true belt."""

from dataclasses import replace
from math import ceil, sin
from pathlib import Path

import numpy as np
import pytest

from armguard.maps.cell_plan import CoordinationError
from armguard.maps.job import read_line_job
from armguard.maps.lane import QUIET, Lane
from armguard.maps.line_cell import Conveyor, Job, LineCell, LinePlan, Track
from armguard.maps.line_run import LineRun
from armguard.maps.online import Line
from armguard.maps.right_of_way import STEP, Order
from coordinating.judge import Found, Kind, executed, known_cell
from crossing import cell_of, plan_through
from verifying.plans import World

CYCLE = 0.01
BELT = Conveyor(0.15, 0.25)
TRACK = Track(start=2.0, end=3.5, at=1.0, speed=0.3)


@pytest.fixture(scope="module")
def world():
    return World.of(cell_of())


@pytest.fixture(scope="module")
def known(world):
    """Swings into the other's space; one of each arm follows a belt."""
    turns = {
        "deep": [-0.7, 0.6, 0.6, -0.7],
        "twice": [-0.7, 0.6, -0.7, 0.6, -0.7],
        "belt": [-0.7, 0.0, 0.6, 0.6, -0.7],
    }
    plans = {}
    for robot, side in (("left", -1.0), ("right", 1.0)):
        for name, way in turns.items():
            plan = plan_through(world.scene, robot, side * np.array(way))
            track = TRACK if name == "belt" else None
            plans[f"{robot} {name}"] = LinePlan(robot, plan, track)
    return LineCell.of(world.scene, plans, conveyor=BELT)


def run(line, jobs, speed=lambda t: 0.2, seconds=120.0):
    """Execute jobs; rows and whether both yield, by cycle, and cycles with a yield."""
    rows, both, yields, travel, waiting = [], [], 0, 0.0, list(jobs)
    for k in range(int(seconds / CYCLE)):
        now = CYCLE * k
        while waiting and waiting[0][0] <= now:
            _, number, plans = waiting.pop(0)
            line.add(Job(number, plans, travel=travel))
        moves = line.step(now, travel, speed(now))
        rows.append(line.motion()[0])
        names = {(lane.robot, lane.yields_to) for lane in line.lanes}
        both.append(any(pair[::-1] in names for pair in names))
        yields += any(lane.yields_to for lane in line.lanes)
        travel += CYCLE * speed(now)
        if not moves and not waiting:
            break
    return np.array(rows), np.array(both), yields


def headroom(world, rows):
    """Least distance of links of both arms above their buffer in some rows [m]."""
    between = [a.split("/")[0] != b.split("/")[0] for a, b in world.oracle.pairs]
    buffers = np.array([world.oracle.buffer(*pair) for pair in world.oracle.pairs])
    return (world.oracle.distances(rows[::4]) - buffers)[:, between].min()


def crowd(seed, names=("deep", "twice")):
    """Jobs of both arms that arrive at about the same times."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(names, 6)
    plans = [(f"{('left', 'right')[k % 2]} {name}",) for k, name in enumerate(chosen)]
    times = np.sort(rng.uniform(0.0, 6.0, len(plans)))
    return [(t, k, plans[k]) for k, t in enumerate(times)]


@pytest.mark.parametrize("seed", range(3))
def test_arms_stay_apart_one_goes_on_and_all_jobs_end(world, known, seed):
    line = Line(known)
    rows, both, yields = run(line, crowd(seed))
    assert sorted(line.finished) == list(range(6))
    assert yields > 0
    assert not both.any()
    assert headroom(world, rows) >= -1e-7


class Unheld(Line):
    """Arms that do not wait for each other."""

    def _order(self, *_):
        return Order(((), ()), tight=False)


def test_without_right_of_way_arms_touch(world, known):
    rows, _, _ = run(Unheld(known), crowd(0))
    assert headroom(world, rows) < -0.01


def test_joints_change_their_speed_no_faster_than_declared(known):
    rows, _, _ = run(Line(known), crowd(1))
    # Two of the lines of a plan meet at a corner; between these the pace changes alone.
    jumps = np.abs(np.diff(rows, 2, axis=0)).max(axis=1) / CYCLE
    assert np.quantile(jumps, 0.95) <= 4.0 * CYCLE * 1.4


@pytest.mark.parametrize("slow", [0.16, 0.2, 0.24])
def test_an_item_is_followed_whatever_the_belt_does(world, known, slow):
    line = Line(known)
    jobs = [
        (0.0, 0, ("left belt",)),
        (0.5, 1, ("right deep",)),
        (1.0, 2, ("right twice",)),
    ]
    rows, both, _ = run(line, jobs, lambda t: slow + 0.008 * np.sin(t))
    assert sorted(line.finished) == [0, 1, 2]
    assert line.missed == []
    assert line.finished[0] < 0.005
    assert not both.any()
    assert headroom(world, rows) >= -1e-7


def test_an_item_that_no_arm_can_reach_is_said_to_be_missed(known):
    line = Line(known)
    line.add(Job(7, ("left belt",), offset=2.0))
    line.step(0.0, 0.0, 0.2)
    assert line.missed == [7]
    assert line.events == ["no robot reaches the item of job 7"]


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        ((0.6, 0.1, 0.26), "conveyor moves at 0.260 m/s, declared are 0.15 to 0.25"),
        ((0.6, 0.1, np.nan), "conveyor moves at nan"),
        ((0.6, np.nan, 0.2), "conveyor is at nan m; measure it"),
        ((0.1, 0.1, 0.2), "time went from 0.5 s to 0.1 s"),
        ((np.nan, 0.1, 0.2), "time went from 0.5 s to nan s"),
    ],
)
def test_all_stop_for_a_measurement_that_cannot_be_right(known, measured, words):
    line = Line(known)
    line.add(Job(0, ("left deep",)))
    for k in range(51):
        line.step(CYCLE * k, 0.0, 0.2)
    assert line.lanes[0].pace > 0.9
    line.step(*measured)
    assert words in line.fault
    for k in range(60, 100):
        before = line.lanes[0].place
        line.step(CYCLE * k, 0.1, 0.2)
        assert line.lanes[0].place - before <= 10.0 * CYCLE
    assert line.rests
    assert np.isfinite(line.motion()).all()
    assert line.finished == {}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"track": replace(TRACK, speed=0.25)}, "made for 0.25 m/s, the belt moves at"),
        ({"track": replace(TRACK, start=0.2)}, "it follows the belt from 0.2 s"),
        ({"robot": "left"}, "plans of left alone; .* give another one a plan"),
    ],
)
def test_what_cannot_be_coordinated_is_refused_in_words(world, known, change, words):
    plans = {name: known.plans[name] for name in ("left belt", "right belt")}
    plans["right belt"] = replace(plans["right belt"], **change)
    with pytest.raises(CoordinationError, match=words):
        LineCell.of(world.scene, plans, conveyor=BELT)


def test_plans_begin_and_end_at_one_place_clear_of_the_other_arm(world, known):
    left = known.plans["left deep"]
    for turns, words in (
        ([0.7, -0.6, 0.5], "'right' .* begins or ends 0.200 rad"),
        ([0.6, -0.7, 0.6], "'left' ends where plan|begins where plan"),
    ):
        plan = plan_through(world.scene, "right", turns)
        plans = {"left": left, "right": LinePlan("right", plan)}
        with pytest.raises(CoordinationError, match=words):
            LineCell.of(world.scene, plans)


def test_unknown_plans_of_jobs_are_named(known):
    with pytest.raises(CoordinationError, match="job 1: 'left dep' is no plan"):
        Line(known).add(Job(1, ("left dep",)))


LINE = Path(__file__).parents[1] / "data" / "line" / "job.yaml"


@pytest.fixture(scope="module")
def two_sides():
    """Two arms on both sides of a belt."""
    return read_line_job(LINE)


# Phases of the belt at which a job once began though the other arm, which followed an
# item, would keep it waiting too long; at the last one an arm set out too late.
@pytest.mark.parametrize("phase", [0.0, 1.5708, 2.0944, 3.1416, 5.7596])
def test_a_job_that_begins_catches_its_item_on_a_belt_of_changing_speed(
    two_sides, phase
):
    run, now, travel, events = LineRun(two_sides), 0.0, 0.0, []
    while True:
        speed = 0.2 * (1.0 + 0.15 * sin(now + phase))
        travel += speed * CYCLE
        moves = run.step(now, (travel, speed))
        events += run.take_events()
        if not moves:
            break
        now = round(now / CYCLE + 1.0) * CYCLE
    assert sum("begins" in one for one in events) >= 2
    assert not any("misses" in one for one in events)
    assert run.summary()["fault"] == ""


@pytest.mark.parametrize("before", [0.1, 0.0])
def test_an_arm_that_cannot_wait_any_more_is_held_until_it_has_followed(known, before):
    line = Line(known)
    lane = line.lanes[0]
    lane.plan, lane.job, lane.pace = "left belt", Job(1, ("left belt",)), 1.0
    start, end = known.plans["left belt"].reserved
    lane.place = start - before
    assert lane.stop > start
    pace = BELT.slowest / TRACK.speed
    assert line._lanes.hold(lane, BELT.slowest)[0] == ceil(
        (end - lane.place) / pace / STEP
    )


def test_an_order_in_which_both_slow_down_is_not_taken_up():
    # The stream of items and the plans at which it was.
    found = Found()
    executed(Line(known_cell(2)), 2, Kind(10.0), found, guarded=False)
    assert found.counts["yields"] > 100
    assert found.counts["both_yield"] == 0


def test_a_robot_that_slows_down_again_and_again_is_reported_once():
    lane, said = Lane("left", "plan"), []
    for k in range(400):
        now = CYCLE * k
        # It yields every other 0.3 s of the first two seconds.
        lane.yields_to = "right" if now < 2.0 and (k // 30) % 2 == 0 else ""
        said += [(round(now, 2), says) for says in lane.report(now)]
    began, goes_on = said
    assert began == (0.0, "left yields to right")
    # Its last cycle of yielding is at 1.99 s.
    assert goes_on == (1.99 + QUIET, "left goes on after right, it yielded for 2.0 s")


def test_yields_are_reported_in_turn(known):
    line, said = Line(known), []
    jobs = crowd(0)
    for k in range(6000):
        now = CYCLE * k
        while jobs and jobs[0][0] <= now:
            _, number, plans = jobs.pop(0)
            line.add(Job(number, plans))
        moves = line.step(now, 0.0, 0.2)
        said += [(now, one) for one in line.events]
        line.events.clear()
        if not moves and not jobs:
            break
    for robot in ("left", "right"):
        own = [(now, one) for now, one in said if one.startswith(robot)]
        yields = [k for k, (_, one) in enumerate(own) if "yields to" in one]
        assert yields
        for k in yields:
            # A line that ends it comes before the next one, and not at once.
            assert "goes on after" in own[k + 1][1] or "has done" in own[k + 1][1]
