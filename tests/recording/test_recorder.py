"""The recorder as a process: a real ring, a real disk, and what can happen to it."""

import itertools
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from armguard import Guard
from armguard.errors import RecordingError
from armguard.recording import disk as disks
from armguard.recording import open_recording
from armguard.recording.comparison import compare
from armguard.recording.frames import Form, Kind, frame_of
from armguard.recording.near_misses import Trigger
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, pulse_path, recorder_age
from recording.tapes import (
    PATIENCE,
    PERIOD,
    Tape,
    record_here,
    start_recorder,
    wait_until,
)

REPLAY = "from armguard.cli import main; main()"

# Promised is a second; the machine may be busy with other tests.
MOST_LOST = 2.0


def replayed(path, *options, seed="2"):
    """`armguard replay` as a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", REPLAY, "replay", str(path), *options],
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def written(folder):
    """Bytes of all recordings."""
    return sum(path.stat().st_size for path in folder.glob("*.mcap"))


def test_a_ring_is_recorded_by_another_process_and_replayed_by_a_third(tmp_path):
    tape = Tape(tmp_path)
    folder = tmp_path / "tapes"
    tape.begin()
    with start_recorder(
        tape.path, folder, "--before", "1", "--after", "0.5"
    ) as process:
        assert wait_until(lambda: written(folder) > 0)
        tape.drive(5.0)
        tape.ball()
        tape.drive(1.0)
        tape.close()
        assert process.wait(PATIENCE) == 0
    assert tape.stops
    whole = open_recording(folder)
    frames = list(whole.frames())
    cycles = [frame for frame in frames if frame.kind is Kind.CYCLE]
    assert [frame.cycle for frame in cycles] == list(range(tape.k))
    assert whole.problems == []
    assert whole.names == tape.guard.q_names
    assert whole.info["scene_file"] == "bay"
    assert sum(frame.kind is Kind.EVENT for frame in frames) == 7
    assert replay(whole).identical
    answer = replayed(folder)
    assert answer.stdout.strip() == f"{tape.k:,} cycles, bit-identical"
    assert answer.returncode == 0
    near = sorted(folder.glob("near-miss-*.mcap"))
    assert len(near) == 1
    apart = [f for f in open_recording(near[0]).frames() if f.kind is Kind.CYCLE]
    assert apart[0].cycle <= tape.stops[0] - 1.0 / PERIOD
    assert apart[-1].cycle >= tape.stops[-1] + 0.5 / PERIOD - 1
    alone = replay(open_recording(near[0]))
    assert alone.identical
    assert alone.skipped == 0
    assert alone.cycles == len(apart)


def test_input_bits_and_whole_verdicts_come_back(tmp_path):
    tape = Tape(tmp_path)
    tape.begin()
    reader = RingReader(tape.path)
    record_here(tape, tmp_path / "tapes", 2.0)
    true = [frame_of(row) for row in reader.unread()]
    true = {frame.cycle: frame for frame in true if frame.kind is Kind.CYCLE}
    whole = 0
    for frame in open_recording(tmp_path / "tapes").frames():
        if frame.kind is not Kind.CYCLE:
            continue
        was = true.pop(frame.cycle)
        assert frame.form is Form.VELOCITIES
        for name in ("q", "velocity", "stamps", "asked", "told"):
            assert getattr(frame, name).tobytes() == getattr(was, name).tobytes()
        assert (frame.now, frame.monotonic, frame.wall) == (
            was.now, was.monotonic, was.wall,
        )  # fmt: skip
        if frame.poses.size:
            whole += 1
            assert frame.verdict.tobytes() == was.verdict.tobytes()
            assert (frame.poses == was.poses).all()
    assert not true
    assert whole > 30


def test_killed_in_the_middle_it_loses_no_more_than_the_last_second(tmp_path):
    tape = Tape(tmp_path)
    folder = tmp_path / "tapes"
    tape.begin()
    with start_recorder(tape.path, folder) as process:
        assert wait_until(lambda: written(folder) > 0)
        began = time.monotonic()
        done = []
        while time.monotonic() - began < 3.0:
            tape.cycle()
            done.append(time.monotonic())
            time.sleep(max(0.0, began + len(done) * PERIOD - time.monotonic()))
        process.send_signal(signal.SIGKILL)
        killed = time.monotonic()
        process.wait(PATIENCE)
    recording = open_recording(folder)
    found = [f.cycle for f in recording.frames() if f.kind is Kind.CYCLE]
    assert found == list(range(len(found)))
    assert killed - done[found[-1]] < MOST_LOST
    assert any("cut off" in problem for problem in recording.problems)
    assert replay(recording).identical
    # The ring is as it was: another recorder begins with the oldest it still holds.
    with start_recorder(tape.path, tmp_path / "again") as process:
        assert wait_until(lambda: written(tmp_path / "again") > 0)
        tape.drive(0.5)
        tape.close()
        assert process.wait(PATIENCE) == 0
    again = replay(open_recording(tmp_path / "again"))
    assert again.identical
    assert again.cycles == tape.k


def test_a_full_disk_is_named_and_the_recorder_goes_on_when_there_is_room(tmp_path):
    tape = Tape(tmp_path)
    folder = tmp_path / "tapes"
    tape.begin()
    room = 200_000

    def little_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))

    said = tmp_path / "said"
    with (
        said.open("w") as words,
        start_recorder(tape.path, folder, preexec_fn=little_room) as process,
    ):

        def listen():
            for line in process.stderr:
                words.write(line)
                words.flush()

        reading = threading.Thread(target=listen)
        reading.start()
        assert wait_until(lambda: written(folder) > 0)

        def driven_until_it_is_full():
            tape.drive(0.2)
            return "nothing can be recorded" in said.read_text()

        assert wait_until(driven_until_it_is_full)
        assert "nothing can be recorded: File too large" in said.read_text()
        assert process.poll() is None
        first = open_recording(folder)
        found = [f.cycle for f in first.frames() if f.kind is Kind.CYCLE]
        assert found == list(range(len(found)))
        assert max(path.stat().st_size for path in folder.iterdir()) <= room
        everything = resource.RLIM_INFINITY
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (everything, everything))
        tape.drive(1.0)
        assert wait_until(lambda: "recording goes on" in said.read_text())
        tape.close()
        assert process.wait(PATIENCE) == 0
        reading.join(PATIENCE)
    # What waited for the disk was written then: nothing is missing.
    answer = replay(open_recording(folder))
    assert answer.identical
    assert answer.cycles == tape.k


def test_what_does_not_fit_into_memory_is_given_up_and_said(tmp_path, monkeypatch):
    monkeypatch.setattr(disks, "MOST_WAITING", 100_000)
    monkeypatch.setattr(disks, "PAUSE", 0.01)
    tape = Tape(tmp_path, checkpoints=50)
    folder = tmp_path / "tapes"
    # A file is in the place of the folder: as good as a disk that is gone.
    folder.write_text("in the way")
    tape.begin()
    reader = RingReader(tape.path)
    recorder = Recorder(folder, RecorderSettings())

    def take():
        for row in reader.unread():
            recorder.take(row)

    for _ in range(20):
        tape.drive(0.2, take)
        recorder.flush()
        assert recorder.disk.waiting <= 100_000
    assert recorder.disk.problem.startswith(str(folder))
    assert recorder.disk.lost > 0
    folder.unlink()
    assert wait_until(lambda: not recorder.disk.problem)
    for _ in range(5):
        tape.drive(0.2, take)
        recorder.flush()
        assert wait_until(lambda: not recorder.disk.waiting)
    recorder.end()
    recording = open_recording(folder)
    answer = replay(recording)
    assert answer.identical
    assert 50 < answer.cycles < tape.k
    assert any("earlier frames are missing" in problem for problem in answer.problems)


def test_a_folder_that_is_removed_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setattr(disks, "PAUSE", 0.01)
    tape = Tape(tmp_path, checkpoints=50)
    folder = tmp_path / "tapes"
    tape.begin()
    reader = RingReader(tape.path)
    recorder = Recorder(folder, RecorderSettings())

    def take():
        for row in reader.unread():
            recorder.take(row)

    for k in range(12):
        tape.drive(0.2, take)
        recorder.flush()
        assert wait_until(lambda: not recorder.disk.waiting)
        if k == 3:
            shutil.rmtree(folder)
    recorder.end()
    answer = replay(open_recording(folder))
    assert answer.identical
    assert answer.cycles > 200
    assert any("earlier frames are missing" in problem for problem in answer.problems)


def test_a_slow_disk_keeps_no_cycle_waiting_and_nothing_is_lost(tmp_path, monkeypatch):
    write = os.write
    waits = threading.Event()

    def slowly(handle, data):
        waits.wait(PATIENCE)
        return write(handle, data)

    monkeypatch.setattr(disks.os, "write", slowly)
    tape = Tape(tmp_path)
    tape.begin()
    reader = RingReader(tape.path)
    recorder = Recorder(tmp_path / "tapes", RecorderSettings())
    for _ in range(5):
        tape.drive(0.2)
        for row in reader.unread():
            recorder.take(row)
        recorder.flush()
    # All was taken while the first piece was still being written.
    assert recorder.cycles == tape.k
    assert recorder.disk.waiting > 50_000
    waits.set()
    recorder.end()
    answer = replay(open_recording(tmp_path / "tapes"))
    assert answer.sentence == f"{tape.k:,} cycles, bit-identical"


def test_recordings_follow_each_other_and_the_oldest_are_deleted(tmp_path):
    tape = Tape(tmp_path, checkpoints=100)
    folder = tmp_path / "tapes"
    tape.begin()
    record_here(tape, folder, 6.0, file_time=1.0, keep=700_000)
    files = sorted(folder.glob("recording-*.mcap"))
    assert 2 <= len(files) <= 6
    assert sum(path.stat().st_size for path in files[:-1]) <= 700_000
    for path in files:
        one = replay(open_recording(path))
        assert one.identical
        assert one.skipped == 0
    whole = replay(open_recording(folder))
    assert whole.identical
    assert whole.cycles < tape.k
    assert whole.cycles + (whole.first_cycle or 0) == tape.k


def test_a_reader_that_is_too_slow_says_what_it_lost(tmp_path):
    tape = Tape(tmp_path, checkpoints=50, size=1 << 20)
    tape.begin()
    reader = RingReader(tape.path)
    next(reader.unread())
    tape.drive(6.0)
    recorder = Recorder(tmp_path / "tapes", RecorderSettings())
    tape.ring._head[6] = 1
    recorder.run(reader, lambda: False)
    recording = open_recording(tmp_path / "tapes")
    answer = replay(recording)
    assert answer.identical
    assert answer.skipped > 0
    assert answer.cycles > 50
    assert any("records were lost" in problem for problem in answer.problems)


def test_it_ends_in_words_without_a_ring(tmp_path):
    with start_recorder(tmp_path / "none", tmp_path, "--wait", "0.1") as process:
        assert process.wait(PATIENCE) == 2
        assert "no ring is there" in process.stderr.read()


def test_a_signal_ends_it_with_a_whole_file(tmp_path):
    tape = Tape(tmp_path)
    folder = tmp_path / "tapes"
    tape.begin()
    with start_recorder(tape.path, folder) as process:
        assert wait_until(lambda: written(folder) > 0)
        tape.drive(0.5)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    recording = open_recording(folder)
    cycles = [f.cycle for f in recording.frames() if f.kind is Kind.CYCLE]
    assert recording.problems == []
    assert cycles == list(range(tape.k))
    assert np.isfinite([f.monotonic for f in recording.frames()]).all()


STARTS = """
import subprocess, sys, time
module, *words = sys.argv[1:]
import os
recorder = subprocess.Popen([sys.executable, "-m", module, *words,
                             "--parent", str(os.getpid())])
