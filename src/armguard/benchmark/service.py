"""`bench service`: the service at control rate, beside a bare loop and a bare echo.

All three are measured in one run on one machine, in turns, so that what disturbs the
machine for a while disturbs them all. Two cores are the least a machine has that runs
this, and a fair comparison loads them alike:

- *The service and its client* are two processes that wake a thousand times a second.
- *The bare loop* takes the place of the client: the service goes on beside it, with no
  states to judge, so again two processes wake as often. How late the machine wakes the
  bare loop is how late it wakes anybody who has such company. It is measured alone as
  well, with the service paused, which is told beside.
- *The bare echo* is two processes by itself; with the service awake it would be three,
  and its round trips longer than fair. So the service is paused while it runs.

Companions (the view, the recorder) go on all the time.
"""

import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import psutil

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.service_figures import Found, figures
from armguard.benchmark.service_processes import (
    START,
    BenchmarkError,
    Loops,
    Watch,
    line_of,
    running,
)
from armguard.station.service.counters import (
    HISTOGRAMS,
    CountersReader,
    Histogram,
    counters_path,
)

Progress = Callable[[str], None]

SECONDS = 600.0
RATE = 1000.0

# A round: this long the service, and these shares of it the others.
ROUND = 30.0
BARE, ALONE, ECHO = 0.2, 0.1, 0.1

# After a pause a process has that long to notice it [s].
SETTLE = 0.3

# What the service says of the benchmark itself: its pauses, its client, its stops.
EXPECTED = ("deadline:", "hello:")


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceBench:
    """How the service is measured.

    Attributes:
        seconds: How long it is in all, the other loops' shares not counted [s].
        rate: Cycles a second [Hz].
        late: See `ServiceSettings`; a cycle later than that is a miss [s].
        view: Whether a live view looks on.
        record: Whether everything is recorded.
        realtime: Whether the service, and the loops it is compared with, ask for
            real-time scheduling.
        self_test: See `Guard`.
        spin: See `ServiceSettings` [s].
        soak: Whether memory over time is what is asked for: longer rounds.
    """

    seconds: float = SECONDS
    rate: float = RATE
    late: float = 0.004
    view: bool = True
    record: bool = True
    realtime: bool = False
    self_test: bool = True
    spin: float = 0.0
    soak: bool = False


