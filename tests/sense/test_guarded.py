"""A guard that is fed by sensors: what they see is in its next verdict."""

import numpy as np

import armguard as ag
from armguard.scene.sensing import SENSED
from armguard.simulation.sensed import drive, sensed_bay
from armguard.simulation.sensors import Rig


def test_a_box_that_a_camera_sees_is_in_the_next_verdict():
    scene = sensed_bay(zones=False, unknown="free", reason="a closed cell")
    scene.set_margin(0.25)
    guard = ag.Guard(scene, self_test=False)
    sense, rig = ag.Sense(scene, guard), Rig(scene, boxes=[(0.1, 0.1, 0.1)])
    still = np.zeros(len(scene.home))

    def sensed(verdict):
        return [pair for pair in verdict.near if SENSED in (pair.a, pair.b)]

    def verdict(t):
        return guard.step(scene.home, t, velocity=still)

    tip = guard.tables.links["left/link7"].body
    verdict(0.0)
    beside = guard.poses[tip].reshape(3, 4)[:, 3] - [0.0, 0.2, 0.0]
    drive(sense, rig, lambda t: scene.home, 0.3)
    assert not sensed(verdict(0.3))
    rig.place(0, ag.Pose(xyz=beside.tolist()))
    drive(sense, rig, lambda t: scene.home, 0.2, start=0.3)
    seen = sensed(verdict(0.5))
    assert {"left/link7"} < {body for pair in seen for body in (pair.a, pair.b)}
    # The face of the box is 0.15 m from the middle of the link.
    assert 0.03 < min(pair.distance for pair in seen) < 0.15
    age = 0.5 - sense.stamp
    assert age < 0.11
    assert all(pair.sensed is not None for pair in seen)
