"""The tele-driver keeps a guard busy, and the guard keeps the arms apart."""

import numpy as np
import pytest

from armguard.guard import Level
from armguard.respond import Blocked
from armguard.scene import bay_scene, compile_scene
from armguard.simulation import Operator, TeleDriver
from armguard.simulation.operator import TRY, WAIT
from armguard.simulation.tele import LEG
from rounds import work

TABLES = compile_scene(bay_scene("path"))
TOP = np.concatenate([part.stopping.velocity for part in TABLES.robots])


def test_desired_motion_is_a_function_of_seed_time_and_place():
    one, other = TeleDriver(TABLES, seed=2), TeleDriver(TABLES, seed=2)
    times = np.random.default_rng(0).uniform(0.0, 1e4, 200)
    there = [one.desired(t, TABLES.home) for t in times]
    back = [other.desired(t, TABLES.home) for t in times[::-1]][::-1]
    assert (np.array(there) == np.array(back)).all()
    assert (TeleDriver(TABLES, seed=3).desired(1.0, TABLES.home) != there[0]).any()


def test_desired_motion_is_smooth_and_no_faster_than_the_arms():
    driver, dt = TeleDriver(TABLES, seed=2), 0.004
    q, last = TABLES.home, np.zeros(14)
    for k in range(int(10 * LEG / dt)):
        desired = driver.desired(k * dt, q)
        assert (np.abs(desired) <= 0.8 * TOP + 1e-12).all()
        assert (np.abs(desired - last) <= 10.0 * TOP * dt).all()
        q, last = q + desired * dt, desired
        assert (q > TABLES.lower).all() and (q < TABLES.upper).all()


def test_between_two_legs_no_motion_is_desired():
    driver = TeleDriver(TABLES, seed=5)
    for k in range(50):
        assert not driver.desired((k + 1) * LEG - 0.01, TABLES.home).any()


def test_after_a_stop_the_operator_lets_go_waits_engages_and_goes_elsewhere():
    operator = Operator(TeleDriver(TABLES, seed=1))
    stopped = {"left": Blocked.STOPPED}
    first, _ = operator.drive(1.0, TABLES.home, {})
    assert first[:7].any() and first[7:].any()
    desired, engages = operator.drive(1.01, TABLES.home, stopped)
    assert not desired[:7].any() and desired[7:].any() and engages == []
    # The operator looks on, whatever the arm does: it is too early to go on.
    desired, engages = operator.drive(1.1, TABLES.home, {})
    assert not desired[:7].any() and engages == []
    desired, engages = operator.drive(1.2, TABLES.home, stopped)
    desired, engages = operator.drive(1.21 + 2 * WAIT, TABLES.home, stopped)
    assert engages == ["left"] and not desired[:7].any()


def test_after_a_stop_the_operator_backs_off_before_going_elsewhere():
    operator = Operator(TeleDriver(TABLES, seed=1))
    q = TABLES.home.copy()
    for k in range(100):
        q[0] = TABLES.home[0] + 0.002 * k
        operator.drive(0.01 * k, q, {})
    operator.drive(1.0, q, {"left": Blocked.STOPPED})
    back, engages = operator.drive(1.0 + WAIT + 0.1, q, {})
    assert engages == [] and back[0] < 0.0
    assert -back[0] == np.abs(back[:7]).max()


def test_out_of_a_pair_too_near_the_operator_tries_other_ways():
    operator = Operator(TeleDriver(TABLES, seed=1))
    near = {"right": Blocked.TOO_NEAR}
    first, _ = operator.drive(1.0, TABLES.home, near)
    operator.drive(1.01 + TRY, TABLES.home, near)
    other, engages = operator.drive(2.0 + TRY, TABLES.home, near)
    assert engages == [] and first[7:].any() and (first[7:] != other[7:]).any()


@pytest.mark.parametrize(
    ("name", "response"),
    [("bay", "deflect"), ("bay", "stop"), ("two-pandas", "deflect")],
)
def test_a_minute_at_work_is_busy_and_nothing_touches(name, response):
    found = work(name, response, seed=8)
    assert found.least > 0.0
    assert found.levels[Level.SLOW] + found.levels[Level.STOP] > 500
    assert (found.moving > 0.5).all()
    assert (found.stuck < 6.0).all()
    if response == "stop":
        assert found.stops >= 3
    else:
        assert found.deflected > 500
