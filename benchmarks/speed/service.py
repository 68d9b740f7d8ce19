"""`bench service`: the service at control rate, beside a bare loop and a bare echo.

All three are measured in one run on one machine, in turns, so that what disturbs the
machine for a while disturbs them all. Two cores are the least a machine has that runs
this, and a fair comparison loads them alike:

- *The service and its client* are two processes that wake a thousand times a second.
- *The bare loop* takes the place of the client: the service goes on beside it, with no
  states to judge, so again two processes wake as often. How late the machine wakes the
  bare loop is how late it wakes any process beside another one. It is measured alone as
  well, with the service paused, and reported beside.
- *The bare echo* is two processes by itself; with the service awake it would be three,
  and its round trips longer than fair. So the service is paused while it runs.

Companions (the view, the recorder) go on all the time.
"""

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import psutil
from typer import Option

from armguard.recording.counters import CountersReader, counters_path
from armguard.service.server.machine import ask_realtime
from speed.service_figures import Found, figures
from speed.service_loops import answer_echo, bare, client, echo, without_collector
from speed.service_processes import (
    START,
    BenchmarkError,
    Loops,
    Process,
    Watch,
    line_of,
    running,
    seconds_of,
)
from timing import Progress, describe_machine

# A round: this long the service [s], and these shares of it the others.
ROUND = 30.0
BARE, ALONE, ECHO = 0.2, 0.1, 0.1

# Time in which a process notices that it was paused [s].
SETTLE = 0.3

# Warnings that the benchmark causes: its pauses, its client, its stops.
EXPECTED = ("deadline:", "hello:")


@dataclass(frozen=True, kw_only=True)
class ServiceBench:
    """How the service is measured; the options of the command line."""

    seconds: Annotated[float, Option(min=0.5, help="service: how long [s].")] = 600.0
    rate: Annotated[float, Option(min=1.0, help="service: cycles a second [Hz].")] = 1e3
    late: Annotated[
        float, Option(help="service: a cycle later than that is a miss [s].")
    ] = 0.004
    view: Annotated[bool, Option(help="service: a view looks on.")] = True
    record: Annotated[bool, Option(help="service: everything is recorded.")] = True
    realtime: Annotated[
        bool, Option(help="service: it and what it is compared with are real-time.")
    ] = False
    self_test: Annotated[bool, Option(help="service: the guard tests itself.")] = True
    spin: Annotated[
        float, Option(min=0.0, help="service: see `armguard serve --spin` [s].")
    ] = 0.0
    soak: Annotated[
        float | None,
        Option(min=0.1, help="service: memory over so many minutes instead."),
    ] = None

    @property
    def duration(self) -> float:
        """How long the service is measured in all, without the other loops [s]."""
        return self.seconds if self.soak is None else 60.0 * self.soak


@dataclass
class Setup:
    """The processes of a run.

    Attributes:
        service: The service.
        port: Its port.
        start_s: How long its start took [s].
        counters: Its counters.
        echo_port: Port of the other end of the echo.
        loops: The process of the client and the bare loops.
        pids: Of the echo and the loops.
    """

    service: Process
    port: int
    start_s: float
    counters: CountersReader
    echo_port: int
    loops: Loops
    pids: tuple[int, int]


