"""What an arm of the simulation does is what its figures declare."""

import numpy as np
import pytest

from armguard.robot.stopping import StopTable, stopping_figures
from armguard.simulation import Drives, Phase
from arms import simple_arm

SPEED = 0.8


def drives(**figures):
    """Drives of an arm that moves at SPEED, and their figures."""
    declared = stopping_figures(
        simple_arm(),
        **{"velocity": 1.0, "deceleration": 4.0, "acceleration": 8.0, **figures},
    )
    still = np.zeros(len(declared.velocity))
    return Drives(declared, still, still - np.inf, still + np.inf), declared


def driven(**figures):
    """The same at full speed."""
    one, declared = drives(**figures)
    one.follow(np.full(len(one.q), SPEED), np.zeros(len(one.q)))
    one.advance(SPEED / 8.0)
    one.advance(0.1)
    return one, declared


def rest(one, dt=1e-3):
    """Time and farthest way from now until it is held."""
    start, time, farthest = one.q.copy(), 0.0, 0.0
    while one.phase is not Phase.HELD:
        one.advance(dt)
        time += dt
        farthest = max(farthest, float(np.abs(one.q - start).max()))
    return time, farthest, float(np.abs(one.q - start).max())


def test_it_speeds_up_as_declared_and_stays_there():
    one, _ = drives()
    one.follow(np.full(len(one.q), SPEED), np.zeros(len(one.q)))
    one.advance(0.05)
    assert one.v == pytest.approx(0.4)
    assert one.q == pytest.approx(0.5 * 8.0 * 0.05**2)
    one.advance(1.0)
    assert one.v == pytest.approx(SPEED)


def test_cutting_time_finer_changes_nothing():
    whole, fine = (
        driven(ramp=0.02, settle=0.01, settle_time=0.2),
        driven(ramp=0.02, settle=0.01, settle_time=0.2),
    )
    for one, steps in ((whole[0], 1), (fine[0], 64)):
        one.stop()
        for _ in range(steps):
            one.advance(0.15 / steps)
    assert whole[0].q == pytest.approx(fine[0].q, abs=1e-12)
    assert whole[0].v == pytest.approx(fine[0].v, abs=1e-12)


def test_a_stop_takes_the_way_of_its_deceleration_and_its_ramp():
    one, _ = driven(ramp=0.05)
    one.stop()
    time, _, way = rest(one)
    a, r = 4.0, 0.05
    expected = SPEED * r - a * r**2 / 6.0 + (SPEED - a * r / 2.0) ** 2 / (2.0 * a)
    assert way == pytest.approx(expected, abs=1e-9)
    assert time == pytest.approx(r / 2.0 + SPEED / a, abs=2e-3)


def test_a_stop_from_a_creep_ends_within_its_ramp():
    one, _ = drives(ramp=0.05)
    one.follow(np.full(len(one.q), 0.01), np.zeros(len(one.q)))
    one.advance(0.1)
    one.stop()
    time, _, way = rest(one, dt=1e-4)
    assert time == pytest.approx(np.sqrt(2 * 0.05 * 0.01 / 4.0), abs=2e-4)
    assert 0.0 < way < 0.01 * time


def test_it_swings_as_far_as_declared_and_comes_back():
    one, declared = driven(settle=0.02, settle_time=0.3)
    plain, _ = driven()
    for each in (one, plain):
        each.stop()
    (_, far, end), (_, _, expected) = rest(one), rest(plain)
    height = 0.02 * SPEED / declared.velocity[0]
    assert far == pytest.approx(expected + height, rel=1e-3)
    assert end == pytest.approx(expected, abs=1e-9)


def test_a_measured_stop_is_not_farther_than_its_table():
    joints = simple_arm().q_names
    table = StopTable((0.5, 1.0), (0.3, 0.5), (0.08, 0.2))
    one, _ = driven(tables=dict.fromkeys(joints, table))
    one.stop()
    time, _, way = rest(one)
    assert way <= table.at(SPEED)[1] + 1e-9
    assert time <= table.at(SPEED)[0] + 2e-3


def test_a_stop_is_carried_out_whatever_is_commanded_meanwhile():
    one, _ = driven()
    one.stop()
    one.advance(0.05)
    one.follow(np.full(len(one.q), SPEED), np.zeros(len(one.q)))
    speed = one.v.copy()
    one.advance(0.05)
    assert (one.v < speed).all()
    rest(one)
    one.follow(np.zeros(len(one.q)), np.full(len(one.q), 0.02))
    one.advance(0.1)
    assert one.phase is Phase.HELD and not one.v.any()


def test_the_brake_takes_the_place_of_a_stop():
    one, _ = driven(brake_deceleration=20.0)
    one.stop()
    one.advance(0.02)
    speed = float(one.v[0])
    one.brake()
    time, _, way = rest(one, dt=1e-4)
    assert one.braked
    assert way == pytest.approx(speed**2 / 40.0, abs=1e-9)
    assert time == pytest.approx(speed / 20.0, abs=2e-4)