def bench_service(bench: ServiceBench, progress: Progress) -> dict[str, Any]:
    """The service beside a bare loop and a bare echo.

    Args:
        bench: How.
        progress: Called with a sentence before each part.

    Raises:
        BenchmarkError: A process did not start, or has ended.
    """
    found, watch = Found(), Watch()
    notes: list[str] = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        words = serve_words(bench, folder, notes)
        service = stack.enter_context(
            running("armguard", *words, log=folder / "service.log")
        )
        progress("starting the service")
        begin = time.monotonic()
        port, ring = listening_at(line_of(service, START))
        started = time.monotonic() - begin
        if bench.view:
            stack.enter_context(viewed(port, folder, watch, notes))
        counters = CountersReader(counters_path(ring))
        far = stack.enter_context(
            running(
                "armguard.benchmark.service_echo",
                *(["realtime"] if bench.realtime else []),
                log=folder / "echo.log",
            )
        )
        echo_port = int(line_of(far, START))
        near = stack.enter_context(
            running("armguard.benchmark.service_loops", log=folder / "loops.log")
        )
        watch.add("service", service.pid)
        watch.add_children(service.pid)
        loops = Loops(near, folder, watch.look)
        if bench.realtime and (why := loops.ask("realtime")["refusal"]):
            notes.append(f"the bare loops: {why}")
        before = busy()
        begin = time.monotonic()
        own = own_seconds(watch, near.pid, far.pid)
        rounds = 1 if bench.soak else max(round(bench.seconds / ROUND), 1)
        length = bench.seconds / rounds
        for k in range(rounds):
            progress(f"round {k + 1} of {rounds}, {length:.0f} s of the service each")
            one_round(
                bench, length, loops, service.pid, (port, echo_port), counters, found
            )
            if service.poll() is not None:
                raise BenchmarkError(f"the service has ended: {service.returncode}")
        passed = time.monotonic() - begin
        others = busy() - before - (own_seconds(watch, near.pid, far.pid) - own)
        notes += warnings_of(folder / "service.log")
    answer = {
        "name": "service",
        "machine": describe_machine(),
        "rate_hz": bench.rate,
        "seconds": bench.seconds,
        "late_s": bench.late,
        "spin_s": bench.spin,
        "rounds": rounds,
        "start_s": started,
        "others_busy_cores": max(others, 0.0) / passed,
        "notes": notes,
        **figures(found, (1.0 / bench.rate + bench.late) * 1e9),
        "memory": watch.summary(),
    }
    if bench.soak:
        answer["over_time"] = {
            name: [list(row) for row in rows[:: max(len(rows) // 240, 1)]]
            for name, rows in watch.rows.items()
        }
    return answer


def serve_words(bench: ServiceBench, folder: Path, notes: list[str]) -> list[str]:
    """Words that start the service."""
    words = ["serve", "bay", "--port", "0", "--rate", str(bench.rate)]
    words += ["--late", str(bench.late)]
    if bench.spin:
        words += ["--spin", str(bench.spin)]
    if bench.realtime:
        words.append("--realtime")
    if not bench.self_test:
        words.append("--no-self-test")
    if bench.record:
        if find_spec("armguard.station.blackbox") is None:
            notes.append("nothing is recorded: there is no recorder")
        else:
            words += ["--record", str(folder / "recording")]
    return words


def listening_at(line: str) -> tuple[int, Path]:
    """Port and ring, from the first line of a service."""
    at, ring = line.split(", ring ")
    return int(at.rpartition(":")[2]), Path(ring.strip())


@contextmanager
def viewed(port: int, folder: Path, watch: Watch, notes: list[str]) -> Iterator[None]:
    """A live view that looks on, if there is one."""
    if find_spec("armguard.station.view") is None:
        notes.append("nobody looks on: there is no view")
        yield
        return
    words = ("armguard.station.view", "--service", str(port), "--page-port", "0")
    with running(*words, log=folder / "view.log") as view:
        line_of(view, START)
        watch.add("view", view.pid)
        yield
        if view.poll() is not None:
            notes.append(f"the view has ended with code {view.returncode}")


def one_round(
    bench: ServiceBench,
    length: float,
    loops: Loops,
    service: int,
    ports: tuple[int, int],
    counters: CountersReader,
    found: Found,
) -> None:
    """Each loop in its turn.

    Args:
        bench: How.
        length: How long the service is measured [s].
        loops: The process that is all of them.
        service: The service's process.
        ports: Ports of the service and of the echo.
        counters: What the service counts.
        found: What is found is added to it.
    """
    rate, (port, echo_port) = bench.rate, ports
    before = counters.values(), counters.stops(), histograms(counters)
    found.add("service", loops.ask("client", rate, length, port))
    after = counters.values(), counters.stops(), histograms(counters)
    found.counted.update({k: v - before[0][k] for k, v in after[0].items()})
    found.stops.update({k: v - before[1].get(k, 0) for k, v in after[1].items()})
    for name in HISTOGRAMS:
        found.buckets[name] += after[2][name].counts - before[2][name].counts
    short = 0.02 if bench.soak else 1.0
    found.add("bare", loops.ask("bare", rate, max(BARE * length * short, 1.0)))
    with paused(service):
        found.add("alone", loops.ask("bare", rate, max(ALONE * length * short, 1.0)))
        found.add(
            "echo", loops.ask("echo", rate, max(ECHO * length * short, 1.0), echo_port)
        )


@contextmanager
def paused(process: int) -> Iterator[None]:
    """A process that does not run for a while."""
    one = psutil.Process(process)
    one.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        one.send_signal(signal.SIGCONT)
        # What it counts for having been paused must not be counted as its own.
        time.sleep(SETTLE)


def histograms(counters: CountersReader) -> dict[str, Histogram]:
    """All histograms as they are now."""
    return {name: counters.histogram(name) for name in HISTOGRAMS}


def busy() -> float:
    """Processor time this machine has spent since its start [s]."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - times.iowait)


def own_seconds(watch: Watch, *pids: int) -> float:
    """Processor time the processes of the benchmark have used [s]."""
    used = watch.processor_seconds()
    for pid in pids:
        times = psutil.Process(pid).cpu_times()
        used += times.user + times.system
    return used


def warnings_of(log: Path) -> list[str]:
    """What the service complained about, other than deadlines, which are counted."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    said = [line for line in lines if line.startswith(("WARNING", "ERROR"))]
    kept = [line for line in said if not any(word in line for word in EXPECTED)]
    return kept[:20]
