"""Planned stops, step by step: their curves, rests, ends and swings."""

from math import inf

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.figures import CURVE_POINTS
from armguard.motion.joint_stop import (
    JointStop,
    farthest,
    speed_lost,
    swing_within,
)
from armguard.record import records
from joint_stops import curve, planned

NO_CURVE = np.zeros(0)

# Longest time of a swing [s].
SETTLE_TIME = 0.1

# Step of a joint that does its worst [-], and what such steps may be off by.
STEPS, STEP_ERROR = 4000, 2e-6


@kernel(entry=True)
def swing_left(start, end, stop):
    first, last = farthest(start, stop), farthest(end, stop)
    return swing_within(start, end, first, last, stop)


@kernel(entry=True)
def lost_at(time, ramp, d):
    return speed_lost(time, ramp, d)


def speeds_lost(times, ramp, d):
    return np.array([lost_at(t, ramp, d) for t in times])


def stop_of(
    velocity, top, a, reaction, ramp, least, most, settle=0.0, table=NO_CURVE,
    driven=None, passed=0.0, against=None,
):  # fmt: skip
    """A planned stop; the velocity is known exactly unless `against` says otherwise."""
    out = records(1, JointStop)[0]
    driven = top if driven is None else driven
    against = -velocity if against is None else against
    planned(
        velocity, against, top, driven, a, reaction, ramp, passed, least, most, settle,
        SETTLE_TIME, table, out,
    )  # fmt: skip
    return out


def integral(times, values):
    """Running integral by the trapezoidal rule."""
    parts = 0.5 * np.diff(times) * (values[1:] + values[:-1])
    return np.concatenate([[0.0], np.cumsum(parts)])


def worst(v, driven, a, reaction, ramp, passed, least):
    """Times and ways of a joint that speeds up, then brakes as little as it may.

    The ramp of its deceleration began `passed` before the stop surely takes effect.
    """
    before = np.linspace(0.0, reaction, STEPS)
    speed = np.minimum(v + a * before, max(v, driven))
    left = max(ramp - passed, 0.0)
    rising = np.linspace(0.0, left, STEPS)
    share = (rising + ramp - left) / ramp if ramp > 0.0 else 1.0 + rising
    full = np.linspace(0.0, speed[-1] / least, STEPS)
    slower = least * integral(rising, share)
    braked = np.concatenate([slower, slower[-1] + least * full])
    times = np.concatenate([before, reaction + rising, reaction + left + full])
    speeds = np.concatenate([speed, np.maximum(speed[-1] - braked, 0.0)])
    return times, speeds, integral(times, speeds)