def bench_service(bench: ServiceBench, progress: Progress) -> dict[str, Any]:
    """The service beside a bare loop and a bare echo.

    Args:
        bench: How.
        progress: Called with a sentence before each part.

    Raises:
        BenchmarkError: A process did not start, or has ended.
    """
    found, watch, notes = Found(), Watch(), list[str]()
    rounds = 1 if bench.soak else max(round(bench.duration / ROUND), 1)
    length = bench.duration / rounds
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        progress("starting the service")
        setup = start(bench, stack, folder, watch, notes)
        begin, before = time.monotonic(), busy() - own_seconds(watch, *setup.pids)
        for k in range(rounds):
            progress(f"round {k + 1} of {rounds}, {length:.0f} s of the service each")
            one_round(bench, length, setup, found)
            if (code := setup.service.poll()) is not None:
                raise BenchmarkError(f"the service has ended: {code}")
        passed = time.monotonic() - begin
        others = busy() - own_seconds(watch, *setup.pids) - before
        notes += warnings_of(folder / "service.log")
    answer = {
        "name": "service",
        "machine": describe_machine(),
        "rate_hz": bench.rate,
        "seconds": bench.duration,
        "late_s": bench.late,
        "spin_s": bench.spin,
        "rounds": rounds,
        "start_s": setup.start_s,
        "others_busy_cores": max(others, 0.0) / passed,
        "notes": notes,
        **figures(found, (1.0 / bench.rate + bench.late) * 1e9),
        "memory": watch.summary(),
    }
    if bench.soak is not None:
        answer["over_time"] = {
            name: [list(row) for row in rows[:: max(len(rows) // 240, 1)]]
            for name, rows in watch.rows.items()
        }
    return answer


def start(
    bench: ServiceBench, stack: ExitStack, folder: Path, watch: Watch, notes: list[str]
) -> Setup:
    """Start the service, its view, the echo and the loops; the stack ends them."""
    begin = time.monotonic()
    words = serve_words(bench, folder, notes)
    log = folder / "service.log"
    service = stack.enter_context(running("armguard", *words, log=log))
    port, ring = listening_at(line_of(service, START))
    start_s = time.monotonic() - begin
    if bench.view:
        stack.enter_context(viewed(port, folder, watch, notes))
    spawn = get_context("spawn")
    here, there = spawn.Pipe()
    far = spawn.Process(target=answer_echo, args=(there, bench.realtime), daemon=True)
    far.start()
    there.close()
    stack.callback(far.terminate)
    echo_port = here.recv()
    near = stack.enter_context(ProcessPoolExecutor(1, spawn, without_collector))
    watch.add("service", service.pid)
    watch.add_children(service.pid)
    loops = Loops(near, watch.look)
    if bench.realtime and (why := loops.ask(ask_realtime)):
        notes.append(f"the bare loops: {why}")
    counters = CountersReader(counters_path(ring))
    pids = loops.ask(os.getpid), far.pid or 0
    return Setup(service, port, start_s, counters, echo_port, loops, pids)


def serve_words(bench: ServiceBench, folder: Path, notes: list[str]) -> list[str]:
    """Words that start the service."""
    words = ["serve", "bay", "--port", "0", "--rate", str(bench.rate)]
    words += ["--late", str(bench.late), "--spin", str(bench.spin)]
    words += ["--realtime"] * bench.realtime
    words += ["--no-self-test"] * (not bench.self_test)
    if bench.record and find_spec("mcap") is None:
        notes.append("nothing is recorded: mcap is not installed")
    elif bench.record:
        words += ["--record", str(folder / "recording")]
    return words


def listening_at(line: str) -> tuple[int, Path]:
    """Port and ring, from the first line of a service."""
    at, ring = line.split(", ring ")
    return int(at.rpartition(":")[2]), Path(ring.strip())


@contextmanager
def viewed(port: int, folder: Path, watch: Watch, notes: list[str]) -> Iterator[None]:
    """A live view that looks on, if there is one."""
    if find_spec("viser") is None:
        notes.append("no view looks on: viser is not installed")
        yield
        return
    words = ("armguard.view", "--service", str(port), "--page-port", "0")
    with running(*words, log=folder / "view.log") as view:
        line_of(view, START)
        watch.add("view", view.pid)
        yield
        if view.poll() is not None:
            notes.append(f"the view has ended with code {view.returncode}")


def one_round(bench: ServiceBench, length: float, setup: Setup, found: Found) -> None:
    """Each loop in its turn.

    Args:
        bench: How.
        length: How long the service is measured [s].
        setup: The processes.
        found: The results are added to it.
    """
    rate, loops, counters = bench.rate, setup.loops, setup.counters

    def short(share: float) -> float:
        return max(share * length * (0.02 if bench.soak else 1.0), 1.0)

    found.count(counters, -1)
    found.turns["service"].append(loops.ask(client, rate, length, setup.port))
    found.count(counters, 1)
    found.turns["bare"].append(loops.ask(bare, rate, short(BARE)))
    with paused(setup.service):
        found.turns["alone"].append(loops.ask(bare, rate, short(ALONE)))
        turn = loops.ask(echo, rate, short(ECHO), setup.echo_port)
        found.turns["echo"].append(turn)


@contextmanager
def paused(process: Process) -> Iterator[None]:
    """A process that does not run for a while."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)
        # What it counts for having been paused must not be counted as its own.
        time.sleep(SETTLE)


def busy() -> float:
    """Processor time this machine has spent since its start [s]."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - times.iowait)


def own_seconds(watch: Watch, *pids: int) -> float:
    """Processor time the processes of the benchmark have used [s]."""
    own = sum(seconds_of(psutil.Process(pid)) for pid in pids)
    return watch.processor_seconds() + own


def warnings_of(log: Path) -> list[str]:
    """Warnings of the service, without those of deadlines, which are counted."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    warnings = [line for line in lines if line.startswith(("WARNING", "ERROR"))]
    return [each for each in warnings if not any(w in each for w in EXPECTED)][:20]
