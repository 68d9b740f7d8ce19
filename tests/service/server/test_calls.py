"""Calls between two cycles."""

import numpy as np
import pytest

from armguard import Action, Pose
from armguard.errors import RefusedError
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.service.wire import Cause, Role
from service_arms import Arms, until

STILL = np.zeros(14)


def test_objects_are_placed_by_sensors_and_written_down(served):
    with served.client(role=Role.SENSE, name="camera") as sensor:
        reader = RingReader(served.ring, newest=True)
        pose = Pose(xyz=(-0.55, 0.0, 0.22))
        with pytest.raises(RefusedError, match="bank"):
            sensor.call("place", name="bank", pose=pose)
        sensor.call("place", name="box3", pose=pose)
        texts = [frame_of(row).text for row in reader.unread()]
        placed = [text for text in texts if text.get("call") == "place"]
        assert [text["name"] for text in placed] == ["box3"]
        noted = [text for text in texts if text.get("note") == "object"]
        assert [(t["name"], t["done"], t["by"]) for t in noted] == [
            ("box3", "placed", "camera")
        ]
        sensor.call("remove", name="box3")


def all_objects(client):
    """All that was placed, as far as it takes."""
    found, count = {}, 1
    while len(found) < count:
        reply = client.call("objects", first=len(found))
        found |= reply["objects"]
        count = reply["count"] if reply["objects"] else 0
    return found


def test_a_client_that_comes_late_gets_the_poses_of_all_objects(served):
    size = {"kind": "box", "size": [0.2, 0.4, 0.6]}
    with served.client(role=Role.SENSE) as sensor, served.client() as late:
        before = all_objects(late)
        spare, gone = (f"box{k}" for k in (1, 2))
        assert not {spare, gone} & set(before)
        pose = Pose(xyz=(0.0, 1.5, 0.3))
        sensor.call("place", name=spare, pose=pose, shape=size)
        sensor.call("place", name=gone, pose=pose)
        sensor.call("remove", name=gone)
        reply = all_objects(late)
        assert reply[spare]["shape"] == {**size, "rounding": 0.0}
        assert np.array(reply[spare]["pose"]) == pytest.approx(pose.matrix())
        assert reply[gone] is None
        assert set(reply) == {*before, spare, gone}
        sensor.call("remove", name=spare)


def test_other_settings_are_taken_over_while_everything_rests(served):
    with served.client(role=Role.ADMINISTER) as client, served.client() as other:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.lead(desired)
        with pytest.raises(RefusedError, match="only while every robot rests"):
            client.call("configure", response="stop")
        arms.drive_until(STILL, lambda a: not a.velocity.any())
        arms.drive(STILL, 3)
        with pytest.raises(RefusedError, match="response"):
            client.call("configure", response="swerve")
        with pytest.raises(RefusedError, match="fixed"):
            client.call("configure", mode="fixed")
        before = client.welcome.scene_hash
        cycle = client.call("ping")["cycle"]
        reply = client.call("configure", response={"left": "stop"}, mode="speed")
        assert reply["scene_hash"] != before
        assert client.welcome.scene_hash == reply["scene_hash"]
        # All other clients are informed too, and the same ring goes on.
        until(other_hears(other), lambda _: other.welcome.scene_hash != before)
        assert arms.lead(desired).cycle > cycle
        notes = [
            frame.text
            for frame in map(frame_of, RingReader(served.ring).unread())
            if frame.kind is Kind.NOTE and frame.text.get("note") == "scene"
        ]
        assert notes[-1]["scene_hash"] == reply["scene_hash"]
        assert notes[-1]["settings"]["modes"] == {"left": "speed", "right": "speed"}
        assert notes[-1]["settings"]["responses"]["left"] == "stop"
        # A replay of what follows has a place to begin.
        frames = [frame_of(row) for row in RingReader(served.ring).unread()]
        last_scene = max(
            k for k, frame in enumerate(frames) if frame.text.get("note") == "scene"
        )
        assert Kind.CHECKPOINT in [frame.kind for frame in frames[last_scene:]]
        arms.drive_until(STILL, lambda a: not a.velocity.any())
        arms.drive(STILL, 3)
        back = client.call("configure", response="deflect", mode="path")
        assert back["scene_hash"] == before


def other_hears(other):
    """One step in which a client listens."""
    return lambda: other.receive(0.1) or other.latest


def test_a_call_that_is_repeated_is_done_once(served):
    with served.client() as client:
        Arms(client)
        client.claim()
        before = served.counters.value("stop_orders")
        client.call("stop")
        # The reply got lost, and the same call is sent again.
        client._call_number -= 1
        client.call("stop")
        assert served.counters.value("stop_orders") == before + 1
        client.call("engage")


def test_a_stop_holds_until_a_client_engages(served):
    with served.client() as client:
        arms = Arms(client)
        arms.drive(STILL, 5)
        client.call("stop")
        answer = arms.drive_until(STILL, lambda a: a.cause is Cause.STOP_ORDERED)
        assert answer.action is Action.STOP
        client.give_back()
        answer = arms.measure_until(lambda a: not a.commander)
        assert answer.cause is Cause.STOP_ORDERED
        client.claim()
        client.call("engage")
        answer = arms.drive_until(STILL, lambda a: a.action is Action.FOLLOW)
        assert answer.cause is Cause.NONE
