"""Replay: the same bits again, the first difference in words, and other settings."""

import json
import subprocess
import sys
from dataclasses import replace as changed

import numpy as np
import pytest

from armguard import Guard, bay_scene
from armguard.errors import SettingError
from armguard.guard.levels import ORDERED
from armguard.recording import open_recording
from armguard.recording.calls import Engage, Remove, Reset, Retreat
from armguard.recording.comparison import compare
from armguard.recording.frames import HEADER, Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.recording import Recording
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, RingWriter
from armguard.recording.settings import change
from armguard.scene.archive import ArchiveError, archive_of, scene_of
from armguard.scene.compile import compile_scene
from recording.tapes import PERIOD, Tape

REPLAY = "from armguard.cli import main; main()"


class Altered(Recording):
    """A recording of which one cycle is not as it was."""

    def __init__(self, paths, cycle, alter):
        super().__init__(paths)
        self.cycle, self.alter = cycle, alter

    def rows(self):
        for row in super().rows():
            if frame_of(row).kind is Kind.CYCLE and frame_of(row).cycle == self.cycle:
                altered = row.copy()
                self.alter(altered)
                yield altered
            else:
                yield row


def test_a_recording_and_its_near_miss_are_the_same_again(drive):
    folder, tape = drive
    whole = replay(open_recording(folder))
    assert whole.sentence == f"{tape.k:,} cycles, bit-identical"
    assert whole.checkpoints == tape.k // tape.checkpoints
    assert whole.problems == []
    (near,) = folder.glob("near-miss-*.mcap")
    assert replay(open_recording(near)).identical
    part = replay(open_recording(folder), start=2.0, end=3.0)
    assert part.identical
    assert 250 <= part.cycles <= 251 + tape.checkpoints


def test_the_last_bit_of_one_joint_is_a_difference(drive):
    folder, tape = drive
    paths = open_recording(folder).paths
    near = tape.stops[0] - 1

    def next_number(row):
        row[HEADER : HEADER + 14] = np.nextafter(row[HEADER : HEADER + 14], 9.0)

    answer = replay(Altered(paths, near, next_number))
    assert not answer.identical
    assert answer.different_cycle == near
    assert answer.cycles == near
    assert f"cycle {near} at" in answer.sentence

    def far(row):
        row[HEADER + 3] = 9.0

    answer = replay(Altered(paths, near, far))
    assert answer.different_cycle == near
    assert "and is STATE_JUMPED" in answer.sentence


def test_every_call_and_every_wrong_input_is_the_same_again(tmp_path):
    tape = Tape(tmp_path, checkpoints=10_000)
    tape.begin()
    taped, q, still = tape.tape, tape.guard.home, np.zeros(14)
    names = tape.guard.q_names
    time = [0.0]

    def now():
        time[0] += PERIOD
        tape.k += 1
        return time[0]

    def calm():
        for _ in range(5):
            taped.filter(q, still, now(), velocity=still)

    calm()
    taped.filter(q, {names[2]: 0.1}, now(), velocity=still)
    taped.filter(q, {"nobody": 0.1}, now(), velocity=still)
    taped.filter(q, "nonsense", now(), velocity=still)
    taped.filter([1.0, 2.0], still, now(), velocity=still)
    calm()
    taped.filter(q, still, {"left": 0.5, "stranger": 1.0}, velocity=still)
    calm()
    taped.filter(q, still, "noon", velocity=still)
    taped.filter(q, still, now(), velocity=[1.0])
    calm()
    taped.filter(q, still, now(), velocity=still, now="never")
    calm()
    taped.do(Engage(name="left"))
    taped.filter_twists(q, {"left": np.ones(6) * 0.01}, now(), velocity=still)
    taped.filter_twists(q, {"left": "no"}, now(), velocity=still)
    taped.filter_twists(q, {"nobody": np.ones(6)}, now(), velocity=still)
    taped.filter_positions(q, q + 0.001, now(), velocity=still)
    both = {"left": now(), "right": time[0] - 1e-3}
    taped.filter(q, still, both, velocity=still, now=time[0])
    for reason in (None, "now", *ORDERED):
        taped.stop(q, now(), velocity=still, reason=reason)
        calm()
    taped.do(Engage(ordered=False))
    calm()
    taped.do(Engage())
    taped.stop([1.0], now(), velocity=still)
    tape.ball()
    calm()
    taped.do(Remove(name="ball"))
    taped.do(Retreat(name="left"))
    calm()
    taped.step(q, now(), velocity=still)
    taped.step(q, now())
    taped.do(Reset())
    taped.filter(np.full(14, np.nan), still, 0.1, velocity=still)
    taped.filter(q, still, 0.2, velocity=still)
    recorder = Recorder(tmp_path / "tapes", RecorderSettings())
    for row in RingReader(tape.path).unread():
        recorder.take(row)
    recorder.end()
    answer = replay(open_recording(tmp_path / "tapes"))
    assert answer.identical, answer.sentence
    assert answer.cycles == taped.cycle


