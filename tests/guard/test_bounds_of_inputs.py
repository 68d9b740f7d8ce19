"""Inputs just inside what is declared are believed, and those just outside are not."""

import re

import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.guard import Level, Reason
from armguard.guard.watch import RUNNING
from armguard.respond import Guard
from armguard.scene import Scene
from sliding import APART, EXACT, at_gap, let_go, slide, slides, worst_stop

# How far inside and outside a bound an input is [-].
SHARE = 0.01

PERIOD = 0.01

# What a measured speed may exceed the declared one by [-].
SPEED_SHARE = 1.02


@pytest.mark.parametrize("error", [0.0, 0.02])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_jump_is_what_no_slide_can_do_between_two_measurements(sign, error):
    guard = slides({"position_error": error}, period=PERIOD)
    most = SPEED_SHARE * EXACT["velocity"] * PERIOD + 2.0 * error
    for share in (1.0 - SHARE, 1.0 + SHARE):
        let_go(guard)
        guard.step([0.0], 5.0, velocity=[0.0], now=5.0)
        place = sign * share * most
        verdict = guard.step(
            [place], 5.0 + PERIOD, velocity=[sign * 2.0], now=5.0 + PERIOD
        )
        assert (verdict.reason is Reason.STATE_JUMPED) == (share > 1.0)


@pytest.mark.parametrize("late", [0.0, 0.005])
def test_a_cycle_is_late_after_its_period_and_what_it_may_be_late(late):
    guard = slides({}, period=PERIOD, late=late)
    for share in (1.0 - SHARE, 1.0 + SHARE):
        let_go(guard)
        guard.step([0.0], 5.0, velocity=[0.0], now=5.0)
        time = 5.0 + share * (PERIOD + late)
        verdict = guard.step([0.0], time, velocity=[0.0], now=time)
        assert (verdict.reason is Reason.CYCLE_LATE) == (share > 1.0)


