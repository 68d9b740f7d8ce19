"""No admissible joint leaves the two curves of its planned stop."""

from math import inf

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.joint_stop import (
    JointStop,
    farthest,
    swing_within,
    whole_way,
)
from armguard.record import records
from joint_stops import curve, planned

NO_CURVE = np.zeros(0)


def stop_of(
    velocity, top, a, reaction, ramp, least, most, settle=0.0, table=NO_CURVE,
    driven=None, time=0.0,
):  # fmt: skip
    out = records(1, JointStop)[0]
    driven = top if driven is None else driven
    planned(
        velocity, -velocity, top, driven, a, reaction, ramp, 0.0, least, most, settle,
        time, table, out,
    )  # fmt: skip
    return out


def plant(rng, v, low, high, a, effect, ramp, brake, times):
    """Positions of one joint: an operator at will, then a stop, by small steps.

    The operator drives it no farther out of [low, high] than it is.
    """
    free = rng.choice([-a, a, 0.0], 20)
    x = np.zeros(len(times))
    move(free, v, min(low, v), max(high, v), effect, ramp, brake, times, x)
    return x


@kernel(entry=True)
def move(free, v, low, high, effect, ramp, brake, times, x):
    """The same, with accelerations given for each twentieth of the time till then."""
    for k in range(1, len(times)):
        dt = times[k] - times[k - 1]
        before = v
        if times[k - 1] < effect:
            free_now = free[int(20 * times[k - 1] / effect) % 20]
            v = min(max(v + dt * free_now, low), high)
        else:
            since = times[k] - effect
            now = brake * min(since / ramp, 1.0) if ramp > 0.0 else brake
            v = np.sign(v) * max(abs(v) - dt * now, 0.0)
        x[k] = x[k - 1] + 0.5 * dt * (before + v)


@pytest.mark.parametrize("most", [1.0, 1.5, inf])
@pytest.mark.parametrize("ramp", [0.0, 0.03])
@pytest.mark.parametrize("filtered", [False, True])
def test_no_admissible_joint_leaves_the_curves(most, ramp, filtered):
    rng = np.random.default_rng(7)
    for _ in range(60):
        top, a, least = rng.uniform(0.5, 2), rng.uniform(1, 20), rng.uniform(0.5, 10)
        hardest = most * least
        reaction = rng.uniform(0.001, 0.06)
        v = rng.uniform(-top, top)
        low_v, high_v = np.sort(rng.uniform(-top, top, 2)) if filtered else (-top, top)
        up = stop_of(v, top, a, reaction, ramp, least, hardest, driven=high_v)
        down = stop_of(-v, top, a, reaction, ramp, least, hardest, driven=-low_v)
        times = np.linspace(0.0, max(up.rest_time, down.rest_time) + 0.05, 4000)
        high, low = curve(times, up), -curve(times, down)
        for _ in range(6):
            brake = rng.uniform(least, min(hardest, 5 * least))
            x = plant(
                rng, v, low_v, high_v, a, rng.uniform(0, reaction),
                rng.uniform(0, ramp), brake, times,
            )  # fmt: skip
            # Small steps are off by their square.
            slack = 2.0 * (a + brake) * (times[1] - times[0]) ** 2 * len(times) ** 0.5
            assert (x <= high + slack).all()
            assert (x >= low - slack).all()


def test_the_worst_joint_follows_the_upper_curve():
    v, top, a, reaction, ramp, least = 0.8, 1.5, 6.0, 0.02, 0.05, 3.0
    stop = stop_of(v, top, a, reaction, ramp, least, inf)
    times = np.linspace(0.0, stop.rest_time, 200_001)
    x, speed = np.zeros_like(times), v
    dt = times[1]
    for k in range(1, len(times)):
        t = times[k] - 0.5 * dt
        change = a if t < reaction else -least * min((t - reaction) / ramp, 1.0)
        after = max(speed + change * dt, 0.0)
        x[k] = x[k - 1] + 0.5 * dt * (speed + after)
        speed = after
    # Where the ramp begins in the middle of a step these steps are off by as much.
    assert np.allclose(x, curve(times, stop), atol=5e-6)
    assert stop.travel == pytest.approx(x[-1], abs=5e-6)
    assert speed == pytest.approx(0.0, abs=1e-4)


def test_a_joint_at_top_speed_gains_none():
    stop = stop_of(1.0, 1.0, 50.0, 0.1, 0.0, 2.0, inf)
    assert stop.travel == pytest.approx(0.1 + 1.0 / 4.0)
    assert stop.rest_time == pytest.approx(0.1 + 0.5)


def test_the_swing_is_in_proportion_to_the_speed():
    slow = stop_of(0.5, 1.0, 0.001, 0.0, 0.0, 2.0, inf, settle=0.01)
    fast = stop_of(1.0, 1.0, 0.001, 0.0, 0.0, 2.0, inf, settle=0.01)
    assert fast.swing == pytest.approx(0.01)
    assert slow.swing == pytest.approx(0.005)


