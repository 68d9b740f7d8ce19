"""The processes of the demo: a person's stop stays until a person lifts it."""

import signal
import time
from pathlib import Path

import numpy as np
import pytest

from armguard.guard.layout import HEADER, IN_ROBOT, ROBOT_WIDTH
from armguard.guard.levels import Reason
from armguard.recording.counters import CountersReader
from armguard.recording.frames import Kind, frame_of
from armguard.scene.bay import bay_path
from armguard.simulation.stage import Stage

# A busy machine may be late for that long [s].
LATE = 0.4

# Nothing is waited for longer [s].
PATIENCE = 60.0

# The operator engages what the guard stopped after 0.6 s; after a stop by a person the
# operator is watched for this long [s].
WATCHED = 4.0


@pytest.fixture
def stage(tmp_path):
    """Service, arms and the operator of the demo."""
    text = bay_path().read_text(encoding="utf-8")
    text = text.replace("stale: 0.010", f"stale: {LATE}")
    text = text.replace("urdf: bay_arm.urdf", f"urdf: {bay_path().parent}/bay_arm.urdf")
    file = tmp_path / "bay.yaml"
    file.write_text(text, encoding="utf-8")
    options = ("--rate=100", f"--late={LATE}", "--mode=path", "--no-self-test")
    with (
        (tmp_path / "log").open("wb") as log,
        Stage(str(file), *options, log=log) as it,
    ):
        it.start_service()
        it.wait_for_service()
        it.start_arms()
        it.start_operator(seed=1)
        yield it


class Watched:
    """What the service wrote into its ring."""

    def __init__(self, stage):
        self.stage, self.reader = stage, stage.frames()

    def cycles(self):
        """Cycles since the last call."""
        frames = map(frame_of, self.reader.unread())
        return [frame for frame in frames if frame.kind is Kind.CYCLE]

    def until(self, done):
        """Wait for a cycle; it."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            self.stage.check()
            for frame in self.cycles():
                if done(frame):
                    return frame
            time.sleep(0.02)
        raise AssertionError("no such cycle came")


def moves(frame):
    """Whether any joint is commanded to move."""
    return frame.told[: len(frame.q)].any()


def held_by(frame):
    """Why each robot that is held was stopped."""
    causes = frame.verdict[HEADER + IN_ROBOT.cause :: ROBOT_WIDTH][: len(frame.stamps)]
    held = ~np.isnan(frame.told[-len(frame.stamps) :])
    return {Reason(int(cause)) for cause in causes[held]} if held.all() else set()


def test_a_stop_of_a_person_stays_until_a_person_lifts_it(stage):
    watched = Watched(stage)
    watched.until(moves)
    stage.client.stop()
    watched.until(lambda frame: held_by(frame) == {Reason.STOP_ORDERED})
    end = time.monotonic() + WATCHED
    seen = 0
    while time.monotonic() < end:
        time.sleep(0.05)
        for frame in watched.cycles():
            seen += 1
            assert not moves(frame)
            assert held_by(frame) == {Reason.STOP_ORDERED}
    assert seen > 20
    # The button that a person presses.
    stage.crew["operator"].send_signal(signal.SIGUSR1)
    watched.until(moves)


def test_what_the_guard_stopped_goes_on_without_a_person(stage):
    watched = Watched(stage)
    watched.until(moves)
    stage.crew["arms"].send_signal(signal.SIGSTOP)
    try:
        stopped = (Reason.STATE_STALE, Reason.CYCLE_LATE)
        watched.until(lambda f: Reason(int(f.verdict[0])) in stopped)
    finally:
        stage.crew["arms"].send_signal(signal.SIGCONT)
    watched.until(lambda frame: not moves(frame))
    watched.until(moves)
    counters = CountersReader(Path(stage.client.welcome.counters))
    assert counters.value("stop_orders") == 0
