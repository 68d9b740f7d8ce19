"""`armguard coordinate`: robots execute jobs as they arrive."""

import sys
from contextlib import closing
from io import TextIOWrapper
from pathlib import Path
from time import monotonic
from typing import Annotated

import numpy as np
import typer
from typer import Option

from armguard.cli.console import CLEAR, TOO_CLOSE, Json, loading_bar, out, print_json
from armguard.cli.line_hands import LineHands, Says
from armguard.cli.line_input import LineInput
from armguard.cli.line_state import LINK
from armguard.maps.job import read_line_job
from armguard.maps.line_run import LineRun
from armguard.processes import interrupted
from armguard.service.client import Client
from armguard.service.link import LinkEnd
from armguard.simulation.driving import DrivingOperator

# Period of decisions without a service [s].
PERIOD = 0.01

# How long the service gets to answer [s].
PATIENCE = 10.0

# The live view gets answers for so long after the end [s].
ASKS = 1.0


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
    jobs: Annotated[
        bool,
        Option(
            help="With --port: read jobs from standard input, besides those of the "
            'file, a line of JSON each: {"plans": ["left early"], "offset": 0.1}. Ends '
            "once the input has ended and all jobs are done."
        ),
    ] = False,
    recover: Annotated[
        bool,
        Option(
            help="With --port: lead robots slowly to where their plans begin, at the "
            "start and after a stop, and go on with later jobs. The guard judges that "
            "way."
        ),
    ] = False,
    engage: Annotated[
        bool,
        Option(
            help="With --recover, for simulated robots: after a brake reset and engage "
            "robots without a person. A stop that a person ordered stays."
        ),
    ] = False,
    motion: Annotated[
        Path | None,
        Option(help="Without --port: CSV file for the motion of all robots."),
    ] = None,
    json: Json = False,
) -> None:
    """Let robots execute jobs as they arrive, each waiting where another passes.

    Exit code 0 all jobs are done, 1 an item is missed or all robots stopped, 2 bad
    input.
    """
    drives = port is not None
    if (drives and motion is not None) or (not drives and (belt or jobs or recover)):
        raise typer.BadParameter(
            "--belt, --jobs and --recover need a --port; --motion goes without one"
        )
    if engage and not recover:
        raise typer.BadParameter("--engage needs --recover")
    with loading_bar() as progress:
        read = read_line_job(job, progress, more=jobs)
    says = (lambda now, sentence: None) if json else print_event
    if port is None:
        run = LineRun(read)
        seconds = execute(run, motion, says)
    else:
        reads = given_lines(belt, jobs) if belt or jobs else None
        with closing(LinkEnd(port, LINK)) as link:
            hands = LineHands(
                read, reads, says=says, recovers=recover, engages=engage, link=link
            )
            run, seconds = hands.run, drive(hands, port, key_file)
    found = {**run.summary(), "seconds": round(seconds, 3)}
    clear = not run.line.missed and not run.line.fault and run.line.idle
    if json:
        print_json(found)
    else:
        done, count = found["done"], found["jobs"]
        assert isinstance(done, list)
        out.print(f"{len(done)} of {count} jobs done in {seconds:.1f} s", markup=False)
    raise typer.Exit(CLEAR if clear else TOO_CLOSE)


def given_lines(belt: bool, jobs: bool) -> LineInput:
    """What standard input brings; bytes that are no text make a wrong line."""
    if isinstance(sys.stdin, TextIOWrapper):
        sys.stdin.reconfigure(errors="replace")
    return LineInput(sys.stdin, belt=belt, jobs=jobs)


def execute(run: LineRun, motion: Path | None, says: Says) -> float:
    """Execute a job at once; returns how long it would have taken [s]."""
    rows, now = [], 0.0
    moves = True
    while moves:
        moves = run.step(now)
        for sentence in run.take_events():
            says(now, sentence)
        rows.append([now, *run.line.motion()[0]])
        if moves:
            now = round(now / PERIOD + 1.0) * PERIOD
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
        until = monotonic() + ASKS
        while monotonic() < until and not ended.wait(PERIOD):
            hands.answer()
    return hands.now


def print_event(now: float, sentence: str) -> None:
    """Print a decision, and when it was made [s]."""
    out.print(f"{now:8.2f} s  {sentence}", markup=False)
