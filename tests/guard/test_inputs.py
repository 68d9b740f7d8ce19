"""Wrong inputs where stops are predicted: each a stop, with its reason and a name."""

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.geometry import Pose, Sphere
from armguard.guard import Level, Reason
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm

STILL = np.zeros(4)
ROBOTS = ("left", "right")


def two_arms(**ball):
    """Two arms far from each other, and perhaps an object far from both."""
    scene = Scene()
    for name, x in (("left", 0.0), ("right", 5.0)):
        scene.add_robot(
            simple_arm(joints=2),
            name=name,
            base=Pose(xyz=(x, 0, 0)),
            stopping={**FIGURES, "stale": 0.010},
        )
    if ball:
        scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0, 9, 0)), **ball)
    return Guard(scene)


def stamps(left, right):
    """Stamps by robot."""
    return {"left": left, "right": right}


@pytest.fixture
def guard():
    """A guard of two arms that have stood still for two cycles."""
    guard = two_arms()
    for k in range(2):
        verdict = guard.step(STILL, k * PERIOD, velocity=STILL)
    assert verdict.level is Level.CLEAR
    return guard


NOW = 2 * PERIOD
AHEAD = NOW + 0.0005

# What is given, which reason that must lead to, and what its sentence must hold. A name
# of the left robot replaces one of the right where the guard is known to mistake it.
CASES = {
    "no stamp at all": (
        {"stamp": None},
        Reason.STAMP_MISSING,
        "'left': stop, no finite stamp; pass the time of the measurement",
    ),
    "a robot's stamp missing": (
        {"stamp": {"left": NOW}},
        Reason.STAMP_MISSING,
        "'right': stop, no finite stamp; pass the time of the measurement",
    ),
    "a stamp that is NaN": (
        {"stamp": stamps(np.nan, NOW)},
        Reason.STAMP_MISSING,
        "'left': stop, no finite stamp; pass the time of the measurement",
    ),
    "a cycle at the time of the last": (
        {"stamp": PERIOD},
        Reason.TIME_STILL,
        "stop: the time of the cycle did not advance; check the clock",
    ),
    "time that goes back": (
        {"stamp": 0.5 * PERIOD},
        Reason.TIME_BACKWARDS,
        "stop: a stamp is older than the one before; check the clocks",
    ),
    "one robot's stamp that goes back": (
        {"stamp": stamps(NOW, 0.5 * PERIOD), "now": NOW},
        Reason.TIME_BACKWARDS,
        "'right': stop, a stamp is older than the one before; check the clocks",
    ),
    "a stamp ahead": (
        {"stamp": stamps(NOW, AHEAD), "now": NOW},
        Reason.STAMP_AHEAD,
        "'right': stop, a stamp is later than the cycle; synchronise the clocks (0.5",
    ),
    "an old measurement": (
        {"stamp": stamps(0.012, PERIOD), "now": 0.012},
        Reason.STATE_STALE,
        "'right': stop, the measurement is older than its limit; check sensor, network "
        "(11.0 ms)",
    ),
    "a late cycle": (
        {"stamp": 0.008},
        Reason.CYCLE_LATE,
        "stop: 7.0 ms since the last cycle, but the scene declares period 1.0 ms",
    ),
    "a jump": (
        {"q": [0.0, 0.0, 0.0, 0.1]},
        Reason.STATE_JUMPED,
        "joint 'right/joint2' at 100.00 a second: stop, the position jumped farther",
    ),
    "a velocity that is too high": (
        {"velocity": [0.0, 0.0, -2.5, 0.0]},
        Reason.TOO_FAST,
        "joint 'right/joint1' at -2.50 a second: stop, the joint is faster than its",
    ),
    "a velocity that is NaN": (
        {"velocity": [0.0, np.nan, 0.0, 0.0]},
        Reason.NOT_FINITE,
        "joint 'left/joint2' is at nan: stop, it must be finite",
    ),
    "velocities of another length": (
        {"velocity": [0.0, 0.0]},
        Reason.WRONG_INPUT,
        "stop: velocity has shape (2,); it must be 4 numbers",
    ),
    "positions of another length": (
        {"q": [0.0]},
        Reason.WRONG_INPUT,
        "stop: q has shape (1,); it must be 4 numbers",
    ),
    "a position that is infinite": (
        {"q": [0.0, 0.0, np.inf, 0.0]},
        Reason.NOT_FINITE,
        "joint 'right/joint1' is at inf: stop, it must be finite",
    ),
    "a position outside the limits": (
        {"q": [0.0, 0.0, 0.0, 2.0002]},
        Reason.OUT_OF_LIMITS,
        "joint 'right/joint2' is at 2.0002: stop, its limits are [-2.0000, 2.0000]",
    ),
    "a stamp of an unknown robot": (
        {"stamp": {"left": NOW, "right": NOW, "lift": NOW}},
        Reason.WRONG_INPUT,
        "stop: there is a stamp for 'lift', no robot; known names are 'left', 'right'",
    ),
    "a stamp that is no number": (
        {"stamp": "now"},
        Reason.WRONG_INPUT,
        "stop: stamp is 'now' and now is None; they must be numbers [s]",
    ),
}


