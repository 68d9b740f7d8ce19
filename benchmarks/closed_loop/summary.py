"""Figures of many episodes in one dictionary."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from closed_loop.plan import Plan

Episodes = Sequence[dict[str, Any]]

# Distance below the floor from which on an episode counts as a breach of it: what the
# judge's own distances may be off [m].
JUDGE_ERROR = 1e-5

# At so many contacts none is told one by one.
TOLD = 10


def summed_up(plan: Plan, episodes: Episodes) -> dict[str, Any]:
    """Figures of the episodes of a plan."""
    contacts = [e for e in episodes if e["contact"] is not None]
    floored = [e for e in episodes if e["least"] < e["floor"] - JUDGE_ERROR]
    stops = [stop for e in episodes for stop in e["stops"]]
    levels: Counter[str] = Counter()
    for e in episodes:
        for counts in e["levels"].values():
            levels.update(counts)
    asked = [s for s in stops if s["needless"] is not None]
    time = sum(e["duration"] for e in episodes)
    wish = sum(e["joint_wish"] for e in episodes)
    cycles = [e["cycle_times"] for e in episodes if e["cycle_times"][0] > 0.0]
    return {
        "plan": plan.to_dict(),
        "episodes": len(episodes),
        "worst_corner": sum(e["worst"] for e in episodes),
        "seconds_of_motion": time,
        "cycles": sum(e["cycles"] for e in episodes),
        "states_judged": sum(e["judged"] for e in episodes),
        "contacts": len(contacts),
        "contacts_below_at_95_percent": bound(len(contacts), len(episodes)),
        "contact_cases": [case(e) for e in contacts[:TOLD]],
        "braked_before_contact": sum(e["braked_before"] for e in contacts),
        "least_distance_mm": least(episodes),
        "breaches_of_floor": len(floored),
        "breach_seeds": [e["seed"] for e in floored[:TOLD]],
        "clearance_at_order_mm": quartiles([1e3 * s["clearance"] for s in stops]),
        "clearance_at_rest_mm": quartiles([1e3 * e["rest"] for e in episodes]),
        "episodes_with_a_stop": sum(bool(e["stops"]) for e in episodes),
        "stops": len(stops),
        "stops_a_second": len(stops) / time if time else 0.0,
        "releases": sum(e["releases"] for e in episodes),
        "reasons": dict(Counter(s["reason"] for s in stops).most_common()),
        "stops_asked_whether_needless": len(asked),
        "needless_stops": sum(s["needless"] for s in asked),
        "levels": dict(levels.most_common()),
        "joint_way_a_second": sum(e["joint_way"] for e in episodes) / time
        if time
        else 0.0,
        "tool_way_a_second": sum(e["tool_way"] for e in episodes) / time
        if time
        else 0.0,
        "share_of_wish": sum(e["joint_way"] for e in episodes) / wish if wish else 0.0,
        "cycle_us": {
            "median": 1e6 * float(np.median([c[0] for c in cycles])) if cycles else 0.0,
            "p99": 1e6 * float(np.median([c[1] for c in cycles])) if cycles else 0.0,
            "max": 1e6 * max((c[2] for c in cycles), default=0.0),
        },
        "wall_s_an_episode": float(np.median([e["wall"] for e in episodes]))
        if episodes
        else 0.0,
        "by_operator": by_operator(episodes),
    }


def bound(events: int, trials: int) -> float | None:
    """Upper bound of a probability at 95 % confidence (Clopper and Pearson, 1934)."""
    from scipy.stats import beta

    if trials == 0 or events == trials:
        return None
    return float(beta.ppf(0.95, events + 1, trials - events))


def least(episodes: Episodes) -> float | None:
    """Least distance kept by pairs of which an arm moved [mm]."""
    return 1e3 * min((e["least"] for e in episodes), default=float("nan"))


def quartiles(values: Sequence[float]) -> list[float]:
    """Least, quartiles and greatest of some values."""
    if not values:
        return []
    return [round(float(x), 3) for x in np.percentile(values, (0, 25, 50, 75, 100))]


def case(episode: dict[str, Any]) -> dict[str, Any]:
    """A contact, and how to run it again."""
    contact = episode["contact"]
    return {
        "seed": episode["seed"],
        "setting": episode["setting"],
        "operator": episode["operator"],
        "pair": [contact["a"], contact["b"]],
        "time_s": contact["time"],
        "depth_mm": 1e3 * contact["depth"],
        "stops": [
            {k: stop[k] for k in ("arm", "time", "reason", "clearance")}
            for stop in episode["stops"]
        ],
    }


def by_operator(episodes: Episodes) -> dict[str, dict[str, float]]:
    """Episodes, contacts and least distance by the first operator's name."""
    found: dict[str, dict[str, float]] = {}
    for e in episodes:
        name = e["operator"].split(" + ")[0].split(", speed")[0]
        row = found.setdefault(name, {"episodes": 0, "contacts": 0, "least_mm": np.inf})
        row["episodes"] += 1
        row["contacts"] += e["contact"] is not None
        row["least_mm"] = min(row["least_mm"], 1e3 * e["least"])
    return dict(sorted(found.items()))
