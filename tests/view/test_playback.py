"""A recording on a time line: where it is, what it shows, where it goes."""

from pathlib import Path

import numpy as np
import pytest

from armguard import Guard, bay_scene
from armguard.recording.calls import Engage
from armguard.recording.frames import Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.view.recorded_view import Playback

PERIOD = 0.01
CYCLES = 20


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Two seconds of an arm at rest; one cycle in which nothing could be read."""
    path = Path(tmp_path_factory.mktemp("ring")) / "ring"
    clock = iter(100.0 + PERIOD * np.arange(10 * CYCLES) / 2.0)
    scene = bay_scene("path")
    scene.period = PERIOD
    guard = Guard(scene, self_test=False)
    taped = RecordedGuard(guard, RingWriter(path), monotonic=lambda: next(clock))
    for k in range(CYCLES):
        q = np.full_like(guard.home, np.nan) if k == 12 else guard.home
        taped.step(q, k * PERIOD, velocity=np.zeros_like(guard.home))
        taped.do(Engage())
    return [frame_of(row) for row in RingReader(path).unread()]


@pytest.fixture
def played(frames):
    now = [0.0]
    playback = Playback(frames, 2, clock=lambda: now[0])
    return playback, now


def test_time_passes_only_while_it_plays(played, frames):
    playback, now = played
    cycles = [frame for frame in frames if frame.kind is Kind.CYCLE]
    assert playback.length == pytest.approx(cycles[-1].monotonic - 100.0)
    assert playback.newest is cycles[0]
    now[0] = 5.0
    assert playback.newest is cycles[0]
    playback.play(True)
    now[0] = 5.0 + 3.25 * PERIOD
    assert playback.newest is cycles[3]
    assert len(playback.events()) == 3
    playback.set_speed(0.5)
    now[0] += 2.0 * PERIOD
    assert playback.newest is cycles[4]
    now[0] += 100.0
    assert not playback.playing
    assert playback.newest is cycles[-1]
    playback.play(True)
    assert playback.newest is cycles[0]


def test_it_steps_and_goes_anywhere_and_back(played, frames):
    playback, _ = played
    cycles = [frame for frame in frames if frame.kind is Kind.CYCLE]
    playback.step(3)
    assert playback.newest is cycles[3]
    playback.step(-2)
    assert playback.newest is cycles[1]
    playback.step(-9)
    assert playback.newest is cycles[0]
    playback.go(7.2 * PERIOD)
    assert playback.newest is cycles[7]
    playback.go(1e9)
    assert playback.newest is cycles[-1]


def test_it_goes_from_stop_to_stop(played, frames):
    playback, _ = played
    first = [f.monotonic for f in frames if f.kind is Kind.CYCLE][12] - 100.0
    assert playback.stops[0] == pytest.approx(first)
    playback.to_stop(forward=True)
    assert playback.position == pytest.approx(first)
    playback.go(playback.length)
    playback.to_stop(forward=False)
    assert playback.position == pytest.approx(playback.stops[-1])
    playback.to_stop(forward=False)
    assert playback.position <= first


def test_an_empty_recording_shows_nothing():
    playback = Playback([], 2)
    assert playback.newest is None
    assert playback.length == 0.0
    playback.step(1)
    playback.to_stop(forward=True)
    playback.play(True)
    assert not playback.playing