def test_a_joint_that_moves_away_only_gets_back():
    stop = stop_of(-1.0, 1.0, 2.0, 0.01, 0.0, 2.0, 4.0)
    assert stop.travel == 0.0
    found = curve(np.array([0.0, 0.1, 1.0]), stop)
    assert found[0] == 0.0
    assert (np.diff(found) <= 0.0).all()
    # At its hardest 4 rad/s² from 1 rad/s.
    assert found[-1] == pytest.approx(-1.0 / 8.0)


def swings(v, top, stop_at, a, ramp, brake, settle, time, rng):
    """A joint that is driven at will, stops, and swings back past its rest at once.

    Returns:
        Times and positions; it swings as far as the speed its stop began with allows.
    """
    end = stop_at + v / brake + ramp + time + 0.05
    times = np.linspace(0.0, end, 4000)
    push = rng.choice([-a, 0.0, a])
    found = np.zeros(len(times))
    swing(push, v, top, stop_at, ramp, brake, settle, time, times, found)
    return times, found


@kernel(entry=True)
def swing(push, v, top, stop_at, ramp, brake, settle, time, times, found):
    """The same positions, with the acceleration till the stop given."""
    dt, x, speed, began, rest = times[1], 0.0, v, v, -1.0
    for k in range(1, len(times)):
        before = speed
        if times[k - 1] < stop_at:
            speed = began = min(max(speed + dt * push, 0.0), top)
        else:
            since = times[k] - stop_at
            now = brake * min(since / ramp, 1.0) if ramp > 0.0 else brake
            speed = max(speed - dt * now, 0.0)
        x += 0.5 * dt * (before + speed)
        found[k] = x
        if speed == 0.0 and times[k] >= stop_at:
            rest = times[k] if rest < 0.0 else rest
            if times[k] - rest <= time:
                found[k] = x - settle * began / top


@pytest.mark.parametrize("most", [1.0, 2.0, inf])
@pytest.mark.parametrize("slow", [False, True])
def test_no_swing_back_leaves_the_curves(most, slow):
    rng = np.random.default_rng(11)
    nearest = inf
    for _ in range(60):
        top, a, least = rng.uniform(0.5, 2), rng.uniform(1, 20), rng.uniform(1, 10)
        reaction, ramp = rng.uniform(0.001, 0.03), rng.uniform(0.0, 0.03)
        v = rng.uniform(0.0, 0.1 if slow else 1.0) * top
        settle, time = rng.uniform(0.005, 0.1), 0.1
        hardest = most * least
        stop = stop_of(
            -v, top, a, reaction, ramp, least, hardest, settle=settle, time=time
        )
        for _ in range(6):
            brake = rng.uniform(least, min(hardest, 20 * least))
            times, x = swings(
                v, top, rng.uniform(0, reaction), a, rng.uniform(0, ramp), brake,
                settle, time, rng,
            )  # fmt: skip
            bound = np.array([upper(t, stop) for t in times])
            slack = 2.0 * (a + brake) * times[1] ** 2 * len(times) ** 0.5
            assert (-x <= bound + slack).all()
            nearest = min(nearest, (bound + x).min())
    assert nearest < 5e-3


@kernel(entry=True)
def upper(t, stop):
    """Farthest displacement at a time, settling included."""
    first = farthest(t, stop)
    return first + swing_within(t, t, first, first, stop)[0]


@kernel(entry=True)
def in_all(stop):
    return whole_way(stop)


def test_an_arm_stopped_hard_as_it_leaves_swings_back_by_just_that_much():
    v, top, settle, hardest = 0.2, 1.0, 0.1, 50.0
    stop = stop_of(-v, top, 0.0, 0.0, 0.0, 1.0, hardest, settle=settle, time=0.1)
    # It rests after v²/2a, and swings back by its share of the declared swing.
    back = settle * v / top - 0.5 * v * v / hardest
    assert in_all(stop) == pytest.approx(back, rel=1e-12)
    assert upper(0.05, stop) == pytest.approx(back, rel=1e-12)


def test_a_measured_table_takes_the_place_of_the_formula():
    from armguard.motion.prepare import curve_row
    from armguard.robot.stopping import StopTable

    table = StopTable((0.5, 1.0), (0.2, 0.4), (0.05, 0.2))
    stop = stop_of(1.0, 1.0, 1e-9, 0.01, 0.0, 99.0, inf, 0.0, curve_row(table, 1.0))
    assert stop.travel == pytest.approx(0.01 + 0.2, rel=1e-6)
    assert stop.rest_time >= 0.41
    half = stop_of(0.5, 1.0, 1e-9, 0.01, 0.0, 99.0, inf, 0.0, curve_row(table, 1.0))
    assert half.travel == pytest.approx(0.005 + 0.05, rel=1e-6)