def test_settings_are_found_or_something_like_them_is_named():
    scene = bay_scene("path")
    made = change(
        scene,
        1024,
        {
            "guard.mode": "speed",
            "scene.buffer": "0.01",
            "response": "slow",
            "robots.left.response.kind": "stop",
            "response.evade": "true",
            "robots.right.stopping.sensing": "0.004",
            "guard.budget": "512",
        },
    )
    left, right = made.scene.robots.values()
    assert (left.mode, right.mode) == ("speed", "speed")
    assert (left.response.kind, right.response.kind) == ("stop", "slow")
    assert left.response.evade
    assert right.stopping.sensing == 0.004
    assert left.stopping.sensing == bay_scene("path").robots["left"].stopping.sensing
    assert (made.scene.buffer, made.budget) == (0.01, 512)
    for name, value, words in (
        ("guard.mod", "speed", "did you mean 'guard.mode'"),
        ("response", "slwo", "did you mean 'slow'"),
        ("guard.mode", "fats", "none of them"),
        ("scene.buffer", "-1", ">= 0"),
        ("scene.buffer", "thick", "no number"),
        ("response.evade", "yes", "true or false"),
        ("response.far", "0", "must be > 0"),
        ("robots.lft.mode", "path", "did you mean 'robots.left.mode'"),
        ("scene.margin", "0.001", "larger than the margin"),
    ):
        with pytest.raises(SettingError, match=words):
            change(bay_scene("path"), 1024, {name: value})


def test_the_same_settings_make_no_difference(drive):
    folder, tape = drive
    same = compare(open_recording(folder), {"response": "stop"})
    assert same.first_difference is None
    assert same.commands == 0
    assert same.cycles == tape.k
    assert [stop.cycle for stop in same.recorded.stops] == tape.stops
    assert same.recorded.seconds_at_level == same.changed.seconds_at_level
    assert not same.gone
    assert not same.new
    assert sum(same.recorded.seconds_at_level.values()) == pytest.approx(
        tape.k * PERIOD
    )


def test_a_stop_goes_with_a_smaller_buffer_and_others_come_with_a_larger_one(drive):
    folder, tape = drive
    less = compare(open_recording(folder), {"scene.buffer": "0.0"})
    assert [stop.cycle for stop in less.gone] == tape.stops
    assert less.new == []
    assert less.first_difference is not None
    assert less.first_difference["cycle"] <= tape.stops[0]
    assert less.changed.least_headroom > less.recorded.least_headroom
    more = compare(open_recording(folder), {"scene.buffer": "0.2"})
    assert more.new
    assert (
        more.changed.seconds_at_level["STOP"] > more.recorded.seconds_at_level["STOP"]
    )


def test_a_guard_without_prediction_is_another_one(drive):
    folder, tape = drive
    fixed = compare(open_recording(folder), {"guard.mode": "fixed"})
    assert fixed.cycles == tape.k
    assert fixed.changed.seconds_at_level["SLOW"] == 0.0
    speed = compare(open_recording(folder), {"guard.mode": "speed"})
    assert len(speed.changed.stops) >= len(speed.recorded.stops)


def test_a_recording_in_mode_fixed_is_asked_what_prediction_would_say(tmp_path):
    scene = bay_scene("fixed")
    guard = Guard(scene, self_test=False)
    ring = RingWriter(tmp_path / "ring", 8 << 20)
    at = [0.0]
    taped = RecordedGuard(guard, ring, monotonic=lambda: at[0], wall=lambda: at[0])
    taped.describe(scene, {})
    taped.checkpoint()
    q = guard.home
    for k in range(200):
        at[0] = k * 1e-3
        q = q + 2e-4
        taped.step(q, at[0])
    recorder = Recorder(tmp_path / "tapes", RecorderSettings())
    for row in RingReader(tmp_path / "ring").unread():
        recorder.take(row)
    recorder.end()
    recording = open_recording(tmp_path / "tapes")
    assert replay(recording).sentence == "200 cycles, bit-identical"
    path = compare(recording, {"guard.mode": "path"})
    assert path.cycles == 200
    assert path.recorded.stops == []
    assert path.first_difference is not None


def test_the_command_line_reports_it_as_json_and_by_its_exit_code(drive):
    folder, tape = drive

    def run(*options):
        arguments = [sys.executable, "-c", REPLAY, "replay", str(folder), *options]
        return subprocess.run(
            arguments, capture_output=True, text=True, timeout=300, check=False
        )

    answer = run("--set", "scene.buffer=0.0", "--json")
    assert answer.returncode == 1
    report = json.loads(answer.stdout)
    assert [stop["cycle"] for stop in report["stops_gone"]] == tape.stops
    assert "does not obey" in report["caveat"]
    assert report["exit_code"] == 1
    answer = run("--set", "guard.mod=path")
    assert answer.returncode == 2
    assert "did you mean 'guard.mode'" in " ".join(answer.stderr.split())


def test_a_scene_comes_back_from_its_archive_to_the_last_bit(drive):
    folder, tape = drive
    made = open_recording(folder).scene()
    again = scene_of(archive_of(made))
    tables, others = compile_scene(tape.scene), compile_scene(again)
    for name in ("local_rows", "buffers", "checked", "T_parent_joint", "home", "gain"):
        assert getattr(tables, name).tobytes() == getattr(others, name).tobytes()
    assert again.notes == tape.scene.notes
    for wrong in (b"", b"nothing", archive_of(made)[:-20]):
        with pytest.raises(ArchiveError):
            scene_of(wrong)
    tape.scene._objects["odd"] = changed(tape.scene.objects["ball"], name=object())
    with pytest.raises(ArchiveError, match="only this program knows"):
        archive_of(tape.scene)
    del tape.scene._objects["odd"]