def test_a_measurement_is_too_old_as_soon_as_it_is_declared_to_be():
    guard = slides({"stale": 0.1}, period=PERIOD)
    for share in (1.0 - SHARE, 1.0 + SHARE):
        let_go(guard)
        verdict = guard.step([0.0], 5.0 - share * 0.1, velocity=[0.0], now=5.0)
        assert (verdict.reason is Reason.STATE_STALE) == (share > 1.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_slide_is_too_fast_beyond_its_top_speed_and_errors(sign):
    error = 0.1
    guard = slides({"velocity_error": error}, period=PERIOD)
    most = SPEED_SHARE * EXACT["velocity"] + 3.0 * error
    for share in (1.0 - SHARE, 1.0 + SHARE):
        let_go(guard)
        verdict = guard.step([0.0], 5.0, velocity=[sign * share * most], now=5.0)
        assert (verdict.reason is Reason.TOO_FAST) == (share > 1.0)


ESTIMATED = {
    "errors of two positions": {"position_error": 2e-3},
    "a change of its speed": {"acceleration": 50.0, "deceleration_most": 20.0},
    "a stop of its own": {"deceleration_most": 60.0},
}


@pytest.mark.parametrize("case", ESTIMATED)
def test_a_velocity_that_is_estimated_is_as_great_as_it_can_be(case):
    figures = {"command": 0.1, **ESTIMATED[case]}
    f = {**EXACT, **figures}
    guard = slides(figures, period=PERIOD)
    mean = 0.2
    gain = max(f["acceleration"], f["deceleration_most"])
    speed = mean + 2.0 * f["position_error"] / PERIOD + 0.5 * gain * PERIOD
    need, _ = worst_stop(figures, speed, figures["command"] + PERIOD)
    for share in (1.0 - SHARE, 1.0 + SHARE):
        (place,) = at_gap(share * need)
        let_go(guard)
        guard.step([place - mean * PERIOD], 5.0, now=5.0)
        guard._watch.phase[:] = RUNNING
        verdict = guard.step([place], 5.0 + PERIOD, now=5.0 + PERIOD)
        assert (verdict.level >= Level.STOP) == (share < 1.0)
        slack = (share - 1.0) * need
        assert verdict.nearest.headroom == pytest.approx(slack, abs=1e-4)


def test_a_velocity_that_is_estimated_may_be_none_where_a_stop_may_be_of_any_hardness():
    guard = slides({"deceleration_most": np.inf}, period=PERIOD)
    for speed in (-0.5, 0.5):
        let_go(guard)
        guard.step([0.0], 5.0, now=5.0)
        guard.step([speed * PERIOD], 5.0 + PERIOD, now=5.0 + PERIOD)
        low, high = guard._motion.v_low[0], guard._motion.v_high[0]
        assert low <= min(speed, 0.0)
        assert high >= max(speed, 0.0)


def test_an_order_at_an_unknown_time_was_given_before_the_next_one_that_is_known():
    guard = slides({"stale": 0.1}, period=PERIOD)
    for stamp, reason in ((6.0, Reason.STAMP_AHEAD), (4.9, Reason.STATE_STALE)):
        let_go(guard)
        first, now, later = 4.995 + PERIOD * np.arange(3)
        guard.step([0.0], 4.9, velocity=[0.0], now=first)
        assert guard.step([0.0], stamp, velocity=[0.0], now=now).reason is reason
        known = reason is Reason.STATE_STALE
        assert guard._watch.ordered[0] == (now if known else np.inf)
        guard.step([0.0], later, velocity=[0.0], now=later)
        assert guard._watch.ordered[0] == (now if known else later)


@pytest.mark.parametrize(("speed", "known"), [(0.9, 1.0), (1.85, 1.95), (2.1, 2.0)])
def test_a_velocity_that_was_refused_may_be_true_for_the_stop_that_follows(
    speed, known
):
    guard = slides({"velocity_error": 0.1, "stale": 0.1}, period=PERIOD)
    for sign in (-1.0, 1.0):
        let_go(guard)
        guard.step([0.0], 5.0, velocity=[0.2 * sign], now=5.0)
        # It is said to be somewhere else by now.
        now = 5.0 + PERIOD
        verdict = guard.step([1.0], now, velocity=[speed * sign], now=now)
        assert verdict.reason is Reason.STATE_JUMPED
        assert guard._watch.fastest[0] == pytest.approx(known)


def test_after_a_jump_nothing_is_known_that_a_sample_could_contradict():
    guard = slides({}, period=PERIOD)
    let_go(guard)
    for k, place in enumerate((0.0, 1.0, 1.0, 1.0)):
        now = 5.0 + k * PERIOD
        verdict = guard.step([place], now, velocity=[0.0], now=now)
        assert (verdict.reason is Reason.STATE_JUMPED) == (k == 1)
        assert verdict.reason is not Reason.STATE_DISAGREES


@pytest.mark.parametrize("mode", ["path", "fixed"])
def test_a_time_that_leaps_is_believed_only_if_a_robot_that_is_predicted_agrees(mode):
    scene = Scene(buffer=0.0, margin=1.0, period=PERIOD)
    for name, x, own in (("left", 0.0, "path"), ("right", APART, mode)):
        base = Pose(xyz=(x, 0.0, 0.0))
        scene.add_robot(slide(), name=name, base=base, mode=own, stopping=EXACT)
    guard, still = Guard(scene, self_test=False), np.zeros(2)
    guard.step(still, 5.0, velocity=still, now=5.0)
    # The right one's stamp goes with it, the left one's does not.
    guard.step(still, {"left": 5.01, "right": 99.0}, velocity=still, now=99.0)
    verdict = guard.step(still, 5.02, velocity=still, now=5.02)
    assert (verdict.reason is Reason.TIME_BACKWARDS) == (mode == "path")


def test_positions_that_are_all_off_the_same_way_are_too_fast_together():
    error = 0.05
    guard = slides({"position_error": error}, period=PERIOD)
    let_go(guard)
    # Each of them for itself could be an error of two positions.
    way = 0.99 * (SPEED_SHARE * EXACT["velocity"] * PERIOD + 2.0 * error)
    for k in range(3):
        now = 5.0 + k * PERIOD
        verdict = guard.step([k * way], now, now=now)
        assert (verdict.reason is Reason.TOO_FAST) == (k == 2)
    said = float(re.search(r"at ([\d.]+) a second", verdict.why)[1])
    assert said == pytest.approx(way / PERIOD, abs=0.1)
