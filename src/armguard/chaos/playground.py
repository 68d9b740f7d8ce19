"""A running guard to play faults against, and its observers."""

import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armguard.chaos.processor import waits
from armguard.chaos.relay import Relay
from armguard.errors import ArmguardError, StationError
from armguard.recording.counters import CountersReader
from armguard.recording.ring import RingReader
from armguard.scene.scene import Scene
from armguard.scene.sensing import SENSED, UNSEEN
from armguard.service.client import Answer, Client
from armguard.service.wire import Role, Seal, read_keys
from armguard.service.wire.keys import keys_path
from armguard.simulation.stage import LONGEST_START, Stage

Floats = NDArray[np.float64]

# An arm moves if one of its joints is faster than this [rad/s or m/s].
MOVES = 0.005

# How long arms must have moved without a stop before a fault is played [s].
CALM = 0.25

# How long they get to begin with that, and how often they are engaged till then [s].
PATIENCE, ENGAGES = 30.0, 0.3

# Silence of the reflex that stops arms; time between two frames of a zone sensor, and
# its silence that the reflex takes for a fault [s].
REFLEX_WATCHDOG, FRAME_PERIOD, FRAME_TIMEOUT = 0.2, 1.0 / 15.0, 0.3

# Longest wait for one answer while watching [s].
LOOK = 0.02