# Speeds, acceleration, ramp and how long of it is over: a stop that ends within its
# ramp and one that does not, top speed that is reached and one that is not.
@pytest.mark.parametrize("passed", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("ramp", [0.0, 0.06, 0.3])
@pytest.mark.parametrize("v", [0.0, 0.02, 0.3, 1.4, 1.7])
def test_every_stop_is_that_of_small_steps(v, ramp, passed):
    for a, reaction, least, driven in (
        (0.5, 0.03, 3.0, 1.5),
        (6.0, 0.05, 3.0, 1.5),
        (6.0, 0.05, 3.0, v + 0.1),
        (40.0, 0.05, 0.7, 1.5),
    ):
        stop = stop_of(
            v, 1.5, a, reaction, ramp, least, 2.0 * least, 0.3, NO_CURVE, driven, passed
        )
        times, speeds, ways = worst(v, driven, a, reaction, ramp, passed, least)
        begins = speeds[STEPS - 1]
        rests = times[np.flatnonzero(speeds > 1e-9)[-1]] if begins > 0.0 else reaction
        assert np.allclose(curve(times, stop), ways, atol=STEP_ERROR, rtol=1e-5)
        assert stop.travel == pytest.approx(ways[-1], abs=STEP_ERROR, rel=1e-5)
        assert stop.rest_time == pytest.approx(
            rests, abs=3e-3 * (rests - reaction) + 1e-5
        )
        # One that turns round first may rest later; that counts with all of the ramp.
        later = reaction + ramp + a * reaction / least
        settled = max(stop.rest_time, later) + SETTLE_TIME
        assert stop.settled == pytest.approx(settled)
        assert stop.swing == pytest.approx(0.3 * begins / 1.5)


@pytest.mark.parametrize("ramp", [0.0, 0.06, 0.3])
@pytest.mark.parametrize("against", [0.0, 0.2, 1.3])
def test_what_moves_the_other_way_has_settled_in_time(against, ramp):
    nearest = inf
    for a, reaction, least in ((0.5, 0.03, 3.0), (6.0, 0.05, 3.0), (40.0, 0.05, 0.7)):
        for velocity in (-against, 0.1):
            stop = stop_of(
                velocity, 5.0, a, reaction, ramp, least, inf, 0.3, against=against
            )
            # Its stop takes effect as late as it may, and its ramp has just begun.
            times, speeds, _ = worst(against, 5.0, a, reaction, ramp, 0.0, least)
            rests = times[np.flatnonzero(speeds > 1e-9)[-1]]
            spare = stop.settled - SETTLE_TIME - rests
            assert spare >= -1e-9
            nearest = min(nearest, spare)
    # The whole ramp counts, of which a part brakes.
    assert nearest <= ramp + 1e-3


# A joint goes the other way, speeds up until its stop begins, rests and swings back.
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("a", "most"), [(2.0, 9.0), (6.0, 6.0), (15.0, 40.0)])
def test_a_swing_back_leads_as_far_as_after_the_worst_moment_to_stop(a, most, known):
    rng, kinds = np.random.default_rng(4), set()
    for _ in range(200):
        top, reaction, settle = 3.0, 0.05, rng.choice([0.0, 0.1, 0.6, 1.5])
        slow, fast = np.sort(rng.uniform(0.0, 1.5, 2))
        slow = fast if known else slow
        stop = stop_of(
            -slow, top, a, reaction, 0.0, 1.0, most, settle, driven=-slow, against=fast
        )
        moments = np.linspace(0.0, reaction, 2001)
        leads = []
        for speed in np.linspace(slow, fast, 1 if known else 20):
            begun = speed + a * moments
            way = 0.5 * (speed + begun) * moments + 0.5 * begun**2 / most
            leads.append(settle / top * begun - way)
        leads = np.array(leads)
        assert stop.swing_back >= leads.max() - 1e-12
        if known:
            assert stop.swing_back == pytest.approx(leads.max(), abs=1e-7)
            kinds.add(int(np.digitize(leads[0].argmax(), [1, 2000])))
    # The worst moment is the first, the last, or one in between.
    assert not known or len(kinds) == 3


@pytest.mark.parametrize("a", [1.0, 30.0])
@pytest.mark.parametrize("most", [2.0, 12.0])
def test_a_joint_that_goes_back_gets_least_far_if_it_is_stopped_at_once(a, most):
    reaction, least, hardest = 0.05, 2.0, max(a, most)
    for v, driven in (
        (-1.0, -0.2),
        (-0.4, -0.1),
        (-1.6, 0.0),
        (-0.4, 1.0),
        (-2.0, 1.0),
    ):
        stop = stop_of(v, 2.0, a, reaction, 0.02, least, most, driven=driven)
        # Its operator may turn it round before the stop takes effect.
        turned = max(v, min(v + a * reaction, driven)) > 0.0
        assert (stop.opposite_speed > 0.0) == (not turned)
        if turned:
            continue
        # The moment the stop takes effect ends a step, and begins the next.
        before, after = (
            np.linspace(0.0, reaction, 5000),
            np.linspace(reaction, 2.0, 20_000),
        )
        times = np.concatenate([before, after])
        brakes = np.concatenate([hardest + 0.0 * before, most + 0.0 * after])
        speeds = np.maximum(-v - integral(times, brakes), 0.0)
        ways = integral(times, speeds)
        assert np.allclose(curve(times, stop), -ways, atol=1e-5)


