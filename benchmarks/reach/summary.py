"""From trials to figures, each of the same trials for all guards and peers."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from episodes.kernels import kernels_of
from episodes.records import Digest, Figures, Records, versions_of
from reach.answers import ANSWERS
from reach.scenes import SCENES

Rows = Sequence[Mapping[str, Any]]

# How goals are reached: straight where that is certified; straight where only a bent
# way is; led along that way.
ROADS = ("straight", "bends", "led")

WHATS = ("goals", "slides")

# Digits of the numbers of a trial that are kept.
DIGITS = 4

# What begins the outcome of a trial that says nothing.
LEFT_OUT = "left out: "


def digest(trial: Mapping[str, Any]) -> Digest:
    """What came of a trial, in short."""
    slide = trial.get("slide")
    runs = trial["runs"] if slide is None else {"slide": slide}
    numbers = {
        f"{road} {name}": value
        for road, run in runs.items()
        for name, value in numbers_of(run).items()
    }
    touched = any(run["contact"] is not None for run in runs.values())
    least = 1e3 * min(run["least"] for run in runs.values())
    kind = "slide" if slide is not None else trial["kind"]
    return Digest(
        trial["seed"], f"{kind}, contact" if touched else kind, least, numbers
    )


def numbers_of(run: Mapping[str, Any]) -> dict[str, float]:
    """What is kept of a run; what did not happen is 0."""
    found = {
        "reached": run["reached"] or 0.0,
        "stops": len(run["stops"]),
        "contacts": int(run["contact"] is not None),
        "least": 1e3 * run["least"],
        "nominal": run["nominal"],
        "jerk_told": run["jerk_told"][0],
        "jerk_true": run["jerk_true"][0],
        "chatter": run["chatter"],
        "blocked": run["blocked"],
        "call": 1e6 * run["call"][0],
        "call_p999": 1e6 * run["call"][1],
        **{f"share {k}": share for k, share in enumerate(run.get("share", ()))},
    }
    return {name: float(f"{value:.{DIGITS}g}") for name, value in found.items()}


def runs_of(digests: Sequence[Digest], road: str) -> Rows:
    """Runs of trials by one road, as they were kept."""
    return [
        {
            "kind": digest.outcome.split(",")[0],
            **{
                name.removeprefix(f"{road} "): value
                for name, value in digest.counts.items()
                if name.startswith(f"{road} ")
            },
        }
        for digest in digests
        if f"{road} nominal" in digest.counts
    ]


def compared(records: Records) -> Iterator[tuple[str, str, Figures]]:
    """Figures of goals or slides that all guards and peers of a scene had.

    Yields:
        Whether "goals" or "slides", the scene, and by answer its figures. Rows of which
        no trials are kept are given as they are.
    """
    for what in WHATS:
        for scene in SCENES:
            rows: dict[str | None, list[tuple[str, Figures]]] = {}
            for answer in ANSWERS:
                known = records.kinds.get(f"{scene}/{answer}/{what}")
                for row in [] if known is None else versions_of(known):
                    key = row["kernels"] if "seeds" in row else None
                    rows.setdefault(key, []).append((answer, row))
            # What was run with the kernels of today comes first.
            for key, some in sorted(
                rows.items(), key=lambda item: item[0] != kernels_of()
            ):
                if key is None:
                    yield what, scene, dict(some)
                else:
                    yield what, scene, on_the_same(records, scene, what, some)


def on_the_same(
    records: Records, scene: str, what: str, rows: Sequence[tuple[str, Figures]]
) -> Figures:
    """Figures by answer, of the trials that all of them had."""
    trials = {
        answer: records.digests(f"{scene}/{answer}/{what}", row["version"])
        for answer, row in rows
    }
    seeds = set.intersection(*(set(found) for found in trials.values()))
    all_seeds = set.union(*(set(found) for found in trials.values()))
    figures: Figures = {}
    for answer, row in rows:
        found = [trials[answer][seed] for seed in sorted(seeds)]
        kept = [d for d in found if not d.outcome.startswith(LEFT_OUT)]
        figures[answer] = {
            "drawn": len(found),
            "left_out": dict(
                Counter(
                    d.outcome.removeprefix(LEFT_OUT) for d in found if d not in kept
                )
            ),
            "not_by_all": len(all_seeds) - len(seeds),
            "kernels": row["kernels"],
        }
        if what == "goals":
            for road in ROADS:
                figures[answer][road] = figures_of(runs_of(kept, road))
        else:
            figures[answer] |= slid_far(runs_of(kept, "slide"))
            figures[answer]["first"] = row.get("first")
    return figures


def figures_of(runs: Rows) -> Figures | None:
    """Figures of some runs; None if there are none."""
    if not runs:
        return None
    reached = [r for r in runs if r.get("reached") and not r.get("contacts")]
    return {
        "goals": len(runs),
        "reached": len(reached),
        "reached_without_stop": sum(not r.get("stops") for r in reached),
        "contacts": int(sum(all_of(runs, "contacts"))),
        "stops": int(sum(all_of(runs, "stops"))),
        "least_mm": min(all_of(runs, "least")),
        "time_by_nominal": median([r["reached"] / r["nominal"] for r in reached]),
        "jerk_told_rms": median(all_of(runs, "jerk_told")),
        "jerk_true_rms": median(all_of(runs, "jerk_true")),
        "chatter_median": median(all_of(runs, "chatter")),
        "blocked": float(np.mean(all_of(runs, "blocked"))),
        "call_us": call_times(runs),
    }


def call_times(runs: Rows) -> dict[str, list[float | None]]:
    """Median and 99.9th percentile of a call, medians over trials, by kind [us]."""
    found = {}
    for kind in ("joints", "tools"):
        some = [r for r in runs if r["kind"] == kind]
        if some:
            found[kind] = [median(all_of(some, key)) for key in ("call", "call_p999")]
    return found


def slid_far(runs: Rows) -> Figures:
    """Figures of slides."""
    if not runs:
        return {"slides": 0}
    shares = [v for r in runs for key, v in r.items() if key.startswith("share ")]
    return {
        "slides": len(runs),
        "share_median": median(shares),
        "share_least": min(shares),
        "stops": int(sum(all_of(runs, "stops"))),
        "contacts": int(sum(all_of(runs, "contacts"))),
        "least_mm": min(all_of(runs, "least")),
        "chatter_median": median(all_of(runs, "chatter")),
    }


def all_of(runs: Rows, name: str) -> list[float]:
    """A number of all runs."""
    return [r.get(name, 0.0) for r in runs]


def median(values: Sequence[float]) -> float | None:
    """The median; None of nothing."""
    return float(np.median(values)) if len(values) else None
