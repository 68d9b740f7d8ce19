"""Refused inputs: stops are ordered by the clock of their own cycle."""

import numpy as np
import pytest

from armguard.guard import Level, Reason
from armguard.guard.watch import RUNNING, STOPPING
from sliding import EXACT, let_go, motion_of, rest_of, slides

PERIOD = 1e-3
SPEED = 1.0

# Figures of a slide whose speed alone shows that its stop was ordered too early.
FIGURES = {"command": 0.004, "deceleration": 4.0, "sensing": 0.002, "stale": 0.02}


def still(q, v, stamp, now):
    """Nothing is wrong."""
    return q, stamp, v, now


# What becomes of position, velocity, stamp and time in one cycle, and the reason.
REFUSED = {
    "position is NaN": (lambda q, v, t, now: ([np.nan], t, v, now), Reason.NOT_FINITE),
    "no position": (lambda q, v, t, now: ([], t, v, now), Reason.WRONG_INPUT),
    "words": (lambda q, v, t, now: ("here", t, v, now), Reason.WRONG_INPUT),
    "velocity is NaN": (
        lambda q, v, t, now: (q, t, [np.nan], now),
        Reason.NOT_FINITE,
    ),
    "no velocity": (lambda q, v, t, now: (q, t, [], now), Reason.WRONG_INPUT),
    "velocity of 9": (lambda q, v, t, now: (q, t, [9.0], now), Reason.TOO_FAST),
    "a jump": (lambda q, v, t, now: ([q[0] + 1.0], t, v, now), Reason.STATE_JUMPED),
    "outside its limits": (
        lambda q, v, t, now: ([60.0], t, v, now),
        Reason.STATE_JUMPED,
    ),
    "no stamp": (lambda q, v, t, now: (q, None, v, now), Reason.STAMP_MISSING),
    "stamp ahead": (lambda q, v, t, now: (q, t + 5.0, v, now), Reason.STAMP_AHEAD),
    "stamp back": (lambda q, v, t, now: (q, t - 5.0, v, now), Reason.TIME_BACKWARDS),
    "stamp of words": (lambda q, v, t, now: (q, "now", v, now), Reason.WRONG_INPUT),
    "time back": (lambda q, v, t, now: (q, t, v, now - 5.0), Reason.TIME_BACKWARDS),
    "time ahead": (lambda q, v, t, now: (q, t, v, now + 5.0), Reason.STATE_STALE),
    "time infinite": (lambda q, v, t, now: (q, t, v, np.inf), Reason.STAMP_MISSING),
}

# Whose clock is believed in the cycle itself.
BELIEVED = (
    "position is NaN",
    "no position",
    "words",
    "velocity is NaN",
    "no velocity",
    "velocity of 9",
    "a jump",
    "outside its limits",
    "no stamp",
    "stamp back",
)


def run(case, age=0.001, begin=5.0):
    """A slide that goes evenly, is refused once, and stops exactly as declared.

    Returns:
        The guard, the verdict of the refused cycle, its time, and later verdicts.
    """
    guard = slides(FIGURES, period=PERIOD)
    change, _ = REFUSED[case]
    let_go(guard)
    fault = 40

    order = begin + fault * PERIOD
    times, speeds, ways = motion_of(FIGURES, SPEED, 0.0, FIGURES["command"])
    end = fault + int(rest_of(times, speeds) / PERIOD) + 20
    refused, later = None, []
    for k in range(end):
        now = begin + k * PERIOD
        since = now - age - order
        way = np.interp(since, times, ways) if since > 0.0 else SPEED * since
        speed = np.interp(since, times, speeds) if since > 0.0 else SPEED
        given = [way - 20.0], [speed], now - age, now
        q, stamp, v, time = (change if k == fault else still)(*given)
        verdict = guard.step(q, stamp, velocity=v, now=time)
        if k == fault:
            refused = verdict, guard._watch.ordered[0]
        elif k > fault:
            later.append(verdict)
    return guard, refused, order, later


@pytest.mark.parametrize("case", REFUSED)
def test_a_slide_that_stops_as_declared_is_never_disproved(case):
    guard, (verdict, ordered), time, later = run(case)
    assert verdict.reason is REFUSED[case][1]
    assert verdict.level is Level.STOP
    # Known at once, or as soon as a time is believed again; never before the truth.
    assert ordered == (time if case in BELIEVED else np.inf)
    assert time <= guard._watch.ordered[0] <= time + 2.0 * PERIOD
    assert max(v.level for v in later) <= Level.STOP
    assert not guard._watch.disproved.any()


def test_one_that_stops_a_little_later_than_declared_is_disproved():
    guard = slides(FIGURES, period=PERIOD)
    let_go(guard)
    times, speeds, ways = motion_of(FIGURES, SPEED, 0.0, 1.3 * FIGURES["command"])
    levels = []
    for k in range(400):
        now, since = 5.0 + k * PERIOD, (k - 40) * PERIOD
        way = np.interp(since, times, ways) if since > 0.0 else SPEED * since
        speed = np.interp(since, times, speeds) if since > 0.0 else SPEED
        q = [np.nan] if k == 40 else [way - 20.0]
        levels.append(guard.step(q, now, velocity=[speed], now=now).level)
    assert Level.BRAKE in levels
    assert guard._watch.disproved.any()


def test_a_stop_is_planned_from_the_refused_cycle_on_and_not_a_period_short():
    guard = slides(FIGURES, period=PERIOD)
    let_go(guard)
    for k in range(2):
        now = 5.0 + k * PERIOD
        guard.step([k * PERIOD * SPEED], now, velocity=[SPEED], now=now)
    now = 5.0 + 2 * PERIOD
    guard.step([np.nan], now, velocity=[SPEED], now=now)
    assert guard._watch.phase[0] == STOPPING
    assert guard._watch.ordered[0] == now
    # The next cycle is in time: that one had its clock.
    verdict = guard.step(
        [3 * PERIOD * SPEED], now + PERIOD, velocity=[SPEED], now=now + PERIOD
    )
    assert verdict.reason is Reason.STOPPING
    need = verdict.nearest
    assert need is None or need.headroom > 0.0


def test_a_time_far_ahead_does_not_hold_the_cycles_after_it():
    guard, _, _, later = run("time ahead")
    assert later[0].reason is Reason.CYCLE_LATE
    assert all(v.reason is not Reason.TIME_BACKWARDS for v in later)
    assert guard._watch.phase[0] != RUNNING or later[-1].level < Level.STOP


def test_sensing_may_jitter_where_no_time_is_given_and_no_cycle_is_late():
    figures = {**EXACT, "sensing": 0.004, "stale": 0.05}
    guard = slides(figures, period=PERIOD)
    rng = np.random.default_rng(3)
    let_go(guard)
    stamp, reasons = 0.0, set()
    for k in range(1, 2000):
        # As late as it may be, but after the one before.
        now = 5.0 + k * PERIOD
        stamp = max(now - rng.uniform(0.0, figures["sensing"]), stamp + 1e-6)
        reasons.add(guard.step([0.0], stamp, velocity=[0.0]).reason)
    assert Reason.CYCLE_LATE not in reasons
    late = guard.step([0.0], stamp + PERIOD + 0.0041, velocity=[0.0])
    assert late.reason is Reason.CYCLE_LATE
