"""A guard that is fed by sensors: what they see is in its next verdict."""

import numpy as np

import armguard as ag
from armguard.scene.sensing import SENSED
from armguard.simulation.sensors import Rig
from sense_rig import bay, drive


def test_a_box_that_a_camera_sees_is_in_the_next_verdict():
    scene = bay(zones=False, unknown="free", reason="a closed cell")
    scene.set_margin(0.25)
    guard = ag.Guard(scene, self_test=False)
    sense, rig = ag.Sense(scene, guard), Rig(scene, boxes=[(0.1, 0.1, 0.1)])
    still = np.zeros(len(scene.home))

    def verdict(t):
        return guard.step(scene.home, t, velocity=still)

    tip = guard.tables.links["left/link7"].body
    verdict(0.0)
    beside = guard.poses[tip].reshape(3, 4)[:, 3] + [0.0, 0.25, 0.0]
    drive(sense, rig, scene, lambda t: scene.home, 0.3)
    clear = verdict(0.3).nearest
    assert clear is None or SENSED not in (clear.a, clear.b)
    rig.place(0, ag.Pose(xyz=beside.tolist()))
    drive(sense, rig, scene, lambda t: scene.home, 0.2, start=0.3)
    seen = verdict(0.5).nearest
    assert SENSED in (seen.a, seen.b)
    assert any(body.startswith("left/link") for body in (seen.a, seen.b))
    # The face of the box is 0.2 m from the middle of the link.
    assert 0.05 < seen.distance < 0.2