print(recorder.pid, flush=True)
time.sleep(600)
"""


def runs(pid):
    """Whether a process is there and has not ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return state.rpartition(")")[2].split()[0] != "Z"


def test_it_ends_with_the_service_that_started_it(tmp_path):
    tape = Tape(tmp_path)
    tape.begin()
    folder = tmp_path / "tapes"
    words = ("armguard.recording", "--ring", tape.path, "--folder", folder)
    service = subprocess.Popen(
        [sys.executable, "-c", STARTS, *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
    )
    recorder = int(service.stdout.readline())
    try:
        tape.drive(0.5)
        assert wait_until(lambda: (recorder_age(tape.path) or 1e9) < PATIENCE)
        assert runs(recorder)
        tape.drive(0.5)
        service.kill()
        service.communicate()
        assert wait_until(lambda: not runs(recorder))
    finally:
        service.kill()
        if runs(recorder):
            os.kill(recorder, signal.SIGKILL)
    assert replay(open_recording(folder)).cycles == tape.k


def test_no_process_waits_for_a_service_that_is_gone_already(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    tape = Tape(tmp_path)
    tape.begin()
    tape.drive(0.4)
    folder = tmp_path / "tapes"
    with start_recorder(tape.path, folder, "--parent", str(gone.pid)) as process:
        assert process.wait(PATIENCE) == 0
    assert replay(open_recording(folder)).cycles == tape.k


def test_it_says_that_it_records_as_long_as_it_does(tmp_path):
    tape = Tape(tmp_path)
    tape.begin()
    assert recorder_age(tape.path) is None
    with start_recorder(tape.path, tmp_path / "tapes") as process:
        assert wait_until(lambda: (recorder_age(tape.path) or 1e9) < 5.0)
        assert pulse_path(tape.path).stat().st_mode & 0o777 == 0o600
        process.kill()
        process.wait()
    age = recorder_age(tape.path)
    assert wait_until(lambda: recorder_age(tape.path) > age)
    with start_recorder(tape.path, tmp_path / "tapes") as process:
        assert wait_until(lambda: recorder_age(tape.path) < age)
        process.terminate()
        assert process.wait(PATIENCE) == 0
    assert recorder_age(tape.path) is None


def test_what_arms_did_is_their_owners_business(tmp_path):
    tape = Tape(tmp_path)
    tape.begin()
    folder = tmp_path / "some" / "tapes"
    record_here(tape, folder, 4.0, before=1.0, after=0.2)
    assert tape.stops
    assert folder.stat().st_mode & 0o777 == 0o700
    found = list(folder.glob("*.mcap"))
    assert len(found) > 1
    assert {path.stat().st_mode & 0o777 for path in found} == {0o600}


def often(monkeypatch, every):
    """Let something begin that is worth a file every so many cycles."""
    looks = itertools.count(1)
    monkeypatch.setattr(
        Trigger, "look", lambda *_: "" if next(looks) % every else "again"
    )


def test_near_misses_that_follow_each_other_do_not_repeat_what_was_before(
    tmp_path, monkeypatch
):
    often(monkeypatch, every=300)
    tape = Tape(tmp_path, checkpoints=100)
    tape.begin()
    record_here(tape, tmp_path / "tapes", 12.0, before=10.0, after=0.1)
    files = sorted((tmp_path / "tapes").glob("near-miss-*.mcap"))
    assert len(files) > 6
    kept = 0
    for path in files:
        found = replay(open_recording(path))
        assert found.identical, (path.name, found.sentence)
        assert not found.skipped
        kept += found.cycles
    # Each begins with a checkpoint: what is between two of them may be there twice.
    assert tape.k - 300 < kept <= tape.k + len(files) * tape.checkpoints


def test_near_misses_have_a_budget(tmp_path, monkeypatch):
    often(monkeypatch, every=300)
    tape = Tape(tmp_path, checkpoints=100)
    tape.begin()
    budget = 1_500_000
    record_here(tape, tmp_path / "tapes", 12.0, before=1.0, after=0.1,
                keep_near_size=budget)  # fmt: skip
    files = sorted((tmp_path / "tapes").glob("near-miss-*.mcap"))
    sizes = [path.stat().st_size for path in files]
    assert 1 <= len(files) < 9
    assert sum(sizes[:-1]) <= budget


def test_settings_that_change_begin_another_recording_and_all_are_the_same_again(
    tmp_path,
):
    tape = Tape(tmp_path)
    folder = tmp_path / "tapes"
    tape.begin()
    reader = RingReader(tape.path)
    recorder = Recorder(folder, RecorderSettings())
    tape.drive(0.5)
    # What a service does that gets another response: a guard anew, in the same ring.
    tape.scene.set_mode("speed")
    tape.guard = Guard(tape.scene, self_test=False)
    tape.tape = RecordedGuard(tape.guard, tape.ring, monotonic=lambda: 1e3 + tape.t)
    tape.v = np.zeros(14)
    tape.begin()
    tape.drive(0.5)
    for row in reader.unread():
        recorder.take(row)
    recorder.end()
    assert len(list(folder.glob("recording-*.mcap"))) == 2
    answer = replay(open_recording(folder))
    assert answer.sentence == "250 cycles, bit-identical"
    with pytest.raises(RecordingError, match="settings were changed"):
        compare(open_recording(folder), {"response": "slow"})
