"""The reflex as a real process: what stops the arms, and what lifts its stop."""

import os
import signal
import subprocess
import sys
import time
from hashlib import blake2s
from pathlib import Path
from struct import pack

import pytest

from armguard import reflex
from armguard.reflex import Trip
from armguard.service.wire.pulses import SENTENCES, reset
from reflex.rack import KEY, PATIENCE, RESET_KEY, SENSOR, ZONES, Rack, clear, frame

SOURCE = Path(reflex.__file__)
NEAR = [(99, 0), *clear(ZONES - 1)]


@pytest.fixture
def rack(tmp_path):
    with Rack(tmp_path) as it:
        it.lift()
        yield it


# Runs it without packages of others, and prints the modules that are none of Python's.
ALONE = f"""
import importlib.metadata, runpy, sys
importlib.metadata.version = lambda _: ""
sys.path.insert(0, {str(SOURCE.parents[1])!r})
sys.argv = ["reflex"]
try:
    runpy.run_module("armguard.reflex", run_name="__main__")
except SystemExit:
    known = sys.stdlib_module_names
    names = [name for name in sys.modules if name.partition(".")[0] not in known]
    print(*names)
"""


def test_it_is_small_and_needs_nothing_but_the_standard_library():
    assert len(SOURCE.read_text(encoding="utf-8").splitlines()) <= 300
    words = [sys.executable, "-I", "-S", "-c", ALONE]
    found = subprocess.run(words, capture_output=True, text=True, check=True)
    assert set(found.stdout.split()) == {"__main__", "armguard"}
    assert found.stderr == ": give one file: python -m armguard.reflex reflex.json\n"


def test_it_starts_stopped_and_a_near_zone_stops_the_arms(rack):
    rack.send()
    rack.stays(Trip.CLEAR)
    assert rack.line.read_text() == "1"
    rack.send([(100, 0), *clear(ZONES - 1)])
    rack.stays(Trip.CLEAR)
    rack.send(NEAR)
    pulse = rack.until(lambda p: p["trip"])
    assert (pulse["trip"], pulse["stops"]) == (Trip.NEAR, 2)
    assert (pulse["sensor"], pulse["zone"], pulse["distance"]) == (SENSOR, 0, 99)
    assert rack.line.read_text() == "0"
    # What follows is no stop of its own: a reset names the first one.
    rack.send(counter=rack.counter)
    rack.send()
    rack.stays(Trip.NEAR)
    assert rack.pulse()["stops"] == 2


def test_pulses_have_a_seal_that_needs_the_key(rack):
    data = rack.listener.recv(4096)
    assert len(data) == 64
    assert data[-16:] == blake2s(data[:-16], key=KEY.encode(), digest_size=16).digest()


WRONG = {
    "the counter stays": (Trip.COUNTER, lambda r: r.send(counter=r.counter)),
    "the counter goes back": (Trip.COUNTER, lambda r: r.send(counter=r.counter - 1)),
    "the stamp goes back": (Trip.STAMP_BACK, lambda r: r.send(stamp=r.stamp)),
    "the stamp is ahead": (
        Trip.STAMP_AHEAD,
        lambda r: r.send(stamp=time.monotonic_ns() + 20_000_000),
    ),
    "the stamp is old": (
        Trip.STAMP_OLD,
        lambda r: r.send(stamp=time.monotonic_ns() - 1_001_000_000),
    ),
    "a zone is missing": (Trip.SIZE, lambda r: r.send(clear(ZONES - 1))),
    "a byte is missing": (Trip.SIZE, lambda r: r.raw(next_frame(r)[:-1])),
    "a bit is turned": (Trip.CORRUPT, lambda r: r.raw(turned(next_frame(r)))),
    "most zones are invalid": (
        Trip.BLIND,
        lambda r: r.send([(400, 0)] * 7 + [(400, 2)] * 9),
    ),
}


def next_frame(rack):
    rack.counter += 1
    return frame(rack.counter, time.monotonic_ns(), clear())


def turned(data):
    return data[:30] + bytes([data[30] ^ 1]) + data[31:]


@pytest.mark.parametrize("name", WRONG)
def test_a_frame_that_is_wrong_stops_the_arms(rack, name):
    trip, does = WRONG[name]
    rack.stamp = time.monotonic_ns()
    rack.send(stamp=rack.stamp)
    rack.stays(Trip.CLEAR, 0.05)
    does(rack)
    pulse = rack.until(lambda p: p["trip"])
    assert (pulse["trip"], pulse["sensor"]) == (trip, SENSOR)
    assert pulse["dropped"] == 0


def test_as_many_valid_zones_as_invalid_ones_suffice(rack):
    rack.send([(400, 0)] * 8 + [(400, 2)] * 8)
    rack.stays(Trip.CLEAR)


def test_frames_that_repeat_their_distances_stop_the_arms(rack):
    same = clear()
    rack.send(same)
    rack.send(same)
    rack.stays(Trip.CLEAR)
    rack.send(same)
    assert rack.until(lambda p: p["trip"])["trip"] == Trip.REPEATED


def test_frames_that_see_nothing_may_repeat(rack):
    for _ in range(5):
        rack.send([(4000, 1)] * ZONES)
    rack.stays(Trip.CLEAR)


@pytest.mark.realtime
def test_a_silent_sensor_stops_the_arms_after_its_timeout(tmp_path):
    with Rack(tmp_path, timeout=0.3) as rack:
        rack.lift()
        rack.send()
        sent = time.monotonic_ns()
        pulse = rack.until(lambda p: p["trip"])
        assert (pulse["trip"], pulse["zone"]) == (Trip.SILENT, 0xFFFF)
        assert 0.29e9 < pulse["stamp"] - sent < 0.75e9
        assert reset(rack.file, PATIENCE).startswith("the reflex: the sensor is silent")


