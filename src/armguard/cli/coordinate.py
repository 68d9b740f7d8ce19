"""`armguard coordinate`: two robots execute jobs as they arrive."""

import sys
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from time import monotonic
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from typer import Option

from armguard.cli.console import CLEAR, TOO_CLOSE, Json, loading_bar, out, print_json
from armguard.maps.job import read_line_job
from armguard.maps.line_run import LineRun
from armguard.processes import interrupted
from armguard.respond.command import Blocked
from armguard.service.client import Client
from armguard.simulation.driving import DrivingOperator

Floats = NDArray[np.float64]

# Period of decisions without a service [s].
PERIOD = 0.01

# How long the service, and what measures the belt, get to answer at first [s].
PATIENCE = 10.0

# A measurement of the belt that is older stops both robots [s].
STALE = 0.1


class Encoder:
    """Reads how far a belt has moved, and its speed, from lines of two numbers.

    Args:
        lines: Lines as they come: travel [m], and speed [m/s].
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._newest, self._stamp = (np.nan, np.nan), -np.inf
        self._wrong = ""
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def _read(self, lines: Iterable[str]) -> None:
        for line in lines:
            try:
                travel, speed = map(float, line.split())
            except ValueError:
                self._wrong = line.strip()[:40]
                return
            self._newest, self._stamp = (travel, speed), monotonic()

    def measured(self) -> tuple[float, float] | None:
        """The newest travel [m] and speed [m/s]; None if they are too old."""
        return self._newest if monotonic() - self._stamp <= STALE else None

    @property
    def problem(self) -> str:
        """Why there is no measurement, in words."""
        if self._wrong:
            return f"'{self._wrong}' is no travel and speed of the belt; give m and m/s"
        return f"the belt was not measured for {STALE:g} s"


class LineHands:
    """The coordination as what drives the robots of a service.

    Attributes:
        engages: It engages no robot: both stop for good where the guard stops one.
        moves: Whether anything is left to do.
        now: Time since the start [s].

    Args:
        run: What is executed.
        encoder: What measures the belt; None if it moves at its usual speed.
        quiet: Whether nothing is printed.
    """

    def __init__(self, run: LineRun, encoder: Encoder | None, quiet: bool) -> None:
        self._encoder = encoder
        self.engages, self.moves, self.now = False, True, 0.0
        self._run, self._quiet = run, quiet
        self._start: float | None = None

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """See `Operator.drive`."""
        held = [name for name, why in blocked.items() if why.remedy]
        if self._start is None:
            belt = self._encoder is None or self._encoder.measured()
            # Robots of a service that has begun wait for velocities of zero.
            if held or (not belt and t < PATIENCE):
                return np.zeros_like(q), []
            self._start = t
        for name in held:
            self._run.line.stop(f"{name}: {blocked[name].sentence}")
        self.now = t - self._start
        measured = None
        if self._encoder is not None:
            measured = self._encoder.measured()
            if measured is None:
                self._run.line.stop(self._encoder.problem)
        self.moves = self._run.step(self.now, measured)
        desired = self._run.velocities(q)
        if self._run.line.fault:
            # They slow down where they are: no proof covers the way back to a plan.
            _, desired = self._run.line.motion()
        print_events(self._run, self.now, self._quiet)
        return desired, []


def coordinate(
    job: Annotated[
        Path,
        typer.Argument(help="Cell job: YAML with a scene, plans, a belt, and jobs."),
    ],
    port: Annotated[
        int | None,
        Option(
            help="Port of the service whose robots are driven. Without it robots are "
            "where they are commanded to be, and no time passes."
        ),
    ] = None,
    key_file: Annotated[Path | None, Option(help="Key file of the service.")] = None,
    belt: Annotated[
        bool,
        Option(
            help="With --port: read how far the belt has moved [m], and its speed "
            "[m/s], from standard input, a line each time it is measured. Without it "
            "the belt moves at its usual speed."
        ),
    ] = False,
    motion: Annotated[
        Path | None,
        Option(help="Without --port: CSV file for the motion of both robots."),
    ] = None,
    json: Json = False,
) -> None:
    """Let two robots execute jobs as they arrive, each waiting where the other passes.

    Exit code 0 all jobs are done, 1 an item is missed or both robots stopped, 2 bad
    input.
    """
    if (port is None and belt) or (port is not None and motion is not None):
        raise typer.BadParameter("--belt needs a --port; --motion goes without one")
    with loading_bar() as progress:
        run = LineRun(read_line_job(job, progress))
    if port is None:
        seconds = execute(run, motion, json)
    else:
        encoder = Encoder(sys.stdin) if belt else None
        seconds = drive(LineHands(run, encoder, json), port, key_file)
    found = {**run.summary(), "seconds": round(seconds, 3)}
    clear = not run.line.missed and not run.line.fault and run.line.idle
    if json:
        print_json(found)
    else:
        done, count = found["done"], found["jobs"]
        assert isinstance(done, list)
        out.print(f"{len(done)} of {count} jobs done in {seconds:.1f} s", markup=False)
    raise typer.Exit(CLEAR if clear else TOO_CLOSE)


def execute(run: LineRun, motion: Path | None, quiet: bool) -> float:
    """Execute a job at once; returns how long it would have taken [s]."""
    rows, now = [], 0.0
    while run.step(now):
        print_events(run, now, quiet)
        rows.append([now, *run.line.motion()[0]])
        now = round(now / PERIOD + 1.0) * PERIOD
    print_events(run, now, quiet)
    rows.append([now, *run.line.motion()[0]])
    if motion is not None:
        title = ",".join(["t", *run.line.cell.q_names])
        np.savetxt(motion, rows, "%.6f", ",", header=title, comments="")
    return now


def drive(hands: LineHands, port: int, key_file: Path | None) -> float:
    """Drive the robots of a service; returns how long it took [s]."""
    with (
        interrupted() as ended,
        Client(port, keys=key_file, name="coordination") as client,
    ):
        client.connect(timeout=PATIENCE)
        operator = DrivingOperator(client, hands)
        operator.run(lambda: ended.is_set() or not hands.moves)
    return hands.now


def print_events(run: LineRun, now: float, quiet: bool) -> None:
    """Print what was decided."""
    for sentence in run.take_events():
        if not quiet:
            out.print(f"{now:8.2f} s  {sentence}", markup=False)
