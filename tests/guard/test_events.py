"""Events: what a run reports."""

import numpy as np
import pytest

from armguard.geometry import Pose, Sphere
from armguard.guard import EventLog, Level, Reason
from armguard.guard.events import Event
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm


def log_of(angles, step=None):
    """Events of an arm between two balls; with a step [s] its cycles have stamps."""
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    for name, y in (("up", 0.5), ("down", -0.5)):
        scene.add(Sphere(radius=0.1), name=name, pose=Pose(xyz=(0.5, y, 0.2)))
    guard, log = Guard(scene), EventLog()
    ended = []
    for k, a in enumerate(angles):
        event = log.add(guard.step(np.array([a]), None if step is None else k * step))
        ended += [] if event is None else [event]
    return log, ended


def test_each_level_of_an_approach_without_stamps_is_an_event_with_its_worst_cycle():
    angles = np.concatenate([np.linspace(0, 0.6, 61), np.linspace(0.6, 0, 61)])
    log, ended = log_of(angles)
    assert [e.level for e in log.events] == [Level.CAUTION, Level.STOP, Level.CAUTION]
    stop = log.events[1]
    assert (stop.a, stop.b) == ("arm/link1", "up")
    assert stop.at in (60, 61)
    assert stop.least_headroom == log.least_headroom < 0.0
    assert np.isnan(stop.seconds)
    assert ended == log.events and log.open is None
    assert sum(e.last - e.first + 1 for e in ended) == 122 - log.levels[Level.CLEAR]


def test_two_sides_are_two_events_and_a_fault_is_a_third():
    log, _ = log_of([0.0, 0.6, 0.0, -0.6, 0.0, float("nan"), 0.0])
    assert [e.b for e in log.events] == ["up", "down", ""]
    assert log.events[2].reason is Reason.NOT_FINITE
    assert log.events[2].to_dict()["least_headroom"] is None
    assert log.faults == 1


def test_pairs_that_alternate_are_one_event_with_the_worst_pair_and_its_duration():
    sides = [0.55, -0.6] * 100
    log, ended = log_of([0.0, *sides, *[0.0] * 60], step=0.01)
    (event,) = ended
    assert (event.level, event.b) == (Level.STOP, "down")
    assert (event.first, event.last) == (1, 200)
    assert event.seconds == pytest.approx(1.99)
    assert log.open is None


def test_an_event_goes_on_over_a_short_time_below_its_level_and_ends_after_a_long_one():
    near, away = [0.6] * 10, [0.0]
    log, ended = log_of([*near, *away * 4, *near, *away * 8, *near], step=0.1)
    assert [(e.first, e.last) for e in log.events] == [(0, 23), (32, 41)]
    assert ended == log.events[:1] and log.open is log.events[1]
    assert log.finish() is log.events[1] and log.open is None


def test_a_young_event_is_raised_and_an_old_one_ends_where_the_level_rises():
    caution = 0.53
    log, _ = log_of([*[caution] * 2, *[0.6] * 20], step=0.1)
    assert [e.level for e in log.events] == [Level.STOP]
    assert log.events[0].first == 0
    log, ended = log_of([*[caution] * 10, *[0.6] * 20], step=0.1)
    assert [e.level for e in log.events] == [Level.CAUTION, Level.STOP]
    assert ended == log.events[:1] and ended[0].last == 9
    log, ended = log_of([*[0.6] * 10, *[caution] * 20], step=0.1)
    assert [(e.level, e.first) for e in log.events] == [
        (Level.STOP, 0),
        (Level.CAUTION, 10),
    ]


def test_the_worst_of_equal_levels_is_kept_and_a_rest_is_not_worse_than_its_stop():
    stop = event_at(Level.STOP, Reason.TOO_CLOSE, -0.001)
    stop.absorb(event_at(Level.STOP, Reason.STOPPING, -0.002))
    assert (stop.reason, stop.least_headroom) == (Reason.TOO_CLOSE, -0.002)
    stop.absorb(event_at(Level.RECOVER, Reason.RESTING, -0.001))
    assert (stop.level, stop.reason) == (Level.STOP, Reason.TOO_CLOSE)
    stop.absorb(event_at(Level.BRAKE, Reason.STOP_LAGS, float("nan")))
    assert (stop.level, stop.reason) == (Level.BRAKE, Reason.STOP_LAGS)
    late = event_at(Level.STOP, Reason.CYCLE_LATE, float("nan"))
    late.absorb(event_at(Level.STOP, Reason.STOPPING, -0.001))
    assert late.reason is Reason.CYCLE_LATE and np.isnan(late.least_headroom)


def event_at(level, reason, headroom):
    """An event of one cycle."""
    return Event(0, 0, 0.0, 0.0, level, reason, "a", "b", headroom, 0.0, 0, 0.0, "")
