"""Figures of the service's benchmark, and how they are printed."""

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armguard.recording.counters import (
    BUCKETS,
    HISTOGRAMS,
    CountersReader,
    Histogram,
    upper_end,
)
from arrays import Ints
from timing import percentiles

# Targets [us], and misses beyond those of the bare loop [-].
INSIDE_MEDIAN, INSIDE_TAIL = 60.0, 500.0
ADDED_MEDIAN, ADDED_TAIL = 150.0, 300.0
MORE_MISSES = 0.001
CUE = 50_000.0


@dataclass
class Found:
    """Results of the rounds.

    Attributes:
        turns: By loop, the results of its turns, see `service_loops`.
        counted: Counters of the service while its client was connected.
        stops: Its stops by reason, likewise.
        buckets: Its histograms, likewise.
    """

    turns: dict[str, list[dict[str, Any]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    counted: Counter[Any] = field(default_factory=Counter)
    stops: Counter[Any] = field(default_factory=Counter)
    buckets: dict[str, Ints] = field(
        default_factory=lambda: {name: np.zeros(BUCKETS, int) for name in HISTOGRAMS}
    )

    def count(self, counters: CountersReader, sign: int) -> None:
        """Add what the service has counted so far, or subtract it before a turn."""
        for total, now in (
            (self.counted, counters.values()),
            (self.stops, counters.stops()),
        ):
            total.update({key: sign * value for key, value in now.items()})
        for name in HISTOGRAMS:
            self.buckets[name] += sign * counters.histogram(name).counts

    def of(self, loop: str, name: str) -> list[Any]:
        """One of the results of all turns of a loop."""
        return [turn[name] for turn in self.turns[loop]]

    def tally(self, name: str) -> Counter[str]:
        """Counts of answers, added up over the turns of the client."""
        total = Counter[str]()
        for counts in self.of("service", name):
            total.update(counts)
        return total


def figures(found: Found, limit: float) -> dict[str, Any]:
    """Measured figures beside their targets.

    Args:
        found: Results of the rounds.
        limit: Time from one cycle to the next that is a missed deadline [ns].
    """
    took = {
        name: percentiles(np.concatenate(found.of(name, "took")))
        for name in ("service", "echo")
    }
    tally = found.tally("tally")
    histograms = {name: from_buckets(found.buckets[name]) for name in HISTOGRAMS}
    loops = {n: lateness(found.of(n, "times"), limit) for n in ("bare", "alone")}
    cycles = max(found.counted["cycles"], 1)
    missed = found.counted["deadline_missed"]
    cues = np.concatenate(found.of("service", "cues"))
    cue = percentiles(cues * 1e9) if len(cues) else {}
    answer = {
        "in_to_handed_out": histograms["handed"],
        "in_to_sent": histograms["inside"],
        "in_to_handed_out_histogram": histogram_rows(found.buckets["handed"]),
        "in_to_sent_histogram": histogram_rows(found.buckets["inside"]),
        "judging": histograms["judging"],
        "waking": histograms["waking"],
        "round_trip": took["service"],
        "echo": took["echo"],
        "loops": loops,
        "misses": {
            "limit_ms": limit / 1e6,
            "cycles": cycles,
            "counted": missed,
            "share": missed / cycles,
            "bare_share": loops["bare"]["share_missed"],
            "answers_that_said_so": tally["missed"],
            "of_these_stops": tally["missed_and_stopped"],
        },
        "answers": dict(tally),
        "stale_answers": tally["stale"],
        "levels": dict(found.tally("levels")),
        "level_change_to_answer": cue,
        "stops_by_reason": {str(k): v for k, v in found.stops.items() if v},
        "counters": {k: v for k, v in found.counted.items() if v},
        "task_s": found.of("service", "worked")[-1],
    }
    return {"targets": targets(answer), **answer}


def targets(answer: dict[str, Any]) -> list[dict[str, Any]]:
    """Each figure that has a target, beside it."""
    handed, inside = answer["in_to_handed_out"], answer["in_to_sent"]
    trip, echo, misses = answer["round_trip"], answer["echo"], answer["misses"]
    added = {name: trip[name] - echo[name] for name in ("median_us", "p99_us")}
    rows = [
        ("in to handed out, median [us]", INSIDE_MEDIAN, handed["median_us"]),
        ("in to handed out, 99.9 % [us]", INSIDE_TAIL, handed["p999_us"]),
        ("in to sent, median [us]", INSIDE_MEDIAN, inside["median_us"]),
        ("in to sent, 99.9 % [us]", INSIDE_TAIL, inside["p999_us"]),
        ("round trip minus echo, median [us]", ADDED_MEDIAN, added["median_us"]),
        ("round trip minus echo, 99 % [us]", ADDED_TAIL, added["p99_us"]),
        (
            "deadlines missed, share [-]",
            misses["bare_share"] + MORE_MISSES,
            misses["share"],
        ),
    ]
    if cue := answer["level_change_to_answer"]:
        rows.append(("level change to answer, most [us]", CUE, cue["max_us"]))
    return [
        {"figure": name, "target": most, "measured": seen, "met": seen <= most}
        for name, most, seen in rows
    ]


def lateness(parts: list[Ints], limit: float) -> dict[str, float]:
    """How late a bare loop was woken, and how often its deadline would be missed.

    A miss is defined as in the service: more time than its limit since the cycle
    before.

    Args:
        parts: Due and woken, shape (k, 2) each [ns].
        limit: The limit [ns].
    """
    late = np.concatenate([woken - due for due, woken in (part.T for part in parts)])
    apart = np.concatenate([np.diff(part[:, 1]) for part in parts])
    return {
        **percentiles(late),
        "share_missed": float((apart > limit).mean()) if len(apart) else 0.0,
        "cycles": len(late),
    }


def from_buckets(counts: Ints) -> dict[str, float]:
    """Median and tail of a histogram of the service, at most 6 % too long."""
    whole = Histogram(counts, int(counts.sum()), float("nan"), float("inf"))
    shares = {"median_us": 0.5, "p99_us": 0.99, "p999_us": 0.999, "max_us": 1.0}
    times = {name: whole.percentile(share) * 1e6 for name, share in shares.items()}
    return {**times, "count": whole.count}


def histogram_rows(counts: Ints) -> list[list[float]]:
    """Upper end [us] and number of each bucket that holds something."""
    full = np.flatnonzero(counts).tolist()
    return [[upper_end(k) / 1e3, int(counts[k])] for k in full]


def print_service(answer: dict[str, Any]) -> str:
    """Target beside measured, then the rest, in lines."""
    times = "in_to_handed_out", "in_to_sent", "judging", "waking", "round_trip", "echo"
    lines = [
        f"{'':36}{'target':>12}{'measured':>12}",
        *(
            f"{row['figure']:36}{row['target']:12.5g}{row['measured']:12.5g}"
            + ("" if row["met"] else "  not met")
            for row in answer["targets"]
        ),
        *(f"{name}: {in_words(answer[name])}" for name in times),
    ]
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