def test_a_measured_stop_is_at_full_speed_until_its_way_is_used_up():
    rng = np.random.default_rng(2)
    top, reaction, a = 2.0, 0.02, 5.0
    table = np.sort(rng.uniform(0.1, 1.0, 2 * CURVE_POINTS).reshape(2, -1)).ravel()
    places = np.arange(CURVE_POINTS) / (CURVE_POINTS - 1)
    for v in (0.0, 0.03, 0.77, 1.9, 2.0, 2.6):
        begins = min(v + a * reaction, max(v, top))
        share = begins / top
        over = max(share, 1.0)
        time = over * np.interp(share, places, table[:CURVE_POINTS])
        way = over**2 * np.interp(share, places, table[CURVE_POINTS:])
        stop = stop_of(v, top, a, reaction, 0.0, 3.0, inf, 0.5, table)
        _, _, ways = worst(v, top, a, reaction, 0.0, 0.0, 3.0)
        first = ways[STEPS - 1]
        assert stop.rest_time == pytest.approx(reaction + time)
        assert stop.travel == pytest.approx(first + way, abs=STEP_ERROR)
        assert stop.swing == 0.0
        assert stop.swing_back == -inf
        after = np.linspace(reaction, reaction + 1.2 * time, 50)
        known = first + np.minimum(begins * np.minimum(after - reaction, time), way)
        assert np.allclose(curve(after, stop), known, atol=STEP_ERROR)


@pytest.mark.parametrize("ramp", [0.0, 0.05])
def test_a_swing_on_is_left_out_only_where_no_joint_that_rests_is_as_far(ramp):
    rng = np.random.default_rng(3)
    left_out = 0
    for _ in range(300):
        v, least = rng.uniform(0.3, 1.5), rng.uniform(0.5, 4.0)
        settle, reaction = rng.choice([0.002, 0.02, 0.2]), 0.02
        # What goes on this way swings back from the other side: no farther than now.
        stop = stop_of(v, 1.5, 1e-9, reaction, ramp, least, inf, settle)
        swing = settle * v / 1.5
        start, end = np.sort(rng.uniform(0.0, 1.2 * stop.settled, 2))
        found = swing_left(start, end, stop)
        assert found[0] == found[1]
        assert found[0] in (0.0, pytest.approx(swing))
        if start >= stop.settled:
            assert found[0] == 0.0
            continue
        # Of two that rest at the same time the one whose deceleration rises later is
        # farther; of two with the same ramp the one that brakes less.
        times = np.linspace(start, end, 40)
        since = times - reaction
        rest = v * reaction + 0.5 * v * (since + ramp)
        farther = curve(times, stop) >= rest + swing - 1e-12
        known = start >= reaction and end <= stop.rest_time and farther.all()
        assert (found[0] == 0.0) == known
        left_out += found[0] == 0.0
    assert left_out > 20


def test_a_swing_back_is_reached_at_every_time_until_it_has_settled():
    rng, back, kept = np.random.default_rng(6), 0, 0
    for _ in range(200):
        v, least = rng.uniform(-0.5, 0.5), rng.uniform(1.0, 4.0)
        settle = rng.choice([0.02, 0.2, 0.5])
        stop = stop_of(
            v, 1.5, 4.0, 0.03, 0.02, least, 6.0 * least, settle, against=0.1 - v
        )
        start, end = np.sort(rng.uniform(0.0, 1.2 * stop.settled, 2))
        ends = curve(np.array([start, end]), stop)
        found = np.array(swing_left(start, end, stop))
        if start >= stop.settled:
            assert not found.any()
            continue
        assert (ends + found >= np.maximum(ends, stop.swing_back) - 1e-12).all()
        # It leads no farther than that, or than the farthest and a swing on.
        most = np.maximum(ends + stop.swing, stop.swing_back)
        assert (ends + found <= most + 1e-12).all()
        back += (stop.swing_back > ends + stop.swing).any()
        kept += (stop.swing_back < ends).all()
    assert back > 20
    assert kept > 20


@pytest.mark.parametrize("ramp", [0.0, 0.05, 0.3])
def test_the_speed_a_stop_has_taken_away_is_the_integral_of_its_deceleration(ramp):
    times = np.linspace(-0.1, 0.6, 7001)
    brake = np.clip(times / ramp, 0.0, 1.0) if ramp > 0.0 else 1.0 * (times > 0.0)
    known = integral(times, 2.5 * brake)
    assert np.allclose(speeds_lost(times, ramp, 2.5), known, atol=2e-4)
    assert (speeds_lost(times[times <= 0.0], ramp, 2.5) == 0.0).all()