class Playground:
    """Service, relay, simulated arms behind it, an operator, and an observer.

    Attributes:
        stage: The processes.
        scene: The scene.
        began: When the last fault began, monotonic [s].
        before: What the service had counted then.
        answers: What the observer has received since the last fault began.
        truth: What the arms really did since then, rows of time, whether each arm is
            held, positions and velocities.
        least: Least distance of the nearest pair of bodies so far [m].
        late: How late a cycle may come [s].

    Args:
        what: A scene file, or a bundled scene.
        scene: See there.
        folder: Where files go.
        options: Further arguments of the service.
        rate: Its rate [Hz].
        late: How late a cycle may come [s].
        slack: Delay that other work of the machine may add to any time [s].
    """

    def __init__(
        self,
        what: str,
        scene: Scene,
        folder: Path,
        *options: str,
        rate: float = 250.0,
        late: float = 0.012,
        slack: float = 0.15,
    ) -> None:
        self.began = 0.0
        self.before: Mapping[str, int] = {}
        self.slack = slack
        self.folder = folder
        self.answers: list[Answer] = []
        self.truth: list[Floats] = []
        self.least = np.inf
        self._what, self.scene = what, scene
        self._log = (folder / "log").open("ab")
        self.late, self._rate = late, rate
        # What every thread had waited for a processor at the last look, when that was,
        # and the most that one waited from a look to the next [s].
        self._waits: Mapping[int, float] = {}
        self._looked = self._waited = 0.0
        self._options = (
            "--rate", str(rate), "--late", str(late), "--no-self-test", *options
        )  # fmt: skip
        if scene.sensing is not None:
            # Without sensors no arm moves there.
            self._options += ("--simulated-sensors",)
        self._relay: Relay | None = None
        # Whether no fault has begun since all arms moved.
        self._settled = False
        self.stage, self._observer = self._new_stage()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
        self._log.close()

    @property
    def seal(self) -> Seal:
        """Seal of the messages of arms and operator."""
        return Seal(read_keys(keys_path(self.stage.port))[Role.COMMAND])

    @property
    def relay(self) -> Relay:
        """The relay between the service and arms and operator."""
        assert self._relay is not None, "nothing was started yet"
        return self._relay

    def start(self, *launch: str, options: tuple[str, ...] = ()) -> None:
        """Start everything.

        Args:
            launch: Arguments with which Python runs the command line, see `Stage`.
            options: Further arguments of the service, this time.
        """
        self._settled = False
        self.stage.options = (*self._options, *options)
        self.stage.start_service(*launch)
        self.stage.wait_for_service()
        self._relay = Relay(self.stage.port)
        self.start_arms()
        self.start_operator()
        self._listen_again()

    def restart(self, *launch: str, options: tuple[str, ...] = ()) -> None:
        """End everything and start it anew."""
        self.close()
        self.stage, self._observer = self._new_stage()
        self.start(*launch, options=options)

    def start_arms(self) -> None:
        """Start the arms, with a new trace."""
        path = self.folder / f"truth-{time.monotonic_ns()}"
        self.stage.start_arms(self.relay.port, path)
        end = time.monotonic() + LONGEST_START
        while time.monotonic() < end:
            try:
                self._truth = RingReader(path)
                return
            except StationError:
                self.stage.check()
                time.sleep(LOOK)
        raise StationError("the simulated arms do not start")

    def start_operator(self) -> None:
        """Start the operator, which makes the arms sway."""
        self.stage.start_operator(self.relay.port)

    def close(self) -> None:
        """End everything."""
        self._observer.close()
        if self._relay is not None:
            self._relay.close()
            self._relay = None
        self.stage.close()

    def settle(self) -> None:
        """Engage arms until all of them move and none is stopped.

        They do already if no fault has begun since.

        Raises:
            StationError: They do not in time.
        """
        if self._settled:
            return
        end = time.monotonic() + PATIENCE
        engage_at, calm_since = 0.0, np.inf
        while (now := time.monotonic()) < end:
            self.forget()
            self.watch(LOOK)
            free = self.answers and not any(a.stops for a in self.answers)
            if free and self.truth and self._moves(self.truth[-1]):
                calm_since = min(calm_since, now)
                if now - calm_since >= CALM:
                    self._settled = True
                    return
                continue
            calm_since = np.inf
            # An operator without the command cannot engage.
            if now >= engage_at and self.answers and self.answers[-1].commander:
                engage_at = now + ENGAGES
                self._engage()
        raise StationError(
            f"arms do not move again within {PATIENCE:.0f} s: {self._last_words()}"
        )

    def begin(self) -> None:
        """A fault begins now."""
        self._settled = False
        self.forget()
        self.began = time.monotonic()
        self.before = dict(self.counters())
        self._look_at_waits()
        self._waited = 0.0

    def waited(self) -> float:
        """The longest wait of one thread for a processor since the fault began [s].

        Of service, arms, operator and this process, and from one look to the next,
        which are 20 ms apart; infinite where the machine does not count it.
        """
        self._look_at_waits()
        return self._waited

    def risen(self, names: Sequence[str]) -> Mapping[str, int]:
        """By how much counters have risen since the fault began."""
        now = self.counters()
        return {name: now.get(name, 0) - self.before.get(name, 0) for name in names}

    def forget(self) -> None:
        """Watch as if nothing had been seen yet."""
        self.answers, self.truth = [], []

    def watch_until(self, done: Callable[[], bool], seconds: float) -> None:
        """Watch until something is true, or for some time."""
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end:
            self.watch(LOOK)

    def watch(self, seconds: float) -> None:
        """Keep answers and states of arms for some time; what is there if 0."""
        end, left = time.monotonic() + seconds, seconds
        while True:
            wait = min(max(left, 0.0), LOOK)
            answer = None
            if self._observer.connected:
                answer = self._observer.receive(timeout=wait)
            else:
                time.sleep(wait)
            while answer is not None:
                self.answers.append(answer)
                near = answer.nearest
                # Cells are no bodies: those of a sensor at fault may be anywhere.
                if near is not None and not {SENSED, UNSEEN} & {near.a, near.b}:
                    self.least = min(self.least, near.distance)
                answer = self._observer.receive()
            self.truth.extend(self._truth.unread())
            now = time.monotonic()
            if now - self._looked >= LOOK:
                self._look_at_waits()
            left = end - now
            if left <= 0.0:
                return

    def listen_again(self) -> None:
        """Find a service that was started anew."""
        self.stage.wait_for_service()
        self._listen_again()

    def counters(self) -> Mapping[str, int]:
        """What the service has counted; nothing if it is not there."""
        try:
            return CountersReader(Path(self.stage.client.welcome.counters)).values()
        except ArmguardError:
            return {}

    def delay(self, name: str) -> float:
        """A declared delay by its name in `Fault.within` [s]."""
        figures = [r.stopping for r in self.scene.robots.values() if r.stopping]
        stale = max(f.stale for f in figures)
        period = 1.0 / self._rate
        delays: Mapping[str, Callable[[], float]] = {
            "cycle": lambda: period + self.late,
            "stale": lambda: stale,
            # As long as a joint is led along by 80 ms of commands.
            "hangs": lambda: 0.2,
            "desired": lambda: 0.1,
            "client": lambda: 0.1,
            "commander": lambda: 0.5,
            "pause": lambda: 0.5,
            "reflex": lambda: REFLEX_WATCHDOG,
            "frame": lambda: FRAME_PERIOD,
            "frames": lambda: FRAME_TIMEOUT,
            # Age of cells that stops the arms, and frames until a fault is certain.
            "cells": lambda: self.scene.sensing.stale if self.scene.sensing else 0.0,
            "sensor": lambda: 6.0 * max(s.period for s in self.scene.sensors.values()),
        }
        return delays[name]()

    @property
    def stopping_time(self) -> float:
        """Longest time from an order until an arm rests and is held [s]."""
        times = []
        for robot in self.scene.robots.values():
            figures = robot.stopping
            assert figures is not None
            brakes = figures.velocity / figures.deceleration
            own = figures.command + figures.ramp + figures.settle_time
            times.append(own + float(brakes.max()))
        return max(times)

    def held(self, row: Floats) -> bool:
        """Whether all arms are held in a row of the truth."""
        return bool(row[1 : 1 + len(self.scene.robots)].all())

    def rests(self, row: Floats) -> bool:
        """Whether no joint moves in a row of the truth."""
        n = len(self.scene.q_names)
        return bool((np.abs(row[-n:]) < MOVES).all())

    def _moves(self, row: Floats) -> bool:
        """Whether every arm moves in a row of the truth."""
        velocities = row[-len(self.scene.q_names) :]
        first = 0
        for robot in self.scene.robots.values():
            count = len(robot.model.q_names)
            if not (np.abs(velocities[first : first + count]) > MOVES).any():
                return False
            first += count
        return not row[1 : 1 + len(self.scene.robots)].any()

    def _look_at_waits(self) -> None:
        """Note what threads have waited for a processor since the last look."""
        before, now = self._waits, waits([os.getpid(), *self.stage.crew.pids()])
        added = [total - before.get(one, total) for one, total in now.items()]
        self._waited = max(self._waited, *added) if added else np.inf
        self._waits, self._looked = now, time.monotonic()

    def _engage(self) -> None:
        """Have the operator engage all arms."""
        self.stage.crew.send("operator", signal.SIGUSR1)

    def _listen_again(self) -> None:
        self._observer.connect(timeout=PATIENCE)

    def _last_words(self) -> str:
        if not self.answers:
            return "the service says nothing"
        return self.answers[-1].sentence

    def _new_stage(self) -> tuple[Stage, Client]:
        """A stage where nothing has been started, and its observer."""
        stage = Stage(self._what, log=self._log)
        return stage, Client(stage.port, name="observer")
