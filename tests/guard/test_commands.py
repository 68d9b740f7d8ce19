"""Commands under way: what an arm may still be driven to, and what was sent."""

import numpy as np
import pytest

from approach import PERIOD, ball_scene
from armguard.guard import Reason
from armguard.respond import Guard

COMMAND, SENSING = 0.003, 0.003


def fresh(**options):
    """A guard whose commands are watched."""
    return Guard(ball_scene(**options), self_test=False)


def sent_of(guard):
    """What is under way of the only joint: least and greatest."""
    return tuple(guard._watch.under_way[0])


def test_at_first_nothing_is_under_way():
    guard = fresh()
    guard.filter([-1.0], [0.0], 0.0, velocity=[0.0])
    assert sent_of(guard) == (0.0, 0.0)


def test_a_command_is_under_way_until_one_after_it_has_taken_effect():
    guard = fresh()
    q, v = -1.0, 0.0
    commanded = []
    for k in range(200):
        desired = 0.4 if k < 100 else -0.4
        command = guard.filter([q], [desired], k * PERIOD, velocity=[v])
        commanded.append(command.velocity[0])
        # Without a time, a measurement may be as old as `sensing`.
        measured = k * PERIOD - SENSING
        window = [commanded[-1]]
        for back in range(1, len(commanded) + 1):
            at = (k + 1 - back) * PERIOD
            window.append(commanded[-back])
            if at <= measured - COMMAND:
                break
        else:
            window.append(0.0)
        assert sent_of(guard) == pytest.approx((min(window), max(window)))
        v = commanded[-1]
        q += v * PERIOD


def test_where_older_commands_are_forgotten_anything_may_be_under_way():
    guard = fresh(settings={"period": PERIOD})
    q, v = -1.0, 0.0
    room = len(guard._watch.sent_at)
    # Twenty times as many cycles as were announced.
    for k in range(3 * room):
        command = guard.filter([q], [0.4], k * PERIOD / 20.0, velocity=[v])
        v = command.velocity[0]
        q += v * PERIOD / 20.0
    assert sent_of(guard) == (-2.0, 2.0)


def test_cycles_that_come_early_change_commands_less():
    guard = fresh()
    q, v, commanded = -1.0, 0.0, []
    for k in range(60):
        command = guard.filter([q], [0.4], 0.25 * k * PERIOD, velocity=[v])
        v = command.velocity[0]
        commanded.append(v)
        q += 0.25 * v * PERIOD
    # The first one cannot know how soon the next will come.
    assert np.diff(commanded)[1:].max() <= 8.0 * 0.25 * PERIOD * (1.0 + 1e-9)


def test_what_is_sent_by_an_arm_that_stops_is_the_declared_stop():
    guard = fresh()
    q, v = -1.0, 0.0
    for k in range(100):
        command = guard.filter([q], [0.4], k * PERIOD, velocity=[v])
        v = command.velocity[0]
        q += v * PERIOD
    speeds = []
    for k in range(100, 220):
        command = guard.filter([q], [np.nan], k * PERIOD, velocity=[v])
        v = command.velocity[0]
        q += v * PERIOD
        speeds.append(v)
    assert np.diff([0.4, *speeds])[:99] == pytest.approx(-4.0 * PERIOD)
    assert speeds[-1] == 0.0
    # That is what was declared: no verdict calls for the brake.
    assert guard._watch.disproved.sum() == 0


@pytest.mark.parametrize("stamp", [np.nan, None, -5.0, "soon", {}])
def test_a_stamp_that_cannot_be_true_leads_to_rest_as_well(stamp):
    guard = fresh()
    q, v = -1.0, 0.0
    for k in range(100):
        command = guard.filter([q], [0.4], k * PERIOD, velocity=[v])
        v = command.velocity[0]
        q += v * PERIOD
    assert v == pytest.approx(0.4)
    for _ in range(120):
        command = guard.filter([q], [0.4], stamp, velocity=[v])
        assert command.action > 0
        assert 0.0 <= command.velocity[0] <= v
        v = command.velocity[0]
        q += v * PERIOD
    # It is unknown how much time has passed: a cycle's worth in each.
    assert v == 0.0


def test_a_step_in_between_counts_with_every_operator_again():
    guard = fresh()
    filtered = guard.filter([-1.0], [0.0], 0.0, velocity=[0.0]).verdict
    stepped = guard.step([-1.0], PERIOD, velocity=[0.0])
    assert stepped.nearest.headroom < filtered.nearest.headroom


def test_reset_forgets_what_was_sent():
    guard = fresh()
    for k in range(50):
        guard.filter([-1.0], [0.4], k * PERIOD, velocity=[0.0])
    guard.reset()
    command = guard.filter([-1.0], [0.0], 0.0, velocity=[0.0])
    assert sent_of(guard) == (0.0, 0.0)
    assert command.verdict.reason is not Reason.NOT_FOLLOWED
