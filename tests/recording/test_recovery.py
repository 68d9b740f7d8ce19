"""Damaged recordings: all that is whole comes back, and what is missing is named."""

import numpy as np
import pytest

from armguard.errors import RecordingError
from armguard.recording import open_recording
from armguard.recording.frames import Kind
from armguard.recording.mcap_file import BEHIND, COMPRESSED, chunk_at
from armguard.recording.replay import replay


def cycles_of(path):
    """Numbers of the cycles a file still holds, and what it says is wrong with it."""
    recording = open_recording(path)
    found = [f.cycle for f in recording.frames() if f.kind is Kind.CYCLE]
    return found, recording.problems


def chunks_of(path, data):
    """Where each chunk starts and ends, and the cycles that are in it."""
    spans, at = [], 0
    while (tag := data.find(COMPRESSED, at)) >= 0:
        whole = chunk_at(data, tag - BEHIND)
        at = tag + 1
        if whole is not None:
            at = whole[1]
            spans.append((tag - BEHIND, at))
    part = path.with_name("part.mcap")
    cycles, before = [], 0
    for _, end in spans:
        part.write_bytes(data[:end])
        now = len(cycles_of(part)[0])
        cycles.append((before, now))
        before = now
    return [(*span, *own) for span, own in zip(spans, cycles, strict=True)]


@pytest.fixture(scope="module")
def small(drive, tmp_path_factory):
    """A small file, its bytes, its chunks, and all its cycles."""
    folder, _ = drive
    (near,) = folder.glob("near-miss-*.mcap")
    path = tmp_path_factory.mktemp("damage") / "small.mcap"
    data = near.read_bytes()
    path.write_bytes(data)
    cycles, problems = cycles_of(path)
    assert problems == []
    return path, data, chunks_of(path, data), cycles


def test_cut_at_every_997th_byte_every_whole_chunk_comes_back(small):
    path, data, chunks, cycles = small
    assert len(chunks) > 3
    cut = path.with_name("cut.mcap")
    for end in range(997, len(data), 997):
        cut.write_bytes(data[:end])
        found, problems = cycles_of(cut)
        kept = max((last for _, to, _, last in chunks if to <= end), default=0)
        assert found == cycles[:kept], end
        assert any("cut off" in problem for problem in problems), end


def test_one_wrong_bit_costs_the_chunk_it_is_in_and_nothing_else(small):
    path, data, chunks, cycles = small
    rng = np.random.default_rng(0)
    flipped = path.with_name("flipped.mcap")
    places = [int(p) for p in rng.integers(0, len(data), 150)]
    # And all of what says how long a chunk is, where most can go wrong.
    places += [chunks[1][0] + k for k in range(BEHIND + len(COMPRESSED) + 8)]
    for place in places:
        wrong = bytearray(data)
        wrong[place] ^= 1 << int(rng.integers(8))
        flipped.write_bytes(wrong)
        recording = open_recording(flipped)
        found = [f.cycle for f in recording.frames() if f.kind is Kind.CYCLE]
        hit = [own for own in chunks if own[0] <= place < own[1]]
        expected = list(cycles)
        if hit and found != cycles:
            (_, _, first, last) = hit[0]
            expected = cycles[:first] + cycles[last:]
            assert any("damaged" in p for p in recording.problems), place
        assert found == expected, place
        # What it is about is there twice.
        assert recording.names
        assert recording.scene().q_names == recording.names


def test_what_is_behind_a_gap_is_judged_again_from_the_next_checkpoint_on(drive):
    folder, tape = drive
    (path,) = folder.glob("recording-*.mcap")
    data = bytearray(path.read_bytes())
    chunks = chunks_of(path, bytes(data))
    path.with_name("part.mcap").unlink()
    start, end, first, last = chunks[len(chunks) // 2]
    data[(start + end) // 2] ^= 16
    damaged = folder.parent / "damaged.mcap"
    damaged.write_bytes(data)
    answer = replay(open_recording(damaged))
    assert answer.identical
    assert answer.cycles + answer.skipped == tape.k - (last - first)
    assert 0 < answer.skipped <= tape.checkpoints
    assert f"cycles {first} to {last - 1} are missing" in answer.problems


def test_what_is_no_recording_is_refused_in_words(tmp_path):
    for name, content in (("empty", b""), ("other", b"x" * 5000)):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(content)
        if not content:
            with pytest.raises(RecordingError, match="nothing can be read"):
                open_recording(path)
            continue
        recording = open_recording(path)
        assert list(recording.frames()) == []
        assert len(recording.problems) == 3
        with pytest.raises(RecordingError, match="this is no MCAP file"):
            recording.scene()
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "none")
    with pytest.raises(RecordingError, match="no recording-"):
        open_recording(tmp_path)
