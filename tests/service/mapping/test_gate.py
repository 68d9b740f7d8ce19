"""Messages of sensors: which of them count, and that nothing else has an effect."""

import time

import numpy as np
import pytest

from armguard.scene import bay_scene
from armguard.service.mapping.gate import (
    FORGET,
    MOST_POINTS,
    MOST_SENDERS,
    OLDEST,
    SILENT,
    FrameGate,
)
from armguard.service.wire import Kind, Outbox, Role, Seal
from armguard.service.wire.keys import new_keys
from armguard.service.wire.layout import HEADER, MOST, SEAL
from armguard.service.wire.sensing import FRAME, FRAME_PART, METRES, MILLIMETRES

KEYS = new_keys()
SESSION, SCENE = 77, 99
ROWS, COLUMNS = 96, 128
IMAGE = np.arange(ROWS * COLUMNS, dtype=np.uint16)
ZONES = np.linspace(0.1, 3.9, 64, dtype=np.float32)
CODES = np.arange(64, dtype=np.uint8)


def sensors():
    scene = bay_scene("path")
    scene.add_sensor("top", kind="depth", size=(COLUMNS, ROWS), focal=60)
    scene.add_sensor("skin", kind="vl53l8cx", on="left/link5")
    scene.add_sensor("lidar", kind="points", spacing=0.01)
    scene.add_sensor("sonar", kind="range")
    return scene.sensors


class Sensor:
    """A program of sensors that knows the key of a role."""

    def __init__(self, role=Role.SENSE, sender=5, key=None):
        self.seal = Seal(KEYS[role] if key is None else key)
        self.outbox = Outbox(self.seal, sender, SESSION, SCENE)
        self.number = 0

    def parts(self, sensor=0, data=IMAGE, status=b"", stamp=1.5, **fields):
        """The messages of a frame."""
        self.number += 1
        whole = data.tobytes() + status
        kind = METRES if data.dtype == np.float32 else MILLIMETRES
        head = {
            "sensor": sensor, "part": 0, "distances": kind, "reserved": 0,
            "has_status": bool(status), "number": self.number, "size": len(whole),
            "stamp": stamp,
        } | fields  # fmt: skip
        found = []
        for part, at in enumerate(range(0, len(whole), FRAME_PART)):
            head["part"] = fields.get("part", part)
            some = whole[at : at + FRAME_PART]
            found.append(
                bytes(self.outbox.message(Kind.FRAME, FRAME.pack(**head), some))
            )
        return found


def changed(message, at, by=1):
    """A message with other bits, well sealed."""
    found = bytearray(message)
    found[at] ^= by
    Seal(KEYS[Role.SENSE]).put(memoryview(found))
    return bytes(found)


@pytest.fixture
def gate():
    return FrameGate(sensors(), KEYS, SESSION, SCENE)


def admit(gate, messages, now=None):
    """The frames that messages make whole, and why messages were dropped."""
    frames, drops = [], []
    for one in messages:
        when = time.monotonic_ns() if now is None else now
        frame = gate.admit(memoryview(one), when)
        frames += [] if frame is None else [frame]
        drops += [gate.drop] if gate.drop else []
        drops += ["torn"] if gate.torn else []
    return frames, drops


def test_frames_come_out_as_they_were_sent(gate):
    sensor = Sensor()
    image, skin = sensor.parts(), sensor.parts(1, ZONES, CODES.tobytes(), stamp=2.5)
    assert len(image) == 4
    (first, second), drops = admit(gate, [*image, *skin])
    assert not drops
    assert (first.name, first.stamp, first.status) == ("top", 1.5, None)
    assert (second.name, second.stamp) == ("skin", 2.5)
    assert (first.values == IMAGE).all() and first.values.dtype == np.uint16
    assert (second.values == ZONES).all() and second.values.dtype == np.float32
    assert (second.status == CODES).all()