def test_two_votes_need_the_same_zone_twice(tmp_path):
    with Rack(tmp_path, vote=2) as rack:
        rack.lift()
        other = [*clear(ZONES - 1), (99, 0)]
        for zones in (NEAR, other, NEAR, clear(), NEAR):
            rack.send(zones)
        rack.stays(Trip.CLEAR)
        # An invalid reading neither sees it nor clears it.
        rack.send([(99, 2), *clear(ZONES - 1)])
        rack.stays(Trip.CLEAR)
        rack.send(NEAR)
        pulse = rack.until(lambda p: p["trip"])
        assert (pulse["trip"], pulse["zone"]) == (Trip.NEAR, 0)


def test_masked_zones_stop_nothing(tmp_path):
    masked = [None, *[0.1] * (ZONES - 1)]
    with Rack(tmp_path, thresholds=masked) as rack:
        rack.lift()
        rack.send(NEAR)
        rack.stays(Trip.CLEAR)
        rack.send([(1, 0), (99, 0), *clear(ZONES - 2)])
        pulse = rack.until(lambda p: p["trip"])
        assert (pulse["trip"], pulse["zone"]) == (Trip.NEAR, 1)


def test_only_the_operators_reset_lifts_a_stop_and_only_where_it_is_over(rack):
    rack.send(NEAR)
    stopped = rack.until(lambda p: p["trip"])
    assert "zone 0, 99 mm" in reset(rack.file, PATIENCE)
    rack.stays(Trip.NEAR)
    rack.send()
    body = pack("<4sHHQII", b"AGRS", 1, 0, stopped["session"], stopped["stops"], 0)
    older = pack("<4sHHQII", b"AGRS", 1, 0, stopped["session"], stopped["stops"] - 1, 0)

    def sealed(data, key):
        return data + blake2s(data, key=key.encode(), digest_size=16).digest()

    for data in (sealed(body, KEY), sealed(older, RESET_KEY), body):
        rack.raw(data)
        rack.stays(Trip.NEAR)
    rack.raw(sealed(body, RESET_KEY))
    rack.until(lambda p: not p["trip"])


def test_noise_is_counted_and_stops_nothing(rack):
    rack.send()
    good = next_frame(rack)
    for data in (b"", b"x", bytes(60_000), good[:20], frame(9, 1, clear(), sensor=8)):
        rack.raw(data)
    pulse = rack.until(lambda p: p["dropped"] >= 5)
    assert (pulse["trip"], pulse["dropped"]) == (Trip.CLEAR, 5)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_its_end_is_a_stop(rack, number):
    rack.process.send_signal(number)
    assert rack.until(lambda p: p["trip"])["trip"] == Trip.ENDED
    assert rack.process.wait(PATIENCE) == 0
    assert rack.line.read_text() == "0"


def test_an_error_in_the_loop_is_a_stop(tmp_path, monkeypatch):
    with Rack(tmp_path) as rack:
        given = reflex.read_settings(rack.file)
    own = reflex.Reflex(given)

    def fails():
        ended.append(1)
        raise RuntimeError("no such state")

    ended = []
    monkeypatch.setattr(own, "turn", fails)
    monkeypatch.setattr(reflex, "Reflex", lambda _: own)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    said = []
    monkeypatch.setattr(reflex, "say", said.append)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    own.trip = Trip.CLEAR

    def sleep(_):
        if len(ended) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", sleep)
    with pytest.raises(KeyboardInterrupt):
        reflex.main([str(rack.file)])
    assert own.trip is Trip.FAULT
    assert said[:2] == ["stop 2: FAULT ", "RuntimeError: no such state"]
    own.socket.close()


BAD = {
    "port": ({"port": 0}, "port is 0; give int from 1 to 65535"),
    "key": ({"key": "short"}, "key is 'short'; give str of length from 16 to 32"),
    "same keys": ({"reset": KEY}, "reset equals key"),
    "unknown": ({"prot": 1}, "no key 'prot'; keys are port, key, reset"),
    "listeners": ({"listeners": [0]}, "listeners must be UDP ports"),
    "sensors": ({"sensors": {}}, "sensors is {}; give dict of length from 1 to 256"),
    "period": ({"period": True}, "period is True; give float from 0.001 to 0.05"),
    "line": ({"line": "/no/such/folder/line"}, "No such file or directory"),
    "timeout": ({"sensors": {"a": {"id": 1}}}, "a: timeout is None; give float"),
    "nan": (
        {"sensors": {"a": {"id": 1, "timeout": float("nan"), "thresholds": [1]}}},
        "a: timeout is nan; give float from 0.001 to 2",
    ),
    "thresholds": (
        {"sensors": {"a": {"id": 1, "timeout": 1.0, "thresholds": [None]}}},
        "a: thresholds must be metres, or null, not all",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_wrong_file_is_one_sentence_and_exit_code_2(tmp_path, name):
    more, says = BAD[name]
    rack = Rack(tmp_path, more=more)
    words = [sys.executable, "-m", "armguard.reflex", str(rack.file)]
    found = subprocess.run(words, capture_output=True, text=True, check=False)
    assert found.returncode == 2
    assert says in found.stderr
    assert len(found.stderr.splitlines()) == 1
    rack.listener.close()
    rack.out.close()


def test_keys_that_others_may_read_are_refused(tmp_path):
    rack = Rack(tmp_path)
    rack.file.chmod(0o640)
    with pytest.raises(ValueError, match=f"chmod 600 {rack.file}"):
        reflex.read_settings(rack.file)
    rack.listener.close()
    rack.out.close()


def test_every_trip_has_a_sentence():
    assert set(SENTENCES) == set(Trip)
