"""The conveyor of `armguard demo`: its belt, its items, and the coordination."""

import subprocess
import threading
import time
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from armguard.cli.console import say
from armguard.cli.line_state import LINK
from armguard.errors import StationError
from armguard.scene.conveyor import conveyor_job_path
from armguard.service.link import ask
from armguard.service.wire.keys import keys_path
from armguard.simulation.stage import Stage

# Items come in pairs: how many of a job file, the usual time from one pair to the next
# and within a pair, and how early or late each item may be [s].
PAIRS, EVERY, WITHIN, OFF = 300, 12.0, 4.5, 1.0

# The belt's speed sways by this share of what the job declares, in this time [s].
SWAYS, SWAY = 0.8, 23.0

# Time between two measurements of the belt [s].
MEASURES = 0.02

# Time between two looks at the coordination [s].
LOOKS = 0.5


def job_of_demo(seed: int) -> dict[str, Any]:
    """The bundled cell job with many items, early and late ones.

    Args:
        seed: Seed of their times.
    """
    path = conveyor_job_path()
    job: dict[str, Any] = YAML(typ="safe").load(path)
    job["scene"] = str(path.parent / job["scene"])
    for plan in job["plans"].values():
        plan["file"] = str(path.parent / plan["file"])
    usual = np.add.outer(EVERY * np.arange(PAIRS), (OFF, OFF + WITHIN))
    times = usual + np.random.default_rng(seed).uniform(-OFF, OFF, usual.shape)
    plans = [*job["plans"]]
    job["jobs"] = [{"t": float(t), "plans": plans} for t in times.ravel().round(2)]
    return job


class Belt:
    """A belt of changing speed.

    Args:
        slowest: Its least declared speed [m/s].
        fastest: Its greatest declared speed [m/s].
        speed: Its usual speed [m/s].
    """

    def __init__(self, slowest: float, fastest: float, speed: float) -> None:
        self._speed = speed
        self._most = SWAYS * min(fastest - speed, speed - slowest)

    def measured(self, t: float) -> tuple[float, float]:
        """How far it has moved [m], and its speed [m/s].

        Args:
            t: Time since it began to move [s].
        """
        rate = 2.0 * pi / SWAY
        travel = self._speed * t + self._most / rate * (1.0 - cos(rate * t))
        return travel, self._speed + self._most * sin(rate * t)


class LineOperator:
    """`armguard coordinate` as the operator of a stage, started again when it ends.

    Attributes:
        works: Whether it has begun.

    Args:
        stage: Its service and arms run.
        seed: Seed of the items' times.
        log: Where the coordination writes to.
    """

    def __init__(self, stage: Stage, seed: int, log: int) -> None:
        self._stage, self._seed, self._log = stage, seed, log
        self._folder = TemporaryDirectory(prefix="armguard-")
        self._ended, self._looked = threading.Event(), 0.0
        self.works, self._counts, self._before = False, (0, 0), (0, 0)
        self._start()
        belt = Belt(**self._job["conveyor"])
        self._thread = threading.Thread(target=self._move, args=(belt,), daemon=True)
        self._thread.start()

    @property
    def done(self) -> int:
        """Items that were picked."""
        return self._before[0] + self._counts[0]

    @property
    def missed(self) -> int:
        """Items that were not."""
        return self._before[1] + self._counts[1]

    def check(self) -> None:
        """Count items, and start the coordination again where it has ended.

        Raises:
            StationError: It could not begin.
        """
        now = time.monotonic()
        if now - self._looked < LOOKS:
            return
        self._looked = now
        state = ask(self._stage.port, LINK)
        if state is not None:
            self.works = True
            self._counts = state["done"], state["missed"]
        code = self._process.poll()
        if code is None:
            return
        if code not in (0, 1):
            raise StationError(f"the coordination ended with code {code}")
        self._before, self._counts = (self.done, self.missed), (0, 0)
        say("the coordination starts again, and proves its plans first")
        self._start()

    def close(self) -> None:
        """End belt and coordination."""
        self._ended.set()
        self._thread.join()
        self._stage.crew.end_one("coordination")
        self._folder.cleanup()

    def _start(self) -> None:
        """Start the coordination with new items."""
        job = Path(self._folder.name) / "job.yaml"
        self._job = job_of_demo(self._seed)
        YAML(typ="safe").dump(self._job, job)
        self._seed += 1
        port, keys = str(self._stage.port), str(keys_path(self._stage.port))
        words = ("--port", port, "--key-file", keys, "--belt", "--recover", "--engage")
        self._process = self._stage.crew.start(
            "coordination",
            ("-m", "armguard", "coordinate", str(job), *words),
            log=self._log,
            stdin=subprocess.PIPE,
        )

    def _move(self, belt: Belt) -> None:
        """Measure the belt for the coordination that runs."""
        start = time.monotonic()
        while not self._ended.wait(MEASURES):
            travel, speed = belt.measured(time.monotonic() - start)
            lines = self._process.stdin
            assert lines is not None
            try:
                lines.write(f"{travel:.6f} {speed:.6f}\n".encode())
                lines.flush()
            except OSError:
                # It has ended; the next one gets the next line.
                continue
