"""A guard of the bay that is recorded while it is driven, for the tests beside."""

import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from armguard import Guard, bay_scene
from armguard.geometry import Pose, Sphere
from armguard.recording.calls import Engage, Place
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.ring import RingReader, RingWriter

PERIOD = 0.004

# Sooner or later everything is over [s].
PATIENCE = 30.0


class Tape:
    """A recorded guard, its ring, arms that obey, and time that is not the clock's.

    Args:
        folder: Where the ring is made.
        response: Response of both arms.
        checkpoints: Cycles between two checkpoints.
    """

    def __init__(self, folder, response="stop", checkpoints=250, seed=0, size=64 << 20):
        self.scene = bay_scene("path")
        self.scene.period = PERIOD
        for name, robot in self.scene.robots.items():
            kind = replace(robot.response, kind=response)
            self.scene._robots[name] = replace(robot, response=kind)
        self.scene.add(Sphere(radius=0.05), name="ball", present=False)
        self.guard = Guard(self.scene, self_test=False)
        self.path = folder / "ring"
        self.ring = RingWriter(self.path, size)
        self.k = 0
        self.tape = RecordedGuard(
            self.guard, self.ring, monotonic=lambda: 1e3 + self.t,
            wall=lambda: 1.7e9 + self.t,
        )  # fmt: skip
        self.rng = np.random.default_rng(seed)
        self.q, self.v = self.guard.home, np.zeros(14)
        self.goal = self.q.copy()
        self.checkpoints = checkpoints
        self.stops = []
        self.last = 0

    @property
    def t(self):
        return self.k * PERIOD

    def begin(self):
        """Write what a service writes before its first cycle."""
        self.tape.describe(self.scene, {"scene_file": "bay"})
        self.tape.checkpoint()

    def cycle(self):
        """One cycle towards a goal that is another one every second."""
        self.k += 1
        if self.k % 250 == 1:
            self.goal = self.guard.home + self.rng.uniform(-1.2, 1.2, 14)
            self.tape.do(Engage())
        if self.k % self.checkpoints == 0:
            self.tape.checkpoint()
        desired = np.clip(2.0 * (self.goal - self.q), -1.0, 1.0)
        q = self.q + self.rng.uniform(-2e-5, 2e-5, 14)
        v = self.v + self.rng.uniform(-1e-3, 1e-3, 14)
        command = self.tape.filter(q, desired, self.t - 1e-3, velocity=v, now=self.t)
        level = command.verdict.level
        if level >= 30 > self.last:
            self.stops.append(self.k - 1)
        self.last = level
        self.v = command.velocity
        self.q = self.q + self.v * PERIOD
        return command

    def drive(self, seconds, each=lambda: None):
        """So many seconds of cycles."""
        for _ in range(int(seconds / PERIOD)):
            self.cycle()
            each()

    def ball(self):
        """A ball comes and goes."""
        self.tape.do(Place(name="ball", pose=Pose(xyz=(0.1, 0.0, 1.1))))

    def close(self):
        self.ring.close()


def record_here(tape, folder, seconds, **settings):
    """Drive a tape for a while and record it in this process."""
    recorder = Recorder(folder, RecorderSettings(**settings))
    reader = RingReader(tape.path)
    count = 0

    def each():
        nonlocal count
        for row in reader.unread():
            recorder.take(row)
        count += 1
        if count % 100 == 0:
            recorder.flush()

    tape.drive(seconds, each)
    for row in reader.unread():
        recorder.take(row)
    recorder.end()
    return recorder


@contextmanager
def start_recorder(ring, folder, *more, **environment):
    """The recorder as a process, which does not outlive the test."""
    arguments = [sys.executable, "-m", "armguard.recording"]
    arguments += ["--ring", str(ring), "--folder", str(folder), *more]
    process = subprocess.Popen(
        arguments, stderr=subprocess.PIPE, text=True, **environment
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


def wait_until(holds, patience=PATIENCE):
    """Wait for something; whether it came."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.02)
    return False
