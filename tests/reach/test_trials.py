"""Trials of the benchmark: its parts on their own, then a sample of it."""

import numpy as np
import pytest

from armguard.respond.command import Action
from closed_loop.settings import SUBSTEP
from reach.answers import Answering, Orders, answering
from reach.arena import PERIOD, STEPS, Drives, arena_of
from reach.goals import draw_goal
from reach.runs import SLIDES, slid, start_of
from reach.trial import Trial

# Seeds of the bay whose operators find their own way certified, by kind of goal.
OPEN = (1, 2, 8)

# Seeds whose operators steer into something.
CROOKED = (4, 7)


@pytest.fixture(scope="module")
def arena():
    return arena_of("bay")


class Blind(Answering):
    """Commands what operators desire."""

    def __init__(self, arena):
        self._follow = dict.fromkeys(arena.robots, Action.FOLLOW)

    def answer(self, seen, asked):
        return Orders(asked.joints, self._follow)


def run(arena, seed, answers, led=False):
    goal = draw_goal(arena, seed)
    operator = goal.operator(arena, led)
    trial = Trial(arena, seed, goal.start, operator, answers)
    return goal, trial.run()


def test_drives_stay_within_their_figures(arena):
    rng = np.random.default_rng(5)
    cycles = 400
    drives = Drives(arena, rng, arena.home, cycles)
    follow = dict.fromkeys(arena.robots, Action.FOLLOW)
    commanded = np.zeros((cycles, len(arena.home)))
    for k in range(1, cycles):
        step = rng.uniform(-1.0, 1.0, len(arena.home)) * arena.acceleration * PERIOD
        commanded[k] = np.clip(commanded[k - 1] + step, -arena.velocity, arena.velocity)
        drives.obey(commanded[k], follow)
        drives.move()
    v = drives.v_rows[: drives.tick + 1]
    assert (np.abs(np.diff(v, axis=0)) <= arena.acceleration * SUBSTEP + 1e-9).all()
    late = max(f.command for f in arena.figures.values())
    error = arena.joined("tracking_error")
    back = int(np.ceil(late / PERIOD)) + 1
    sent = np.concatenate([np.zeros((back, commanded.shape[1])), commanded[1:]])
    for k in range(50, cycles - 1):
        way = sent[max(k - 1, 0) : k + back + 1]
        now = v[k * STEPS]
        assert (now <= way.max(axis=0) + error).all()
        assert (now >= way.min(axis=0) - error).all()


def test_a_stop_is_carried_out_and_ends(arena):
    drives = Drives(arena, np.random.default_rng(2), arena.home, 1200)
    desired = 0.3 * arena.velocity
    for k in range(1200):
        stop = 200 <= k < 1000
        action = Action.STOP if stop else Action.FOLLOW
        new = drives.obey(desired, dict.fromkeys(arena.robots, action))
        assert new == (list(arena.robots) if k == 200 else [])
        drives.move()
        if k == 990:
            assert (drives.plant.v == 0.0).all()
    assert (np.abs(drives.plant.v) > 0.0).any()


def test_the_same_seed_is_the_same_goal(arena):
    a, b = draw_goal(arena, 4), draw_goal(arena, 4)
    assert (a.start == b.start).all() and (a.q == b.q).all() and a.road == b.road


@pytest.mark.parametrize("seed", [*OPEN, *CROOKED])
def test_certified_ways_are(arena, seed):
    goal = draw_goal(arena, seed)
    assert goal.road == ("straight" if seed in OPEN else "bends")
    corners = [goal.start, *goal.way]
    assert arena.checker.check_path(corners).clear


def test_tools_are_where_the_guard_has_them(arena):
    rng = np.random.default_rng(0)
    q = arena.home + rng.uniform(-0.5, 0.5, len(arena.home))
    _, jacobians = arena.tool_state(q)
    for k, J in enumerate(jacobians):
        for j in np.flatnonzero(arena.driven):
            step = np.zeros(len(q))
            step[j] = 1e-6
            ahead = arena.tool_poses(q + step)[k][:3, 3]
            back = arena.tool_poses(q - step)[k][:3, 3]
            assert np.allclose((ahead - back) / 2e-6, J[:3, j], atol=1e-6)


def test_without_a_guard_operators_run_into_obstacles(arena):
    ends = [run(arena, seed, Blind(arena))[1].end for seed in CROOKED]
    assert "contact" in ends


@pytest.mark.parametrize("seed", OPEN)
def test_goals_with_a_straight_certified_way_are_reached_without_a_stop(arena, seed):
    _, outcome = run(arena, seed, answering(arena, "deflect"))
    assert outcome.reached is not None and outcome.end == "reached"
    assert not outcome.stops and outcome.contact is None
    assert outcome.reached < 1.2 * outcome.nominal + 1.0


@pytest.mark.parametrize("seed", OPEN)
def test_a_field_reaches_them_too(arena, seed):
    _, outcome = run(arena, seed, answering(arena, "field"))
    assert outcome.reached is not None and outcome.end == "reached"
    assert not outcome.stops and outcome.contact is None


@pytest.mark.parametrize("response", ["deflect", "slow", "stop", "field"])
def test_nothing_is_touched_with_any_operator(arena, response):
    answers = answering(arena, response)
    outcomes = [run(arena, seed, answers)[1] for seed in CROOKED]
    assert all(o.contact is None for o in outcomes)
    assert all(o.least > 0.003 for o in outcomes)
    if response == "stop":
        assert all(o.stops and o.reached is None for o in outcomes)


def test_a_tool_slides_along_the_bench(arena):
    slide = SLIDES["bay"]
    start = start_of(arena, slide, 0)
    assert start is not None
    ways = {
        response: slid(arena, slide, start, answering(arena, response), 0)
        for response in ("deflect", "stop")
    }
    assert all(way["contact"] is None for way in ways.values())
    assert min(ways["deflect"]["share"]) > 0.3
    assert ways["stop"]["stops"]
    assert ways["deflect"]["share"][0] > ways["stop"]["share"][0]
