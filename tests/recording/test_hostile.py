"""Recordings that lie, with right checksums: one sentence each, never a crash."""

import json
import struct
import zlib

import numpy as np
import pytest
import zstandard
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.errors import ArmguardError, RecordingError
from armguard.recording import open_recording
from armguard.recording.blocks import HEAD, unpack_block
from armguard.recording.frames import HEADER, IN_FRAME, Kind
from armguard.recording.mcap_file import McapFile, unpacked
from armguard.recording.motions import load_motion
from armguard.recording.recording import (
    ABOUT,
    SCENE,
    about_of,
    plausible_frame,
)
from armguard.scene.archive import ArchiveError, scene_of
from attack.recordings import run


def recording_of(path, about=b"{}", scene=b"", messages=()):
    """A recording of made-up parts."""
    with path.open("wb") as out:
        file = McapFile(out.write, "somebody", {})
        file.attach(ABOUT, "application/json", about, 0)
        file.attach(SCENE, "", scene, 0)
        for message in messages:
            file.add(message)
        file.end()
    return path


def test_mutants_end_in_an_answer_or_a_sentence():
    found = run(300, seed=1)
    for figures in found.values():
        assert figures["signals"] == 0, figures
        assert figures["tracebacks"] == 0, figures["traces"]
        assert figures["accepted"] > 0
        assert figures["grown_mb"] < 1000
        assert figures["longest_s"] < 20


@pytest.mark.parametrize(
    "about",
    [
        b"[]",
        b"3",
        b"\xff\xff",
        b"[" * 200_000,
        b'{"names": 7}',
        b'{"robots": [1]}',
        b'{"period": "soon"}',
        b'{"period": NaN}',
        b'{"budget": 1e400}',
    ],
)
@pytest.mark.parametrize("command", ["replay", "report"])
def test_what_a_recording_says_of_itself_is_read_as_a_strangers(
    about, command, tmp_path
):
    path = recording_of(tmp_path / "some.mcap", about)
    for read in (open_recording, load_motion):
        with pytest.raises(RecordingError):
            read(path)
    # As `main` leaves it: an error of ours, which is one sentence and exit code 2.
    answer = CliRunner().invoke(app, [command, str(path)])
    assert isinstance(answer.exception, RecordingError)


@pytest.mark.parametrize(
    "scene",
    [
        zlib.compress(b"[" * 200_000),
        zlib.compress(b"[]"),
        zlib.compress(b'{"form": 1}'),
        zlib.compress(json.dumps({"form": 1, "mode": {"$": "Box"}}).encode()),
        b"nothing",
    ],
)
def test_a_scene_that_is_none_is_refused(scene, tmp_path):
    path = recording_of(tmp_path / "some.mcap", b"{}", scene)
    for command in ("replay", "report"):
        answer = CliRunner().invoke(app, [command, str(path)])
        assert isinstance(answer.exception, ArmguardError)


def test_a_scene_that_unpacks_to_more_than_any_takes_is_refused_before_it_does():
    bomb = zlib.compressobj()
    data = b"".join(bomb.compress(bytes(1 << 24)) for _ in range(64)) + bomb.flush()
    assert len(data) < 2 << 20
    with pytest.raises(ArchiveError, match="MiB"):
        scene_of(data)


def test_sizes_are_looked_at_before_room_is_made():
    small = zstandard.compress(bytes(100))
    assert unpacked(small, 100) == bytes(100)
    large = zstandard.compress(bytes(1 << 30))
    for size in (100, 1 << 20):
        with pytest.raises(ValueError, match="compressed"):
            unpacked(large, size)
    for count, width in ((64, 1 << 24), (0, 5), (1, 0), (1 << 31, 1 << 31)):
        with pytest.raises(ValueError, match="frames"):
            list(unpack_block(HEAD.pack(count, width) + small))


def test_a_chunk_whose_messages_lie_about_their_length_is_read_as_far_as_it_goes():
    from armguard.recording.mcap_file import messages

    for length in (1, 3, 21, 1 << 62):
        assert [*messages(struct.pack("<BQ", 5, length) + bytes(20))] == []


def test_a_frame_that_cannot_be_is_left_out():
    row = np.zeros(HEADER)
    row[IN_FRAME.kind] = Kind.CHECKPOINT
    assert plausible_frame(row, 3, 1).kind is Kind.CHECKPOINT
    for name in ("kind", "cycle", "monotonic", "joints"):
        for value in (np.inf, -np.inf, np.nan, 1e300, -1.0):
            if name == "monotonic" and value == -1.0:
                continue
            wrong = row.copy()
            wrong[getattr(IN_FRAME, name)] = value
            with pytest.raises(ValueError, match=r"\w"):
                plausible_frame(wrong, 3, 1)
    with pytest.raises(ValueError, match="numbers"):
        wrong = row.copy()
        wrong[IN_FRAME.kind] = Kind.CYCLE
        plausible_frame(wrong, 3, 1)


def test_what_a_recorder_says_is_believed():
    about = {"names": ["arm/a"], "robots": ["arm"], "period": 0.004, "budget": 1024}
    assert about_of(json.dumps(about).encode()) == about


@pytest.mark.parametrize("made", [b'"layout": 99, ', b'"layout": "new", ', b""])
def test_a_recording_of_another_layout_is_refused_and_says_what_to_do(tmp_path, made):
    about = b"{" + made + b'"recorder": "0.1.0", "names": ["arm/joint1"]}'
    path = recording_of(tmp_path / "recording-old.mcap", about)
    with pytest.raises(RecordingError) as refused:
        open_recording(path)
    sentence = str(refused.value)
    assert "layout" in sentence
    assert "read it with the version that recorded it, 0.1.0" in sentence
