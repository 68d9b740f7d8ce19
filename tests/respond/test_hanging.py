"""An encoder that hangs: the same position, again and again, with fresh stamps."""

import numpy as np
import pytest

from armguard.guard import Reason
from armguard.respond import Action, Guard
from driven import ball_guard
from grippers import pick_scene

PERIOD = 0.001


def follow(guard, desired, cycles, hangs=lambda k, stuck: None, begin=0.0):
    """Commands of an arm that follows them; `hangs` says what is measured."""
    q, v = guard.home, np.zeros(len(guard.q_names))
    commands = []
    for k in range(cycles):
        time = begin + k * PERIOD
        stuck = hangs(k, q)
        measured = q if stuck is None else stuck
        # An encoder that hangs reports no speed either.
        speed = v if stuck is None else 0.0 * v
        command = guard.filter(measured, desired, time, velocity=speed, now=time)
        v = command.velocity
        q = q + v * PERIOD
        commands.append(command)
    return commands


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_an_arm_that_is_commanded_to_move_and_measures_the_same_is_stopped(speed):
    guard = ball_guard()
    desired = np.full(len(guard.q_names), -speed)
    commands = follow(guard, desired, 200, lambda k, q: guard.home)
    reasons = [c.verdict.reason for c in commands]
    first = reasons.index(Reason.STATE_FROZEN)
    assert 80 <= first <= 100
    assert all(c.action is Action.FOLLOW for c in commands[:first])
    assert commands[first].action is Action.STOP
    assert commands[first].verdict.joint in guard.q_names
    assert "stop, the measured position is stuck" in commands[first].verdict.why


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_positions_that_hang_beside_true_velocities_are_named_at_once(speed):
    guard = ball_guard()
    desired = np.full(len(guard.q_names), -speed)
    q, v, reasons = guard.home, np.zeros(len(guard.q_names)), []
    for k in range(700):
        command = guard.filter(q, desired, k * PERIOD, velocity=v, now=k * PERIOD)
        reasons.append(command.verdict.reason)
        v = command.velocity
        q = q if k >= 500 else q + v * PERIOD
    first = reasons.index(Reason.STATE_FROZEN)
    assert 500 < first <= 510
    assert all(reason < Reason.NOT_FINITE for reason in reasons[:first])


def test_an_arm_that_rests_may_measure_the_same_for_ever():
    guard = ball_guard()
    desired = np.zeros(len(guard.q_names))
    for command in follow(guard, desired, 2000, lambda k, q: guard.home):
        assert command.action is Action.FOLLOW


def test_an_arm_that_moves_by_the_least_bit_does_not_hang():
    guard = ball_guard()
    desired = np.full(len(guard.q_names), -0.1)
    commands = follow(
        guard,
        desired,
        400,
        lambda k, q: guard.home * (1.0 + 1e-15 * (k % 2)) + k * 1e-16,
    )
    assert all(c.verdict.reason is not Reason.STATE_FROZEN for c in commands)


def test_fingers_may_stand_against_what_they_grip():
    guard = Guard(pick_scene(), self_test=False)
    desired = np.zeros(len(guard.q_names))
    closing = [k for k, name in enumerate(guard.q_names) if "open_" in name]
    desired[closing] = -0.02
    commands = follow(guard, desired, 400, lambda k, q: guard.home)
    assert commands[-1].velocity[closing].min() < 0.0
    assert all(c.action is Action.FOLLOW for c in commands)
    hand = np.zeros(len(guard.q_names))
    hand[0] = 0.02
    commands = follow(guard, hand, 400, lambda k, q: guard.home, begin=0.4)
    assert Reason.STATE_FROZEN in [c.verdict.reason for c in commands]
    assert not commands[-1].velocity.any()
