"""The test a guard makes of itself: what it sees, what it refuses, what it leaves."""

import numpy as np
import pytest

from approach import PERIOD, ball_guard, ball_scene, moving_bay
from armguard.errors import SelfTestError
from armguard.geometry import Pose
from armguard.guard import Level, Reason
from armguard.guard.self_test import self_test
from armguard.respond import Guard
from arms import wall_scene
from grippers import guard_of, pick_scene


def words(report):
    """Statuses and sentences."""
    return [(line.status, line.sentence) for line in report.lines]


@pytest.mark.parametrize("scene", [ball_scene, moving_bay], ids=["ball", "bay"])
@pytest.mark.parametrize("mode", ["path", "speed"])
def test_a_sound_guard_walks_through_every_level(scene, mode):
    made = scene(mode) if scene is moving_bay else scene(settings={"mode": mode})
    (one, levels), (two, lags), (three, faults) = words(self_test(Guard(made)))
    assert one == two == three == "PASS"
    assert "SLOW, STOP, " in levels
    assert lags.endswith("STOP, BRAKE, HARDWARE_STOP")
    assert faults == "faults: a NaN, a late cycle, a stamp that goes back: STOP"


def test_a_brake_that_does_not_hold_is_noticed_at_every_period():
    self_test(Guard(moving_bay(period=0.030)))


def test_nothing_of_it_is_left():
    tested, untouched = Guard(moving_bay()), Guard(moving_bay(), self_test=False)
    self_test(tested)
    rng = np.random.default_rng(7)
    q = tested.home
    v = np.zeros_like(q)
    for k in range(400):
        if k == 200:
            # A stamp that goes back, so that orders and causes are compared too.
            args = (q, 0.0)
        else:
            v = np.clip(v + rng.normal(0.0, 0.004, q.shape), -1.0, 1.0)
            q = q + v * PERIOD
            args = (q, k * PERIOD)
        a = tested.step(*args, velocity=v)
        b = untouched.step(*args, velocity=v)
        assert a.tobytes() == b.tobytes(), k
    assert a.level >= Level.CLEAR


def test_a_running_guard_is_left_as_it_was():
    one, other = ball_guard(), ball_guard()
    for guard in (one, other):
        guard.step([-1.0], 0.0, velocity=[0.0])
        guard.step([np.nan], PERIOD, velocity=[0.0])
    self_test(one)
    a = one.step([-1.0], 2 * PERIOD, velocity=[0.0])
    b = other.step([-1.0], 2 * PERIOD, velocity=[0.0])
    assert a.tobytes() == b.tobytes()


def test_intents_are_read_after_it_where_there_is_a_gripper():
    guard = guard_of(pick_scene())
    self_test(guard)
    assert guard._settings.intents == 1


def test_where_nothing_can_be_approached_that_part_is_skipped():
    scene = ball_scene()
    scene.allow("arm/link1", "ball", reason="for a test")
    report = self_test(Guard(scene))
    assert [line.status for line in report.lines] == ["SKIP", "SKIP", "PASS"]
    assert "no pair can be approached" in report.lines[0].sentence


def test_where_no_stops_are_predicted_there_is_nothing_to_test():
    assert words(self_test(Guard(wall_scene()))) == [("SKIP", "no stops are predicted")]


def test_objects_that_move_stay_unseen():
    guard = ball_guard(ball={"top_speed": 0.1})
    assert {line.status for line in self_test(guard).lines} == {"PASS"}
    assert guard.step([-1.0], 0.0, velocity=[0.0]).reason is Reason.OBJECT_UNSEEN
    guard.place("ball", Pose(xyz=(0.5, 0.5, 0.2)), stamp=0.0)
    assert guard.step([-1.0], PERIOD, velocity=[0.0]).level < Level.STOP


class Blind(Guard):
    """Judges poses as if nothing moved."""

    def step(self, q, stamp=None, *, velocity=None, now=None):
        """A verdict without levels."""
        return self.judge_at_rest(q)


class Deaf(Guard):
    """Takes nothing for something."""

    def step(self, q, stamp=None, *, velocity=None, now=None):
        """A verdict of numbers that are finite."""
        return super().step(np.nan_to_num(q), stamp, velocity=velocity, now=now)


class Timeless(Guard):
    """Counts its own cycles."""

    def step(self, q, stamp=None, *, velocity=None, now=None):
        """A verdict in which no cycle is late."""
        self.cycle = getattr(self, "cycle", 0) + 1
        return super().step(q, self.cycle * PERIOD, velocity=velocity, now=now)


class Trusting(Guard):
    """Believes that every arm stops."""

    def step(self, q, stamp=None, *, velocity=None, now=None):
        """A verdict that forgets what was ordered."""
        verdict = super().step(q, stamp, velocity=velocity, now=now)
        if verdict.level >= Level.BRAKE:
            self.reset()
            return super().step(q, stamp, velocity=velocity, now=now)
        return verdict


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (Blind, "met something without a stop: arm/link1 overlaps ball"),
        (Deaf, "a NaN was answered by"),
        (Timeless, "BRAKE and HARDWARE_STOP must follow|a late cycle was answered by"),
        (Trusting, "BRAKE and HARDWARE_STOP must follow"),
    ],
)
def test_a_guard_that_does_not_guard_is_not_armed(kind, says):
    with pytest.raises(SelfTestError, match=says):
        self_test(kind(ball_scene()))
