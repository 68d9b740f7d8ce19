"""Health of sensors as the map reports it."""

from types import SimpleNamespace

import numpy as np
import pytest

import armguard as ag
from armguard.sense import Fault
from armguard.service.mapping.process import health_of
from armguard.service.wire.sensing import HEALTH, MOST_ROWS, SENSOR


@pytest.fixture
def sense():
    scene = ag.bay_scene("path")
    scene.set_sensing(
        region={"centre": (-0.4, 0, 1.1), "size": 128}, cell=0.025, unknown="still",
        intruder={"speed": 1.6, "size": 0.05},
    )  # fmt: skip
    ring = {"count": 32, "radius": 0.1}
    for name in ("left", "right"):
        scene.add_sensor(f"{name}_ring", kind="tof", on=f"{name}/link5", ring=ring)
    sense = ag.Sense(scene)
    for k in range(12):
        sense.joints(scene.home, 0.01 * k)
    return sense


def test_frames_and_messages_are_counted_and_faults_are_bits(sense):
    near = np.full((8, 8), 0.3)
    assert sense.zones("left_ring/0", near, None, 0.1).name == "TAKEN"
    assert sense.zones("left_ring/0", near, None, 0.1).name == "STAMP_BACK"
    assert sense.zones("left_ring/1", near[0], None, 0.1).name == "WRONG_SIZE"
    receiver = SimpleNamespace(dropped=7, port=4711)
    first, second = health_of(sense, receiver)
    head = HEALTH.unpack_from(first)
    assert (head.taken, head.dropped, head.port) == (1, 7 + 2, 4711)
    assert (head.first, head.rows, head.sensors) == (0, MOST_ROWS, 64)
    assert HEALTH.unpack_from(second)[-3:] == (MOST_ROWS, 64 - MOST_ROWS, 64)
    left, other, *rest = SENSOR.rows(first[HEALTH.size :])
    assert (left.taken, left.dropped, left.stamp) == (1, 1, 0.1)
    assert left.faults == 1 << Fault.STAMP_BACK and not left.frees
    assert other.faults == 1 << Fault.UNUSABLE
    assert left.words.startswith(b"STAMP_BACK: its stamps go back")
    assert rest[0].words.rstrip(b"\0") == b"no frame yet" and rest[0].stamp == -np.inf