def test_points_and_single_values_come_out_as_they_were_sent(gate):
    sensor = Sensor()
    points = np.random.default_rng(1).normal(size=(5000, 3)).astype(np.float32)
    one = np.array([np.inf], dtype=np.float32)
    sent = [
        *sensor.parts(2, points),
        *sensor.parts(3, one),
        *sensor.parts(2, points[:1]),
    ]
    (cloud, beam, single), drops = admit(gate, sent)
    assert not drops
    assert (cloud.values == points).all() and (single.values == points[:1]).all()
    assert beam.values.shape == (1,) and beam.values[0] == np.inf
    for wrong in (
        sensor.parts(2, np.zeros(4, dtype=np.float32)),
        sensor.parts(2, points[:2], bytes(6)),
        sensor.parts(2, points[:2], size=0),
        sensor.parts(2, points[:2], size=12 * (MOST_POINTS + 1)),
        sensor.parts(3, points[:1]),
    ):
        frames, drops = admit(gate, wrong)
        assert not frames and set(drops) <= {"size", "too_short"}, wrong


WRONG = {
    "empty": ("too_short", lambda m: b""),
    "cut": ("too_short", lambda m: m[: HEADER.size + SEAL + FRAME.size - 1]),
    "too long": ("oversized", lambda m: bytes(MOST + 1)),
    "not ours": ("magic", lambda m: changed(m, 0)),
    "another version": ("version", lambda m: changed(m, 4)),
    "cut behind the head": ("length", lambda m: m[:-1]),
    "a state": ("kind", lambda m: changed(m, 5, int(Kind.FRAME) ^ int(Kind.STATE))),
    "another session": ("session", lambda m: changed(m, 8)),
    "another scene": ("scene", lambda m: changed(m, 16)),
    "no sender": ("unknown_sender", lambda m: changed(m, 24, 5)),
    "turned bit": ("seal", lambda m: m[:-40] + bytes([m[-40] ^ 1]) + m[-39:]),
    "turned bit of the seal": ("seal", lambda m: m[:-1] + bytes([m[-1] ^ 1])),
    "no sensor": ("sensor", lambda m: changed(m, HEADER.size, 4)),
    "another part": ("size", lambda m: changed(m, HEADER.size + 2, 3)),
    "a part beyond": ("size", lambda m: changed(m, HEADER.size + 3, 0x80)),
    "no distances": ("size", lambda m: changed(m, HEADER.size + 4, 8)),
    "a status too many": ("size", lambda m: changed(m, HEADER.size + 5)),
    "another size": ("size", lambda m: changed(m, HEADER.size + 12)),
    "4 GB": ("size", lambda m: changed(m, HEADER.size + 15, 0xFF)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_dropped_by_its_cause(gate, wrong):
    cause, change = WRONG[wrong]
    sensor = Sensor()
    _, drops = admit(gate, [change(sensor.parts()[0])])
    assert drops == [cause]
    frames, drops = admit(gate, sensor.parts())
    assert len(frames) == 1 and not drops


def test_keys_that_may_not_sense_and_foreign_ones_do_not_fit(gate):
    for sensor in (Sensor(Role.OBSERVE), Sensor(key=b"another key here")):
        assert admit(gate, sensor.parts()[:1])[1] == ["seal"]
    assert len(admit(gate, Sensor(Role.COMMAND).parts())[0]) == 1


def test_replayed_and_reordered_messages_are_dropped(gate):
    sensor = Sensor()
    first, second = sensor.parts(), sensor.parts(stamp=1.6)
    frames, drops = admit(gate, first + first)
    assert len(frames) == 1
    assert drops == ["out_of_order"] * 3 + ["replayed"]
    frames, drops = admit(gate, [second[1], second[0], second[2], second[3]])
    assert not frames and drops == ["out_of_order"]


def test_a_recorded_frame_is_too_old_for_a_gate_that_knows_no_sender():
    messages = Sensor().parts()
    later = time.monotonic_ns() + OLDEST + 1
    gate = FrameGate(sensors(), KEYS, SESSION, SCENE)
    assert admit(gate, messages, later) == ([], ["late"] * 4)
    assert admit(gate, messages, later - 2 * OLDEST)[1] == ["ahead"] * 4
    # A sender is forgotten only when all of its messages are too old.
    assert FORGET > OLDEST


def test_a_frame_without_a_part_is_torn(gate):
    sensor = Sensor()
    frames, drops = admit(gate, sensor.parts()[:2] + sensor.parts()[1:])
    assert not frames and drops == ["torn"]
    frames, drops = admit(gate, sensor.parts(stamp=1.8))
    assert len(frames) == 1 and drops == ["torn"]


def test_parts_of_two_frames_do_not_mix(gate):
    sensor = Sensor()
    first, second = sensor.parts(), sensor.parts(data=IMAGE + 1)
    frames, _ = admit(gate, [*first[:2], *second[2:]])
    assert not frames
    whole = sensor.parts(data=IMAGE + 2)
    frames, _ = admit(gate, whole)
    assert (frames[0].values == IMAGE + 2).all()


def test_a_sensor_belongs_to_its_sender_until_that_is_silent(gate):
    own, other = Sensor(), Sensor(sender=6)
    assert len(admit(gate, own.parts())[0]) == 1
    assert admit(gate, other.parts())[1] == ["second_sender"] * 4
    later = time.monotonic_ns() + SILENT + 1
    frames, drops = admit(gate, other.parts(), later)
    assert len(frames) == 1 and not drops


def test_only_some_senders_are_known_at_a_time(gate):
    for sender in range(1, MOST_SENDERS + 1):
        assert not admit(gate, Sensor(sender=sender).parts(1, ZONES)[:1])[1][1:]
    last = Sensor(sender=MOST_SENDERS + 1)
    assert admit(gate, last.parts(1, ZONES)) == ([], ["too_many_senders"])
    later = time.monotonic_ns() + FORGET + 1
    last.outbox.ahead = FORGET
    assert len(admit(gate, last.parts(1, ZONES), later)[0]) == 1
    assert len(gate._senders) == 1


def mutated(rng, message):
    """A message with something wrong in it, half of them well sealed."""
    found = bytearray(message)
    way = rng.integers(5)
    if way == 0:
        found = found[: rng.integers(len(found))]
    elif way == 1:
        found += rng.bytes(int(rng.integers(1, 400)))
    elif way == 2:
        return rng.bytes(int(rng.integers(0, 200)))
    else:
        for _ in range(rng.integers(1, 6)):
            found[rng.integers(HEADER.size + FRAME.size)] = rng.integers(256)
    if len(found) > SEAL and rng.random() < 0.5:
        # Session, scene and length that are right get past the head.
        found[6:8] = len(found).to_bytes(2, "little")
        found[8:24] = message[8:24]
        Seal(KEYS[Role.SENSE]).put(memoryview(found))
    return bytes(found)


def test_fuzzed_messages_have_no_effect_but_their_counts(gate):
    rng, sensor = np.random.default_rng(3), Sensor()
    dropped = 0
    for _ in range(200):
        skin = sensor.parts(1, ZONES, CODES.tobytes())[0]
        for _ in range(100):
            found, drops = admit(gate, [mutated(rng, skin)])
            dropped += bool(drops)
            # A frame that gets through has the size of one.
            assert all(one.values.size in (64, ROWS * COLUMNS) for one in found)
        held = sum(len(one.data) + len(one.parts) for one in gate._assemblies)
        assert held <= 4 * (ROWS * COLUMNS + 64) and len(gate._senders) <= MOST_SENDERS
    assert dropped > 15_000
    later = time.monotonic_ns() + FORGET + 1
    fresh = Sensor(sender=1234)
    fresh.outbox.ahead = FORGET
    frames, drops = admit(gate, fresh.parts(), later)
    assert len(frames) == 1 and not set(drops) - {"torn"}
