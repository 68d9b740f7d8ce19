"""Parts of service and client that need no process."""

import contextlib
import logging
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from armguard.recording import rings
from armguard.recording.counters import (
    BUCKETS,
    DROPS,
    Counters,
    CountersError,
    CountersReader,
    bucket_of,
    upper_end,
)
from armguard.scene import bay_scene, compile_scene
from armguard.service.client.clock import ServiceClock
from armguard.service.server import machine
from armguard.service.server.scenes import scene_hash
from armguard.service.server.throttled_log import PatientHandler
from armguard.service.wire import Cause, Kind, Seal

DOCS = Path(__file__).parents[3] / "docs" / "service.md"


def test_a_client_needs_no_kernels():
    program = "import sys, armguard.service.client; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", program],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    ).stdout.split()
    assert not {"numba", "scipy", "trimesh", "pydantic", "typer"} & set(loaded)


def test_every_word_of_the_wire_is_on_its_page():
    page = DOCS.read_text(encoding="utf-8")
    for kind in Kind:
        assert f"| {int(kind)} | {kind.name} |" in page, kind
    for cause in Cause:
        assert f"| {int(cause)} | {cause.name} | {cause.sentence} |" in page, cause
    for name, sentence in DROPS.items():
        assert f"| `{name}` | {sentence} |" in page, name


def test_a_seal_fits_its_own_key_and_message_only():
    message = memoryview(bytearray(range(200)))
    Seal(b"k" * 16).put(message)
    assert Seal(b"k" * 16).fits(message)
    assert not Seal(b"j" * 16).fits(message)
    for at in range(len(message)):
        message[at] ^= 1
        assert not Seal(b"k" * 16).fits(message)
        message[at] ^= 1


def test_buckets_follow_each_other_and_hold_what_they_say():
    ends = [upper_end(k) for k in range(BUCKETS)]
    assert ends == sorted(set(ends))
    rng = np.random.default_rng(0)
    for value in (2.0 ** rng.uniform(0, 46, 2000)).astype(np.int64).tolist():
        k = bucket_of(value)
        assert (ends[k - 1] if k else 0) <= value < ends[k], value
        assert ends[k] - value <= max(value / 16, 1)
    assert bucket_of(-5) == 0
    assert bucket_of(2**62) == BUCKETS - 1


def test_counters_are_read_by_another_and_refused_when_they_are_others(tmp_path):
    counters = Counters(tmp_path / "counters")
    times = np.random.default_rng(1).gamma(3.0, 20e3, 5000).astype(np.int64)
    for value in times.tolist():
        counters.time("inside", value)
    counters.stop(113)
    counters.stop(10**9)
    reader = CountersReader(tmp_path / "counters")
    found = reader.histogram("inside")
    assert found.count == len(times)
    assert found.most == times.max() * 1e-9
    assert found.total == pytest.approx(times.sum() * 1e-9)
    for share in (0.5, 0.99, 0.999):
        true = np.quantile(times, share) * 1e-9
        assert true * 0.99 <= found.percentile(share) <= true * 1.08
    assert np.isnan(reader.histogram("waking").percentile(0.5))
    assert reader.stops() == {113: 1, 255: 1}
    counters.close()
    with pytest.raises(CountersError, match="no counters are there"):
        CountersReader(tmp_path / "counters")
    (tmp_path / "other").write_bytes(bytes(64))
    with pytest.raises(CountersError, match="another version"):
        CountersReader(tmp_path / "other")


def test_a_scene_has_one_hash_and_a_changed_one_another():
    scene = bay_scene("path")
    found = scene_hash(compile_scene(scene))
    assert found == scene_hash(compile_scene(bay_scene("path")))
    scene.set_response("stop", "left")
    other = scene_hash(compile_scene(scene))
    assert other != found
    scene.set_response("deflect", "left")
    assert scene_hash(compile_scene(scene)) == found


def test_the_service_clock_is_known_to_half_the_quickest_round_trip():
    clock = ServiceClock()
    away, rng = 5.0, np.random.default_rng(2)
    for _ in range(50):
        asked = time.monotonic_ns()
        out, back = (rng.gamma(2.0, 1e5, 2)).astype(int).tolist()
        clock.learn(asked, asked + out + int(away * 1e9), asked + out + back)
    assert abs(clock.offset - away) <= clock.bound < 1e-3
    assert clock() - time.monotonic() == pytest.approx(away, abs=1e-3)
    clock.share()
    assert clock.offset == clock.bound == 0.0


def test_a_log_that_no_process_reads_keeps_no_process_waiting(tmp_path):
    read, write = os.pipe()
    with os.fdopen(read, "rb"), os.fdopen(write, "w") as stream:
        handler = PatientHandler(stream)
        record = logging.makeLogRecord({"msg": "x" * 1000, "levelname": "WARNING"})
        for _ in range(5000):
            handler.emit(record)
        assert handler._lines.qsize() <= 1000
        handler.finish(0.1)
        # Let the thread go on, so that the pipe can be closed.
        os.set_blocking(read, False)
        while handler._lines.qsize() or handler._writing:
            with contextlib.suppress(BlockingIOError):
                os.read(read, 1 << 16)


def test_what_the_machine_refuses_is_a_sentence(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    assert "no real-time scheduling: " in machine.ask_realtime()
    assert "CAP_SYS_NICE" in machine.ask_realtime()
    assert "not bound to processor 3: " in machine.ask_cpu(3)


def test_what_a_killed_service_left_behind_goes_when_its_port_is_used_again(
    monkeypatch, tmp_path
):
    monkeypatch.setattr(rings, "in_memory", lambda: tmp_path)
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait(60)
    own, dead = os.getpid(), gone.pid
    names = (
        f"armguard-1-{dead}",
        f"armguard-1-{dead}.counters",
        f"armguard-2-{dead}",
        f"armguard-3-{dead}",
        f"armguard-1-{own}",
        "armguard-notes",
    )
    for name in names:
        (tmp_path / name).touch()
    os.utime(tmp_path / f"armguard-3-{dead}", (0.0, 0.0))
    assert rings.new_ring(1) == tmp_path / f"armguard-1-{own}"
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {f"armguard-2-{dead}", f"armguard-1-{own}", "armguard-notes"}
