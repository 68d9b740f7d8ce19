"""Figures of the service's benchmark, and how they are printed."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.timing import percentiles
from armguard.station.service.counters import (
    BUCKETS,
    HISTOGRAMS,
    Histogram,
    upper_end,
)

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# What must be reached [us], and misses beyond the bare loop's [-].
INSIDE_MEDIAN, INSIDE_TAIL = 60.0, 500.0
ADDED_MEDIAN, ADDED_TAIL = 150.0, 300.0
MORE_MISSES = 0.001
CUE = 50_000.0


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


def figures(found: Found, limit: float) -> dict[str, Any]:
    """What was reached beside what must be.

    Args:
        found: What the rounds found.
        limit: Time from one cycle to the next that is a missed deadline [ns].
    """
    took = {
        name: np.concatenate(parts).astype(np.float64)
        for name, parts in found.took.items()
    }
    inside = from_buckets(found.buckets["inside"])
    handed = from_buckets(found.buckets["handed"])
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
        target("in to handed out, median [us]", INSIDE_MEDIAN, handed["median_us"]),
        target("in to handed out, 99.9 % [us]", INSIDE_TAIL, handed["p999_us"]),
        target("in to sent, median [us]", INSIDE_MEDIAN, inside["median_us"]),
        target("in to sent, 99.9 % [us]", INSIDE_TAIL, inside["p999_us"]),
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
        "in_to_handed_out": handed,
        "in_to_sent": inside,
        "in_to_handed_out_histogram": histogram_rows(found.buckets["handed"]),
        "in_to_sent_histogram": histogram_rows(found.buckets["inside"]),
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


def print_service(answer: dict[str, Any]) -> str:
    """Target beside measured, then the rest, in lines."""
    head = f"{'':36}{'target':>12}{'measured':>12}"
    lines = [head]
    for row in answer["targets"]:
        met = "" if row["met"] else "  not met"
        lines.append(
            f"{row['figure']:36}{row['target']:12.5g}{row['measured']:12.5g}{met}"
        )
    times = ("in_to_handed_out", "in_to_sent", "judging", "waking")
    for name in (*times, "round_trip", "echo"):
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
