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
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.service_processes import (
    START,
    BenchmarkError,
    Loops,
    Watch,
    line_of,
    running,
)
from armguard.benchmark.timing import percentiles
from armguard.station.service.counters import (
    BUCKETS,
    HISTOGRAMS,
    CountersReader,
    Histogram,
    counters_path,
    upper_end,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Progress = Callable[[str], None]

SECONDS = 600.0
RATE = 1000.0

# A round: this long the service, and these shares of it the others.
ROUND = 30.0
BARE, ALONE, ECHO = 0.2, 0.1, 0.1

# What must be reached [us], and misses beyond the bare loop's [-].
INSIDE_MEDIAN, INSIDE_TAIL = 60.0, 500.0
ADDED_MEDIAN, ADDED_TAIL = 150.0, 300.0
MORE_MISSES = 0.001
CUE = 50_000.0


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
        soak: Whether memory over time is what is asked for: longer rounds.
    """

    seconds: float = SECONDS
    rate: float = RATE
    late: float = 0.004
    view: bool = True
    record: bool = True
    realtime: bool = False
    self_test: bool = True
    soak: bool = False


@dataclass
class Found:
    """What the rounds found.

    Attributes:
        times: By loop, due and woken [ns].
        took: By loop, round trips [ns].
        cues: From a level's change to its answer [s].
        inside: As answers told it [s].
        tally: What answers said.
        levels: Answers by level.
        counted: What the service counted while its client was there.
        stops: Its stops by reason, likewise.
        buckets: Its histograms, likewise.
        worked: How far the operators came [s].
    """

    times: dict[str, list[Longs]] = field(default_factory=dict)
    took: dict[str, list[Longs]] = field(default_factory=dict)
    cues: list[Floats] = field(default_factory=list)
    inside: list[Floats] = field(default_factory=list)
    tally: Counter[str] = field(default_factory=Counter)
    levels: Counter[str] = field(default_factory=Counter)
    counted: Counter[str] = field(default_factory=Counter)
    stops: Counter[int] = field(default_factory=Counter)
    buckets: dict[str, Longs] = field(
        default_factory=lambda: {
            name: np.zeros(BUCKETS, np.int64) for name in HISTOGRAMS
        }
    )
    worked: float = 0.0

    def add(self, loop: str, found: dict[str, Any]) -> None:
        """What a loop found in its turn."""
        self.times.setdefault(loop, []).append(found["times"])
        if "took" in found:
            self.took.setdefault(loop, []).append(found["took"])
        if "tally" in found:
            self.cues.append(found["cues"])
            self.inside.append(found["inside"])
            self.tally.update(found["tally"])
            self.levels.update(found["levels"])
            self.worked = found["worked"]


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
            stack.enter_context(viewed(port, folder, notes))
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
            one_round(bench, loops, service.pid, port, echo_port, counters, found)
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
        "rounds": rounds,
        "start_s": started,
        "others_busy_cores": max(others, 0.0) / passed,
        "notes": notes,
        **figures(bench, found),
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
def viewed(port: int, folder: Path, notes: list[str]) -> Iterator[None]:
    """A live view that looks on, if there is one."""
    if find_spec("armguard.station.view") is None:
        notes.append("nobody looks on: there is no view")
        yield
        return
    words = ("armguard.station.view", "--service", str(port), "--port", "0")
    with running(*words, log=folder / "view.log") as view:
        yield
        if view.poll() is not None:
            notes.append(f"the view has ended with code {view.returncode}")


def one_round(
    bench: ServiceBench,
    loops: Loops,
    service: int,
    port: int,
    echo_port: int,
    counters: CountersReader,
    found: Found,
) -> None:
    """Each loop in its turn."""
    rate = bench.rate
    length = bench.seconds if bench.soak else min(bench.seconds, ROUND)
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


def histograms(counters: CountersReader) -> dict[str, Histogram]:
    """All histograms as they are now."""
    return {name: counters.histogram(name) for name in HISTOGRAMS}


def figures(bench: ServiceBench, found: Found) -> dict[str, Any]:
    """What was reached beside what must be."""
    limit = (1.0 / bench.rate + bench.late) * 1e9
    took = {
        name: np.concatenate(parts).astype(np.float64)
        for name, parts in found.took.items()
    }
    inside = from_buckets(found.buckets["inside"])
    trip, echo = percentiles(took["service"]), percentiles(took["echo"])
    loops = {
        name: lateness(parts, limit)
        for name, parts in found.times.items()
        if name in ("bare", "alone")
    }
    cycles = max(found.counted["cycles"], 1)
    missed = found.counted["deadline_missed"] / cycles
    allowed = loops["bare"]["share_missed"] + MORE_MISSES
    cues = np.concatenate(found.cues) if found.cues else np.zeros(0)
    cue = percentiles(cues * 1e9) if len(cues) else {}
    targets = [
        target("in process, median [us]", INSIDE_MEDIAN, inside["median_us"]),
        target("in process, 99.9 % [us]", INSIDE_TAIL, inside["p999_us"]),
        target(
            "round trip minus echo, median [us]",
            ADDED_MEDIAN,
            trip["median_us"] - echo["median_us"],
        ),
        target(
            "round trip minus echo, 99 % [us]",
            ADDED_TAIL,
            trip["p99_us"] - echo["p99_us"],
        ),
        target("deadlines missed, share [-]", allowed, missed),
    ]
    if cue:
        targets.append(target("level change to answer, most [us]", CUE, cue["max_us"]))
    return {
        "targets": targets,
        "in_process": inside,
        "in_process_histogram": histogram_rows(found.buckets["inside"]),
        "judging": from_buckets(found.buckets["judging"]),
        "waking": from_buckets(found.buckets["waking"]),
        "round_trip": trip,
        "echo": echo,
        "loops": loops,
        "misses": {
            "limit_ms": limit / 1e6,
            "cycles": cycles,
            "counted": found.counted["deadline_missed"],
            "share": missed,
            "bare_share": loops["bare"]["share_missed"],
            "answers_that_said_so": found.tally["missed"],
            "of_these_stops": found.tally["missed_and_stopped"],
        },
        "answers": dict(found.tally),
        "stale_answers": found.tally["stale"],
        "levels": dict(found.levels),
        "level_change_to_answer": cue,
        "stops_by_reason": {str(k): v for k, v in found.stops.items() if v},
        "counters": {k: v for k, v in found.counted.items() if v},
        "task_s": found.worked,
    }


def target(what: str, most: float, measured: float) -> dict[str, Any]:
    """A figure beside what it must not exceed."""
    return {
        "figure": what,
        "target": most,
        "measured": measured,
        "met": bool(measured <= most),
    }


def lateness(parts: list[Longs], limit: float) -> dict[str, float]:
    """How late a bare loop was woken, and how often its deadline would be missed.

    A miss is what the service counts as one: more time than its limit since the cycle
    before.

    Args:
        parts: Due and woken, shape (k, 2) each [ns].
        limit: The limit [ns].
    """
    late = np.concatenate([woken - due for due, woken in (part.T for part in parts)])
    apart = np.concatenate([np.diff(part[:, 1]) for part in parts])
    return {
        **percentiles(late.astype(np.float64)),
        "share_missed": float((apart > limit).mean()) if len(apart) else 0.0,
        "cycles": len(late),
    }


def from_buckets(counts: Longs) -> dict[str, float]:
    """Median and tail of a histogram of the service, at most 6 % too long."""
    nothing = float("nan")
    total = int(counts.sum())
    if not total:
        names = ("median_us", "p99_us", "p999_us", "max_us")
        return dict.fromkeys(names, nothing) | {"count": 0}
    whole = Histogram(counts, total, nothing, float("inf"))
    last = int(np.flatnonzero(counts)[-1])
    return {
        "median_us": whole.percentile(0.5) * 1e6,
        "p99_us": whole.percentile(0.99) * 1e6,
        "p999_us": whole.percentile(0.999) * 1e6,
        "max_us": upper_end(last) / 1e3,
        "count": total,
    }


def histogram_rows(counts: Longs) -> list[list[float]]:
    """Upper end [us] and number of each bucket that holds something."""
    full = np.flatnonzero(counts).tolist()
    return [[upper_end(k) / 1e3, int(counts[k])] for k in full]


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
    kept = [line for line in said if "deadline:" not in line]
    return kept[:20]


def print_service(answer: dict[str, Any]) -> str:
    """Target beside measured, then the rest, in lines."""
    head = f"{'':36}{'target':>12}{'measured':>12}"
    lines = [head]
    for row in answer["targets"]:
        met = "" if row["met"] else "  not met"
        lines.append(
            f"{row['figure']:36}{row['target']:12.5g}{row['measured']:12.5g}{met}"
        )
    for name in ("in_process", "judging", "waking", "round_trip", "echo"):
        lines.append(f"{name}: {in_words(answer[name])}")
    for name, row in answer["loops"].items():
        share = f"{row['share_missed']:.3%} missed"
        lines.append(f"bare loop, {name}: {in_words(row)}, {share}")
    misses = answer["misses"]
    lines.append(
        f"misses: {misses['counted']} of {misses['cycles']} cycles later than "
        f"{misses['limit_ms']:.0f} ms; stale answers: {answer['stale_answers']}"
    )
    cue = answer["level_change_to_answer"]
    if cue:
        lines.append(f"level change to answer: {in_words(cue)}")
    for name, row in answer["memory"].items():
        flat = "flat" if row["flat"] else "not flat"
        lines.append(
            f"memory of {name}: {row['start_kib'] / 1024:.1f} MiB at first, "
            f"{row['growth_kib_per_minute']:+.0f} KiB a minute, "
            f"{row['descriptors_end']} descriptors; {flat}"
        )
    lines.append(f"others kept {answer['others_busy_cores']:.2f} cores busy")
    lines += [f"note: {note}" for note in answer["notes"]]
    return "\n".join(lines)


def in_words(row: dict[str, float]) -> str:
    """Median and tail in one line."""
    return (
        f"median {row['median_us']:.0f} us, 99 % {row['p99_us']:.0f}, "
        f"99.9 % {row['p999_us']:.0f}, most {row['max_us']:.0f}"
    )
