"""Frames of every kind of sensor, from the gate into the map."""

import numpy as np
import pytest

import armguard as ag
from armguard.errors import RefusedError
from armguard.sense import Intake
from armguard.service.client.sensors import SensorClient
from armguard.service.mapping.gate import SentFrame
from armguard.service.mapping.process import take_frames, try_out

VALUES = {
    "depth": np.full(48, 900, dtype=np.uint16),
    "tof": np.full(64, 0.3, dtype=np.float32),
    "points": np.array([[0.0, 0.0, 0.9]] * 20, dtype=np.float32),
    "range": np.array([np.inf], dtype=np.float32),
    "infrared": np.array([0.2], dtype=np.float32),
    "capacitive": np.array([0.01], dtype=np.float32),
}


def scene_of(kind):
    """A Panda with one sensor."""
    scene = ag.Scene()
    scene.add_robot("panda", "arm")
    scene.set_sensing(
        region={"centre": (0, 0, 0.5)}, unknown="still",
        intruder={"speed": 0.0, "size": 0.05},
    )  # fmt: skip
    more = {
        "depth": {"size": (8, 6), "focal": 8.0},
        "points": {"spacing": 0.01},
    }.get(kind, {})
    scene.add_sensor("eye", kind=kind, pose=ag.Pose(xyz=(0.8, 0, 1.2)), **more)
    return scene


class Waiting:
    """A receiver with frames that wait."""

    def __init__(self, frames):
        self.frames = frames

    def next(self, newest, read):
        return self.frames.pop(0) if self.frames else None


@pytest.mark.parametrize("kind", VALUES)
def test_a_frame_of_each_kind_reaches_the_map(kind):
    scene = scene_of(kind)
    try_out(scene)
    sense = ag.Sense(scene)
    for k in range(100):
        sense.joints(scene.home, 0.01 * k)
    sent = SentFrame("eye", VALUES[kind], None, 0.9, 0)
    take_frames(sense, Waiting([sent]), 1.0, 0)
    assert dict(sense.intakes) == {Intake.TAKEN: 101}


def test_values_that_are_no_floats_are_refused_before_they_are_sent():
    client = SensorClient(port=1)
    for values in ([1, 2, 3], "near", [None]):
        with pytest.raises(RefusedError, match="must be"):
            client.frame("eye", values, 0.0)
