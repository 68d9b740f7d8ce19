"""One process that is in turn a bare loop, an echo's client, and the service's client.

It is the same process for all three, so that they differ in nothing else. It is told
what to be by a line of JSON on standard input, and answers with one.
"""

import gc
import json
import socket
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.service_arms import Arms
from armguard.benchmark.service_echo import ANSWERED, ASKED
from armguard.station.client import Answer, Client
from armguard.station.errors import StationError
from armguard.station.service.machine import ask_realtime

Longs = NDArray[np.int64]

NANO = 1_000_000_000

# What a loop does in its first moments is not counted: pages and caches are cold, and
# arms have to be engaged [s].
WARM = 0.5

# As `Level` numbers it.
BRAKE = 40

# Who was stopped asks to be let go again after that long [s].
PATIENCE = 0.05

# How long a single message of the echo is waited for [s].
LOST = 1.0


def pace(rate: float, seconds: float, step: Callable[[], None]) -> Longs:
    """Sleep until it is time, do a step, again and again.

    Args:
        rate: Steps a second [Hz].
        seconds: For how long, a warm-up before it left out [s].
        step: What to do.

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
        # What was missed is not made up for by a burst, as in the service.
        due = max(due + period, woke)
    return times[warm:]


def bare(rate: float, seconds: float) -> dict[str, Longs]:
    """A loop that does nothing: how late the machine wakes it."""
    return {"times": pace(rate, seconds, lambda: None)}


def echo(rate: float, seconds: float, port: int) -> dict[str, Longs]:
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
    """The service's client: it drives both arms, and looks at what comes back.

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
        self._inside: list[float] = []
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
            "inside": np.array(self._inside),
            "tally": dict(self._tally),
            "levels": dict(self._levels),
            "worked": self._arms.worked,
        }

    def _step(self) -> None:
        """A state, a wish, an answer."""
        client, arms = self._client, self._arms
        while (answer := client.receive()) is not None:
            self._look(answer)
        now = client.clock()
        arms.measure(now)
        wish = arms.wish()
        begin = time.perf_counter_ns()
        answer = client.cycle(arms.q, wish, velocity=arms.v, stamp=now)
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
        if answer.inside == answer.inside:
            self._inside.append(answer.inside)
        self._levels[answer.level.name] += 1

    def _let_go(self, now: float, level: int) -> None:
        """Whoever was stopped is engaged again, as an operator would.

        Arms that did not stop as declared, because this process had no time to obey,
        would be measured standing for the rest of the run: all starts anew then.
        """
        if now - self._asked < PATIENCE:
            return
        self._asked = now
        # Refused as long as there is a reason to stop; asked again then.
        with suppress(StationError):
            if not self._client.commands:
                self._client.claim(force=True)
            if level >= BRAKE:
                self._client.call("reset", timeout=0.2)
                self._tally["reset"] += 1
            self._client.call("engage", timeout=0.2)
            self._tally["engaged"] += self._client.clock() >= self._counted


def main() -> None:
    """Do what standard input says, a line at a time."""
    gc.collect()
    gc.freeze()
    gc.disable()
    talk: Talk | None = None
    for line in sys.stdin:
        asked = json.loads(line)
        what, rate, seconds = asked["what"], asked["rate"], asked["seconds"]
        refusal = ""
        if what == "realtime":
            refusal, found = ask_realtime(), {}
        elif what == "bare":
            found = bare(rate, seconds)
        elif what == "echo":
            found = echo(rate, seconds, asked["port"])
        else:
            talk = talk or Talk(asked["port"])
            found = talk.run(rate, seconds)
        arrays = {k: v for k, v in found.items() if isinstance(v, np.ndarray)}
        if arrays:
            with Path(asked["file"]).open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
        rest = {k: v for k, v in found.items() if k not in arrays}
        sys.stdout.write(json.dumps({"refusal": refusal, **rest}) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
