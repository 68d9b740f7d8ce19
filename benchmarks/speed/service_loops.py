"""The processes around the service: its client, a bare loop, and both ends of an echo.

One process is in turn the service's client, a bare loop and the client of the echo, so
that they differ in nothing else.
"""

import gc
import socket
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from armguard.errors import StationError
from armguard.scene import bay_scene, bay_task
from armguard.service.client import Answer, Client
from armguard.service.server.machine import ask_realtime
from armguard.service.wire.layout import LEAST, STATE, WISH, command_size
from arrays import Floats, Ints

NANO = 1_000_000_000

# The bundled task: rows, and time from one to the next [s].
ROWS, STEP = 2000, 0.03

# The operators: gain towards the present point of the task [1/s], greatest desired
# velocity [rad/s].
PULL, FASTEST = 2.0, 1.2

# Deceleration and acceleration of the bay's arms, and of their brakes [rad/s²].
STRENGTH, BRAKES = 8.0, 30.0

# As `Action` and `Level` number them.
BRAKE_ACTION, BRAKE_LEVEL = 20, 40

# Arms that had no turn for longer have been stopped [s].
LONGEST = 1.0

# The first moments of a loop are not counted: pages and caches are cold, and arms have
# to be engaged [s].
WARM = 0.5

# Time after which a stopped arm is engaged again [s].
PATIENCE = 0.05

# How long a single message of the echo is waited for [s].
LOST = 1.0

# Messages between the service and its client in the bay: a state with velocities and
# the desired velocities of two arms of seven joints, and the answer [bytes].
JOINTS, ROBOTS = 14, 2
ASKED = LEAST + STATE.size + WISH.size + 3 * 8 * JOINTS
ANSWERED = command_size(ROBOTS, JOINTS)


class Arms:
    """Both arms of the bay, and two operators who follow the bundled task.

    The arms take a command when it arrives, and accelerate as real ones do.

    Attributes:
        q: Positions, shape (n,) [rad].
        v: Velocities, shape (n,) [rad/s].
        command: Commanded velocities, shape (n,) [rad/s].
        worked: How far into the task the operators are [s].
    """

    def __init__(self) -> None:
        self._rows: Floats = bay_task(ROWS).for_scene(bay_scene("path"))
        self.q: Floats = self._rows[0].copy()
        self.v: Floats = np.zeros_like(self.q)
        self.command: Floats = np.zeros_like(self.q)
        self.worked = 0.0
        self._at = float("nan")
        self._braked = False

    def measure(self, now: float) -> None:
        """Move until now [s]."""
        passed = now - self._at
        self._at = now
        if not 0.0 < passed < LONGEST:
            return
        most = (BRAKES if self._braked else STRENGTH) * passed
        after = self.v + np.clip(self.command - self.v, -most, most)
        self.q += 0.5 * (self.v + after) * passed
        self.v = after
        self.worked += passed

    def desired(self) -> Floats:
        """Velocities that the operators desire, shape (n,) [rad/s]."""
        at = self.worked / STEP % (len(self._rows) - 1)
        row = int(at)
        before, after = self._rows[row], self._rows[row + 1]
        target = before + (at - row) * (after - before)
        velocity = (after - before) / STEP + PULL * (target - self.q)
        clipped: Floats = np.clip(velocity, -FASTEST, FASTEST)
        return clipped

    def obey(self, answer: Answer, now: float) -> None:
        """Take the command of an answer at a time [s]."""
        self.measure(now)
        self._braked = answer.action_number >= BRAKE_ACTION
        self.command = np.zeros_like(self.q) if self._braked else answer.velocity

    def rest(self) -> None:
        """Stop, because no command comes any more."""
        self.q += 0.5 * self.v * np.abs(self.v) / STRENGTH
        self.v[:] = 0.0
        self.command = np.zeros_like(self.q)
        self._at = float("nan")

    @property
    def resting(self) -> bool:
        """Whether they are at rest."""
        return not self.v.any()


def pace(rate: float, seconds: float, step: Callable[[], None]) -> Ints:
    """Sleep until a step is due, make it, again and again.

    Args:
        rate: Steps a second [Hz].
        seconds: For how long, a warm-up before it left out [s].
        step: The step.

    Returns:
        When each step was due and when the loop woke for it, shape (k, 2) [ns].
    """
    period = round(NANO / rate)
    warm = int(WARM * rate)
    count = warm + max(int(seconds * rate), 1)
    times = np.zeros((count, 2), np.int64)
    due = time.monotonic_ns() + period
    for k in range(count):
        wait = due - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)
        woke = time.monotonic_ns()
        times[k] = due, woke
        step()
        # Missed steps are not made up for by a burst, as in the service.
        due = max(due + period, woke)
    return times[warm:]