def test_the_guard_is_at_rest_before(guard):
    assert guard.step(STILL, NOW, velocity=STILL).level is Level.CLEAR


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_input_is_a_stop_with_its_own_reason(guard, case):
    given, reason, _ = CASES[case]
    if case in ("a jump", "a position outside the limits"):
        # Near enough to the limits for both.
        prepare_at_limit(guard, given["q"], case)
    verdict = give(guard, given)
    assert verdict.reason is reason
    assert verdict.level is Level.STOP
    assert set(verdict.levels.values()) == {Level.STOP}
    assert set(verdict.speed_scale.values()) == {0.0}


def prepare_at_limit(guard, q, case):
    """Stand just inside the limits, where they are what is tested."""
    if case == "a position outside the limits":
        guard.reset()
        for k in range(2):
            # As far as its error explains both that and what comes.
            guard.step([*q[:3], 2.00005], k * PERIOD, velocity=STILL)


@pytest.mark.parametrize("case", CASES)
def test_its_sentence_names_what_it_is_about(guard, case):
    given, _, says = CASES[case]
    prepare_at_limit(guard, given.get("q"), case)
    verdict = give(guard, given)
    assert says in verdict.why
    named = [name for name in ROBOTS if name in says]
    if named:
        assert verdict.subject.split("/")[0] in (named[0], "")


def give(guard, given):
    """A cycle with one wrong input."""
    whole = {"q": STILL, "stamp": NOW, "velocity": STILL, **given}
    return guard.step(
        whole["q"], whole["stamp"], velocity=whole["velocity"], now=whole.get("now")
    )


def test_without_velocities_the_first_sample_is_a_stop_and_the_next_ones_are_not():
    guard = two_arms()
    verdict = guard.step(STILL, 0.0)
    assert verdict.reason is Reason.NO_VELOCITY
    assert verdict.level >= Level.STOP
    assert "'left': stopped, no velocity from a single sample; send" in verdict.why
    levels = [guard.step(STILL, k * PERIOD).level for k in range(1, 40)]
    assert levels[-1] < Level.STOP


def test_an_object_that_was_never_seen_is_a_stop_and_named():
    guard = two_arms(top_speed=0.5)
    verdict = guard.step(STILL, 0.0, velocity=STILL)
    assert verdict.reason is Reason.OBJECT_UNSEEN
    assert verdict.level >= Level.STOP
    assert verdict.why.startswith("'ball': stopped, the moving object was never")
    assert verdict.subject == "ball"


def test_an_object_that_is_not_there_need_not_be_seen():
    guard = two_arms(top_speed=0.5, present=False)
    verdict = guard.step(STILL, 0.0, velocity=STILL)
    assert verdict.reason is not Reason.OBJECT_UNSEEN


@pytest.mark.parametrize("case", CASES)
def test_causes_name_the_reason_later_too(guard, case):
    given, reason, _ = CASES[case]
    prepare_at_limit(guard, given.get("q"), case)
    verdict = give(guard, given)
    assert set(verdict.causes.values()) == {reason}
    later = guard.step(STILL, 0.02, velocity=STILL)
    assert later.causes.keys() == {"left", "right"}
