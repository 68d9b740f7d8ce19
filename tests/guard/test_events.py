"""Events: what a run reports."""

import numpy as np

from armguard.geometry import Pose, Sphere
from armguard.guard import EventLog, Level, Reason
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm


def log_of(angles):
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    for name, y in (("up", 0.5), ("down", -0.5)):
        scene.add(Sphere(radius=0.1), name=name, pose=Pose(xyz=(0.5, y, 0.2)))
    guard, log = Guard(scene), EventLog()
    opened = [log.add(guard.step(np.array([a]))) is not None for a in angles]
    return log, opened


def test_one_approach_is_one_event_with_its_worst_cycle():
    angles = np.concatenate([np.linspace(0, 0.6, 61), np.linspace(0.6, 0, 61)])
    log, opened = log_of(angles)
    (event,) = log.events
    assert (event.a, event.b, event.level) == ("arm/link1", "up", Level.STOP)
    assert event.at in (60, 61)
    assert sum(opened) == 2  # it opens as a caution and is raised to a stop
    assert log.levels[Level.CLEAR] + log.levels[Level.CAUTION] > 0
    assert sum(log.levels.values()) == 122


def test_two_sides_are_two_events_and_a_fault_is_a_third():
    log, _ = log_of([0.0, 0.6, 0.0, -0.6, 0.0, float("nan"), 0.0])
    assert [e.b for e in log.events] == ["up", "down", ""]
    assert log.events[2].reason is Reason.NOT_FINITE
    assert log.events[2].to_dict()["least_clearance"] is None
    assert log.faults == 1
