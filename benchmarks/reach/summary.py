"""From trials to figures."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Rows = Sequence[Mapping[str, Any]]

# How goals are reached: straight where that is certified; straight where only a bent
# way is; led along that way.
ROADS = ("straight", "bends", "led")


def summed_up(trials: Rows) -> dict[str, Any]:
    """Figures of trials of one scene with one answer, by road."""
    found: dict[str, Any] = {
        "drawn": len(trials),
        "kinds": dict(Counter(f"{t['kind']}, {t['road']}" for t in trials)),
    }
    for road in ROADS:
        runs = [(t, t["runs"][road]) for t in trials if road in t["runs"]]
        found[road] = figures(runs)
    return found


def figures(runs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]]) -> Any:
    """Figures of some trials; None if there are none."""
    if not runs:
        return None
    outcomes = [o for _, o in runs]
    reached = [o for o in outcomes if o["reached"] is not None and not o["contact"]]
    clean = [o for o in reached if not o["stops"]]
    time = sum(o["time"] for o in outcomes)
    stops = sum(len(o["stops"]) for o in outcomes)
    failed = [
        {"seed": t["seed"], "kind": t["kind"], **told(o)}
        for t, o in runs
        if o not in clean
    ]
    return {
        "goals": len(runs),
        "reached": len(reached),
        "reached_without_stop": len(clean),
        "ends": dict(Counter(o["end"] for o in outcomes)),
        "contacts": sum(o["contact"] is not None for o in outcomes),
        "stops": stops,
        "stops_a_minute": 60.0 * stops / time,
        "trials_with_stops": sum(bool(o["stops"]) for o in outcomes),
        "causes": dict(Counter(s["why"] for o in outcomes for s in o["stops"])),
        "least_mm": 1e3 * min(o["least"] for o in outcomes),
        "time_by_nominal": median([o["reached"] / o["nominal"] for o in reached]),
        "jerk_told_rms": median([o["jerk_told"][0] for o in outcomes]),
        "jerk_told_peak": max(o["jerk_told"][1] for o in outcomes),
        "jerk_true_rms": median([o["jerk_true"][0] for o in outcomes]),
        "jerk_true_peak": max(o["jerk_true"][1] for o in outcomes),
        "chatter_median": median([o["chatter"] for o in outcomes]),
        "chatter_most": max(o["chatter"] for o in outcomes),
        "held_back": mean([o["held_back"] for o in outcomes]),
        "blocked": mean([o["blocked"] for o in outcomes]),
        "unsolved": sum(o["unsolved"] > 0 for o in outcomes),
        "call_us": call_times(runs),
        "failed": failed,
    }


def told(outcome: Mapping[str, Any]) -> dict[str, Any]:
    """Why a trial was not as it should be."""
    stops = outcome["stops"]
    what = stops[0] if stops else outcome["last"]
    return {
        "end": outcome["end"],
        "left": outcome["left"],
        "stops": len(stops),
        "why": what.get("why"),
        "pair": (what.get("pairs") or [None])[0],
        "contact": outcome["contact"],
    }


def call_times(
    runs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]],
) -> dict[str, list[float]]:
    """Median and 99.9th percentile of a call, medians over trials, by kind [us]."""
    found = {}
    for kind in ("joints", "tools"):
        calls = [o["call"] for t, o in runs if t["kind"] == kind]
        if calls:
            found[kind] = [1e6 * median([c[k] for c in calls]) for k in range(2)]
    return found


def slid_far(trials: Rows) -> Any:
    """Figures of slides; None if there are none."""
    slides = [t["slide"] for t in trials if t["slide"] is not None]
    if not slides:
        return None
    shares = [share for s in slides for share in s["share"]]
    return {
        "slides": len(slides),
        "shares": [round(x, 4) for x in shares],
        "share_median": median(shares),
        "share_least": min(shares),
        "stops": sum(len(s["stops"]) for s in slides),
        "contacts": sum(s["contact"] is not None for s in slides),
        "least_mm": 1e3 * min(s["least"] for s in slides),
        "jerk_told_rms": median([s["jerk_told"][0] for s in slides]),
        "chatter_median": median([s["chatter"] for s in slides]),
        "blocked": mean([s["blocked"] for s in slides]),
        "call_us": [1e6 * median([s["call"][k] for s in slides]) for k in range(2)],
        "first": {
            key: slides[0][key] for key in ("tools", "along_m", "height_m", "step_s")
        },
    }


def median(values: Sequence[float]) -> float | None:
    """The median; None of nothing."""
    return float(np.median(values)) if len(values) else None


def mean(values: Sequence[float]) -> float | None:
    """The mean; None of nothing."""
    return float(np.mean(values)) if len(values) else None
