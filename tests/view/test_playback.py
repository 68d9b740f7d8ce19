"""A recording on a time line: where it is, what it shows, where it goes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armguard import Guard, bay_scene
from armguard.recording.calls import Engage
from armguard.recording.frames import Kind, frame_of
from armguard.recording.palette import State
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.view.recorded_view import PIECES, Playback, RecordedView, thinned

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


def test_the_time_line_has_the_level_of_a_stop_while_a_robot_is_held(frames):
    cycles = [frame for frame in frames if frame.kind is Kind.CYCLE][:3]
    # Since when each of two robots is held, before two other numbers of each.
    commanded = [
        np.array([*[0.0] * 60, since, np.nan, 0.0, 0.0]) for since in (np.nan, 1.0)
    ]
    held = [
        replace(frame, told=commanded[at])
        for frame, at in zip(cycles, (0, 1, 0), strict=True)
    ]
    before, after = Playback(cycles, 2), Playback(held, 2)
    assert before.states[0][1] < State.STOP and len(before.states) == 1
    assert [state for _, state in after.states] == [
        before.states[0][1],
        State.HELD,
        before.states[0][1],
    ]
    assert after.stops == before.stops == ()


def test_an_empty_recording_shows_nothing():
    playback = Playback([], 2)
    assert playback.newest is None
    assert playback.length == 0.0
    playback.step(1)
    playback.to_stop(forward=True)
    playback.play(True)
    assert not playback.playing


def test_a_recording_opens_at_its_first_stop_and_its_time_line_steers(frames):
    view = RecordedView(bay_scene("path"), frames, 0)
    try:
        playback = view.source
        assert playback.position == pytest.approx(playback.stops[0])
        line = json.loads(view.page.newest["timeline"])
        assert line["stops"] == pytest.approx(playback.stops)
        assert line["length"] == pytest.approx(playback.length)
        assert [at for at, _ in line["states"]] == [at for at, _ in playback.states]
        assert any(state >= State.STOP for _, state in playback.states)
        first = playback.newest.cycle
        for message, cycle in (
            ({"type": "seek", "cycles": -1}, first - 1),
            ({"type": "seek", "stop": 1}, first),
            ({"type": "seek", "at": 0.0}, 0),
        ):
            view._received("one", message)
            view.step()
            plotted = view.plot._points
            assert len(plotted) == cycle + 1
            assert plotted[-1][0] == playback.newest.monotonic
            assert playback.newest.cycle == cycle
        view._received("one", {"type": "speed", "value": 4.0})
        view._received("one", {"type": "speed", "value": 1e9})
        assert playback.speed == 4.0
        frame = playback.newest
        assert view.when(replace(frame, wall=1e9)) == "recorded 2001-09-09 01:46:40 UTC"
        assert view.when(replace(frame, wall=3.0)) == f"at {frame.monotonic:.2f} s"
        view._published = -np.inf
        view.step()
        state = json.loads(view.page.newest["state"])
        assert (state["position"], state["playing"]) == (0.0, False)
        view._received("one", {"type": "play"})
        assert playback.playing
    finally:
        view.close()


def test_a_long_time_line_keeps_every_stop_and_no_stop_lasts_longer():
    # A stop of a millisecond every second, over three hours.
    states = [
        (float(s) + part, state)
        for s in range(3 * 3600)
        for part, state in ((0.0, State.CLEAR), (0.5, State.STOP), (0.501, State.CLEAR))
    ][: 3 * 3000]
    length = 10800.0
    short = thinned(states, length)
    assert len(short) <= PIECES
    assert {state for at, state in short if at < 2990.0} == {State.STOP}
    # After the last of them it is clear to the end.
    assert short[-1][1] == State.CLEAR
    assert short[-1][0] < 3000.0 + 2 * length / PIECES
