"""What a judge knows between its guards, without any process."""

import numpy as np
import pytest

from approach import FIGURES
from armguard import Box, Pose, Scene
from armguard.errors import ServiceError
from armguard.recording.calls import Grasp, Place, Release
from armguard.recording.ring import RingWriter
from armguard.service.server import Service, ServiceSettings
from armguard.service.server.judge import OBJECTS, Judge
from armguard.service.wire.layout import MOST
from arms import simple_arm
from grippers import Loop, pick_scene


def judge_of(scene, path):
    """A judge, and the ring it writes."""
    ring = RingWriter(path, 8 << 20)
    words = [np.frombuffer(bytearray(MOST), np.float64) for _ in range(2)]
    return Judge(scene, "", ServiceSettings(self_test=False), ring, *words), ring


def test_what_was_carried_stays_where_it_was_put_when_settings_change(tmp_path):
    judge, ring = judge_of(pick_scene(), tmp_path / "ring")
    loop = Loop(judge.guard.guard)
    assert loop.go({"arm/z": 0.2})
    assert loop.go({"arm/z": 0.15}, speed=0.08)
    loop.push({"arm/open_left": -0.03, "arm/open_right": -0.03}, 1500)
    judge.do(Grasp(robot="arm", name="block"))
    assert loop.go({"arm/z": 0.25}, speed=0.1)
    assert loop.go({"arm/x": 0.3})
    loop.push({"arm/z": -0.06}, 4000)
    before = judge.objects()
    judge.do(Release(robot="arm", name="block"))
    reported = judge.objects()["objects"]["block"]
    assert "block" not in before["objects"]
    assert reported["pose"][0][3] == pytest.approx(0.3, abs=2e-3)
    item = judge.guard.guard.tables.holds.objects["block"]
    stood = judge.guard.guard.tables.T_parent_joint[item.body].copy()
    judge.configure(response="slow")
    after = judge.guard.guard.tables.T_parent_joint[item.body]
    assert after == pytest.approx(stood, abs=1e-12)
    ring.close()


def test_objects_are_listed_a_few_at_a_time(tmp_path):
    scene = pick_scene()
    names = [f"box{k}" for k in range(OBJECTS + 3)]
    for name in names:
        scene.add(Box(size=(0.02,) * 3), name=name, present=False)
    judge, ring = judge_of(scene, tmp_path / "ring")
    for k, name in enumerate(names):
        judge.do(Place(name=name, pose=Pose(xyz=(5.0 + k, 0.0, 0.0))))
    first = judge.objects()
    rest = judge.objects(OBJECTS)
    assert first["count"] == rest["count"] == len(names)
    assert [*first["objects"], *rest["objects"]] == names
    assert judge.objects(len(names))["objects"] == {}
    ring.close()


def test_a_scene_whose_commands_fit_into_no_message_is_refused():
    scene = Scene(mode="path")
    for k in range(20):
        scene.add_robot(
            simple_arm(joints=30),
            name=f"arm{k}",
            stopping=FIGURES,
            base=Pose(xyz=(100.0 * k, 0.0, 0.0)),
        )
    with pytest.raises(ServiceError, match="600 joints of 20 robots"):
        Service(scene, ServiceSettings(port=0, self_test=False))