def bare(rate: float, seconds: float) -> dict[str, Ints]:
    """A loop that does nothing: how late the machine wakes it."""
    return {"times": pace(rate, seconds, lambda: None)}


def echo(rate: float, seconds: float, port: int) -> dict[str, Ints]:
    """Send as many bytes as a state has, wait for as many as an answer has."""
    took: list[int] = []
    message = bytes(ASKED)
    buffer = bytearray(ANSWERED)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as there:
        there.connect(("127.0.0.1", port))
        there.settimeout(LOST)

        def step() -> None:
            begin = time.perf_counter_ns()
            there.send(message)
            there.recv_into(buffer)
            took.append(time.perf_counter_ns() - begin)

        times = pace(rate, seconds, step)
    return {"times": times, "took": np.array(took[-len(times) :])}


class Talk:
    """The service's client: it drives both arms, and counts what answers say.

    Args:
        port: Port of the service.
    """

    def __init__(self, port: int) -> None:
        self._client = Client(port, name="bench")
        self._arms = Arms()
        self._reset()

    def _reset(self) -> None:
        self._took: list[int] = []
        self._cues: list[float] = []
        self._tally: Counter[str] = Counter()
        self._levels: Counter[str] = Counter()
        self._level = -1
        self._asked = 0.0
        self._counted = float("inf")

    def run(self, rate: float, seconds: float) -> dict[str, Any]:
        """Drive the arms for a while; the arms go on from where they are."""
        self._reset()
        client = self._client
        client.connect(timeout=5.0)
        client.claim(force=True)
        self._counted = time.monotonic() + WARM
        times = pace(rate, seconds, self._step)
        client.close()
        self._arms.rest()
        return {
            "times": times,
            "took": np.array(self._took[-len(times) :]),
            "cues": np.array(self._cues),
            "tally": dict(self._tally),
            "levels": dict(self._levels),
            "worked": self._arms.worked,
        }

    def _step(self) -> None:
        """A state, desired velocities, an answer."""
        client, arms = self._client, self._arms
        while (answer := client.receive()) is not None:
            self._look(answer)
        now = client.clock()
        arms.measure(now)
        desired = arms.desired()
        begin = time.perf_counter_ns()
        answer = client.cycle(arms.q, desired, velocity=arms.v, stamp=now)
        self._took.append(time.perf_counter_ns() - begin)
        arms.obey(answer, client.clock())
        self._look(answer)
        if answer.stops and arms.resting:
            self._let_go(now, answer.level_number)

    def _look(self, answer: Answer) -> None:
        """Count what an answer says."""
        now = self._client.clock()
        level, before = answer.level_number, self._level
        self._level = level
        if now < self._counted:
            return
        tally = self._tally
        tally["answers"] += 1
        if answer.cycle < 0:
            tally[f"client_{answer.cause.name.lower()}"] += 1
            return
        if before not in (-1, level):
            tally["level_changes"] += 1
            self._cues.append(now - answer.time)
        if answer.missed:
            tally["missed"] += 1
            tally["missed_and_stopped"] += answer.cause.stops
        if not answer.cause.stops and "STALE" in answer.reason.name:
            tally["stale"] += 1
        self._levels[answer.level.name] += 1

    def _let_go(self, now: float, level: int) -> None:
        """Engage stopped arms again, as an operator would.

        Arms that did not stop as declared, because this process had no time to obey,
        would be at rest for the remainder of the run: all starts anew then.
        """
        if now - self._asked < PATIENCE:
            return
        self._asked = now
        # Refused as long as there is a reason to stop; asked again then.
        with suppress(StationError):
            if not self._client.commands:
                self._client.claim(force=True)
            if level >= BRAKE_LEVEL:
                self._client.call("reset", timeout=0.2)
                self._tally["reset"] += 1
            self._client.call("engage", timeout=0.2)
            self._tally["engaged"] += self._client.clock() >= self._counted


# The arms of a client go on from turn to turn.
talk_with = cache(Talk)


def client(rate: float, seconds: float, port: int) -> dict[str, Any]:
    """Drive the arms through the service at a port."""
    return talk_with(port).run(rate, seconds)


def answer_echo(port: Connection, realtime: bool) -> None:
    """Answer every message at once; the port is sent first."""
    if realtime:
        ask_realtime()
    buffer, answer = bytearray(2 * ANSWERED), bytes(ANSWERED)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.bind(("127.0.0.1", 0))
        port.send(here.getsockname()[1])
        while True:
            _, address = here.recvfrom_into(buffer)
            here.sendto(answer, address)


def without_collector() -> None:
    """Keep the garbage collector of this process from disturbing its loops."""
    gc.collect()
    gc.freeze()
    gc.disable()
