"""Figures of many episodes in one dictionary."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from closed_loop.settings import Plan
from episodes.classes import classes, counted, percentile
from episodes.records import Digest, Extreme

Episodes = Sequence[dict[str, Any]]
Figures = dict[str, Any]

# Distance below the floor from which on an episode counts as a breach of it: what the
# judge's own distances may be off [m].
JUDGE_ERROR = 1e-5

# At so many contacts none is listed one by one.
LISTED = 10

# Figures that are no sums: how two of one name are put together.
EXTREME: Extreme = {
    "least_distance_mm": min,
    "longest_cycle_us": max,
    "stop_jerk": max,
}

# Width of a class of cycle times [us].
CYCLE = 5


def summed_up(plan: Plan, episodes: Episodes) -> Figures:
    """Figures of the episodes of a plan."""
    found = sums(plan, episodes)
    return found | derived(plan, found)


def sums(plan: Plan, episodes: Episodes) -> Figures:
    """Figures of episodes, all of which but extremes and cases are sums."""
    contacts = [e for e in episodes if e["contact"] is not None]
    floored = [e for e in episodes if is_below_floor(e)]
    stops = [stop for e in episodes for stop in e["stops"]]
    levels: Counter[str] = Counter()
    for e in episodes:
        for counts in e["levels"].values():
            levels.update(counts)
    asked = [s for s in stops if s["needless"] is not None]
    cycles = [e["cycle_times"] for e in episodes if e["cycle_times"][0] > 0.0]
    found: Figures = {
        "episodes": len(episodes),
        "worst_corner": sum(e["worst"] for e in episodes),
        "seconds_of_motion": sum(e["duration"] for e in episodes),
        "cycles": sum(e["cycles"] for e in episodes),
        "states_judged": sum(e["judged"] for e in episodes),
        "contacts": len(contacts),
        "met_at_rest_as_well": sum(e.get("met_at_rest", 0) for e in episodes),
        "contact_cases": [case(e) for e in contacts[:LISTED]],
        "braked_before_contact": sum(e["braked_before"] for e in contacts),
        "least_distance_mm": 1e3 * min(e["least"] for e in episodes),
        "breaches_of_floor": len(floored),
        "breach_seeds": [e["seed"] for e in floored[:LISTED]],
        "clearances_at_order": classes(1e3 * s["clearance"] for s in stops),
        "clearances_at_rest": classes(1e3 * e["rest"] for e in episodes),
        "episodes_with_a_stop": sum(bool(e["stops"]) for e in episodes),
        "stops": len(stops),
        "releases": sum(e["releases"] for e in episodes),
        "brakes": sum(e["brakes"] for e in episodes),
        "saturated_s": sum(e["saturated"] * e["duration"] for e in episodes),
        "reasons": counted(s["reason"] for s in stops),
        "stops_asked_whether_needless": len(asked),
        "needless_stops": sum(s["needless"] for s in asked),
        "levels": dict(levels),
        "joint_way": sum(e["joint_way"] for e in episodes),
        "joint_wish": sum(e["joint_wish"] for e in episodes),
        "tool_way": sum(e["tool_way"] for e in episodes),
        "stop_jerk": max((e.get("stop_jerk", 0.0) for e in episodes), default=0.0),
        "median_cycles": classes((1e6 * c[0] for c in cycles), CYCLE),
        "slow_cycles": classes((1e6 * c[1] for c in cycles), CYCLE),
        "longest_cycle_us": 1e6 * max((c[2] for c in cycles), default=0.0),
        "worked_s": sum(e["wall"] for e in episodes),
        "by_operator": counted(operator_of(e) for e in episodes),
    }
    if plan.guard == "reference":
        found["armguard"] = sums(beside(plan), [e["beside"] for e in episodes])
    return found


def derived(plan: Plan, found: Figures) -> Figures:
    """What follows from the sums of a plan's episodes."""
    time, way = found["seconds_of_motion"], found["joint_wish"]
    follows: Figures = {
        "plan": asdict(plan),
        "contacts_below_at_95_percent": bound(found["contacts"], found["episodes"]),
        "contact_cases": found["contact_cases"][:LISTED],
        "breach_seeds": found["breach_seeds"][:LISTED],
        "clearance_at_order_mm": quartiles(found["clearances_at_order"]),
        "clearance_at_rest_mm": quartiles(found["clearances_at_rest"]),
        "stops_a_second": found["stops"] / time if time else 0.0,
        "reasons": dict(Counter(found["reasons"]).most_common()),
        "levels": dict(Counter(found["levels"]).most_common()),
        "joint_way_a_second": found["joint_way"] / time if time else 0.0,
        "tool_way_a_second": found["tool_way"] / time if time else 0.0,
        "share_of_wish": found["joint_way"] / way if way else 0.0,
        "cycle_us": {
            "median": middle(found["median_cycles"]),
            "p99": middle(found["slow_cycles"]),
            "max": found["longest_cycle_us"],
        },
        "wall_s_an_episode": found["worked_s"] / max(found["episodes"], 1),
    }
    if "armguard" in found:
        follows["armguard"] = found["armguard"] | derived(
            beside(plan), found["armguard"]
        )
    return follows


def beside(plan: Plan) -> Plan:
    """The same episodes with the real guard."""
    return replace(plan, guard="armguard")


def digest(episode: Figures) -> Digest:
    """What came of an episode, in short."""
    outcome = "contact" if episode["contact"] is not None else ""
    if not outcome and is_below_floor(episode):
        outcome = "below the floor"
    counts = {
        "met_at_rest_as_well": int(episode.get("met_at_rest", 0)),
        "joint_way": round(episode["joint_way"], 4),
    }
    return Digest(episode["seed"], outcome, 1e3 * episode["least"], counts)


def is_below_floor(episode: Figures) -> bool:
    """Whether an arm came nearer to something than the guard was to let it."""
    return bool(episode["least"] < episode["floor"] - JUDGE_ERROR)


def bound(events: int, trials: int) -> float | None:
    """Upper bound of a probability at 95 % confidence (Clopper and Pearson, 1934)."""
    from scipy.stats import beta

    if trials == 0 or events == trials:
        return None
    return float(beta.ppf(0.95, events + 1, trials - events))


def quartiles(counts: Mapping[str, int]) -> list[int]:
    """Least, quartiles and greatest of values that were counted, no less than each."""
    if not counts:
        return []
    return [percentile(counts, part) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]


def middle(counts: Mapping[str, int]) -> int:
    """Median of values that were counted, no less than it is; 0 of none."""
    return percentile(counts, 0.5) if counts else 0


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


def operator_of(episode: Figures) -> str:
    """Name of the first operator of an episode."""
    return str(episode["operator"].split(" + ")[0].split(", speed")[0])
