"""Episodes of the closed loop: the loop itself with naive guards, then the real one."""

import numpy as np
import pytest

from closed_loop.plan import work
from closed_loop.settings import Plan
from closed_loop_campaign import summed_up

BATCH = 25


def episodes(plan, seeds):
    return [work((plan, seed)) for seed in seeds]


def contacts(found):
    return [(e["seed"], e["setting"], e["contact"]) for e in found if e["contact"]]


def test_no_arm_that_is_stopped_at_once_touches_anything():
    found = episodes(Plan(guard="stopper"), range(6))
    assert not contacts(found)
    for e in found:
        assert {s["arm"] for s in e["stops"]} == {"left", "right"}
        assert e["joint_way"] < 0.05 and e["cycles"] > 20


@pytest.mark.parametrize("scene", ["bay", "movers"])
def test_nothing_moves_before_a_verdict_lets_it_go(scene):
    found = episodes(Plan(scene, guard="keeper"), range(4))
    for e in found:
        assert e["joint_way"] == e["tool_way"] == e["releases"] == 0
        assert e["cycles"] > 20 and not e["stops"]
    assert any(e["joint_wish"] > 0.0 for e in found)


def test_the_first_time_an_arm_is_let_go_is_no_release():
    assert all(e["releases"] == 0 for e in episodes(Plan(guard="blind"), range(3)))


def test_without_a_guard_operators_reach_what_they_go_for():
    found = episodes(Plan(guard="blind"), range(24))
    assert len(contacts(found)) >= 4
    assert all(not e["stops"] for e in found)


def test_a_fixed_distance_is_not_enough_for_the_worst_plant():
    plan = Plan(guard="threshold", weak_brake=0.7, floor=0.02)
    found = episodes(plan, range(8))
    assert contacts(found) and sum(len(e["stops"]) for e in found) > 4
    assert summed_up(plan, found)["contacts"] == len(contacts(found))


def test_a_seed_is_an_episode():
    plan = Plan("movers", guard="threshold", floor=0.03)
    one, two = (work((plan, 7)) for _ in range(2))
    for measured in ("wall", "cycle_times"):
        one.pop(measured), two.pop(measured)
    assert one == two
    other = work((plan, 19))
    assert not np.allclose(one["rest_q"], other["rest_q"])


@pytest.mark.parametrize("scene", ["bay", "movers"])
@pytest.mark.parametrize("mode", ["path", "speed"])
@pytest.mark.parametrize("batch", range(5))
def test_no_arm_touches_anything_while_its_figures_are_true(scene, mode, batch):
    """500 episodes in all."""
    plan = Plan(scene, mode, duration=0.6)
    found = episodes(plan, range(batch * BATCH, (batch + 1) * BATCH))
    assert not contacts(found)
    assert all(e["least"] >= e["floor"] - 1e-5 for e in found)


@pytest.mark.parametrize("term", ["command", "acceleration", "deceleration"])
def test_a_term_of_the_budget_that_is_missing_is_seen(term):
    assert contacts(episodes(Plan(zero=term), range(24)))


def test_a_tracking_error_that_is_missing_is_seen():
    """A drive that keeps to its commands until it is near, and then misses them all."""
    seeds = (1, 20, 28, 35)
    zero, large = (
        episodes(Plan(guard="filter", **{how: "tracking_error"}), seeds)
        for how in ("zero", "large")
    )
    assert len(contacts(zero)) >= 2
    assert not contacts(large)
    assert {s["reason"] for e in zero for s in e["stops"]} & {"NOT_FOLLOWED"}


def test_a_period_that_is_missing_stops_everything():
    """The only term without which nothing touches."""
    found = episodes(Plan(zero="period"), range(3))
    assert not contacts(found)
    assert {s["reason"] for e in found for s in e["stops"]} == {"CYCLE_LATE"}


def test_a_brake_that_is_too_weak_is_answered_before_contact():
    found = episodes(Plan(weak_brake=0.7), range(20))
    touched = [e for e in found if e["contact"]]
    assert all(e["braked_before"] for e in touched)


@pytest.mark.parametrize(
    ("scene", "count", "near"), [("bay", 40, 0.005), ("movers", 15, 0.015)]
)
def test_no_arm_that_follows_the_filter_touches_anything(scene, count, near):
    """However late and inexactly it follows, inside what is declared."""
    found = episodes(Plan(scene, guard="filter", duration=0.8), range(count))
    assert not contacts(found)
    assert all(e["least"] >= e["floor"] - 1e-5 for e in found)
    # It is not for want of motion: they come near, and mostly without a stop.
    assert min(e["least"] for e in found) < near
    assert sum(e["joint_way"] for e in found) > 0.2 * sum(
        e["joint_wish"] for e in found
    )
    assert sum(not e["stops"] for e in found) > 0.4 * count


def test_what_meets_an_arm_on_its_way_out_would_have_met_it_at_rest():
    """It rests where the object comes, is led away, and its operator lets go."""
    found = episodes(Plan("movers", guard="filter"), [629, 663, 940])
    assert [one["contact"] for one in found] == [None] * 3
    assert sum(one["met_at_rest"] for one in found) > 0
