"""The closed loop: operators who try to cause contact against the guard's proof.

make closed-loop                                         all of it, hours; it resumes
make closed-loop ARGS="--episodes 500 --scene bay"       some of it
make closed-loop ARGS="--first 500 --episodes 500"       a chunk of it
make closed-loop ARGS="--scene bay --again 50"           known episodes, compared
make closed-loop ARGS="--plant torque --scene bay --mode path"   torque limits, MuJoCo
make closed-loop ARGS="--swing both --scene bay"         joints swing back as well
make closed-loop ARGS="--zero command"                   contacts must appear
make closed-loop ARGS="--weak-brake 0.7"                 the guard must order the brake
make closed-loop ARGS="--show --first 17 --episodes 1 --scene bay"   one, in full
make closed-loop ARGS="--page"                           the page, from known figures

It resumes: seeds that were run with the same kernels, plant, operators and judge are
known from docs/closed_loop.json.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from typing import Any

from closed_loop.plan import work
from closed_loop.settings import FILTERED_TERMS, SCENES, TERMS, Plan
from episodes.campaign import Campaign, Episode, LeftOut, parser_of
from episodes.classes import classes, counted, percentile
from episodes.records import Digest, Extreme, version_of
from pages import DOCS

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
        "distance_at_order": classes(1e3 * s["distance"] for s in stops),
        "distance_at_rest": classes(1e3 * e["rest"] for e in episodes),
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
        "distance_at_order_mm": quartiles(found["distance_at_order"]),
        "distance_at_rest_mm": quartiles(found["distance_at_rest"]),
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
            {k: stop[k] for k in ("arm", "time", "reason", "distance")}
            for stop in episode["stops"]
        ],
    }


def operator_of(episode: Figures) -> str:
    """Name of the first operator of an episode."""
    return str(episode["operator"].split(" + ")[0].split(", speed")[0])


# Guards whose episodes are kept; the others are the tests'.
GUARDS = ("armguard", "filter", "reference")

PLANTS = ("exact", "torque")
SWINGS = ("onwards", "both")

# Share of the episodes that go to each question when all are asked [-].
TEETH = 0.05
WEAK = 0.1
NEEDLESS = 0.05
REFERENCE = 0.02
FILTERED = 0.2


def arguments() -> argparse.Namespace:
    """Options of the user."""
    parser = parser_of(__doc__, 10_000)
    parser.add_argument("--scene", choices=SCENES, help="all if left out")
    parser.add_argument("--mode", choices=("path", "speed"), help="both if left out")
    parser.add_argument("--zero", choices=TERMS, help="term declared as zero")
    parser.add_argument("--large", choices=TERMS, help="as large, but declared")
    parser.add_argument("--weak-brake", type=float, default=1.0)
    parser.add_argument("--floor", type=float, help="in place of the settings' [m]")
    parser.add_argument("--guard", choices=GUARDS, default="armguard")
    parser.add_argument("--duration", type=float, default=1.0, help="longest [s]")
    parser.add_argument("--plant", choices=PLANTS, default="exact")
    parser.add_argument("--swing", choices=SWINGS, default="onwards")
    parser.add_argument("--needless", action="store_true", help="search every stop")
    chosen = parser.parse_args()
    if chosen.plant != "exact" and (chosen.zero or chosen.large):
        parser.error("terms are made large with the plant `exact` only")
    return chosen


def plans(chosen: argparse.Namespace) -> list[tuple[Plan, int]]:
    """Plans to be run, and how many episodes of each."""
    scenes = [chosen.scene] if chosen.scene else list(SCENES)
    modes = [chosen.mode] if chosen.mode else ["path", "speed"]
    names = {field.name for field in fields(Plan)} - {"scene", "mode"}
    asked = {name: value for name, value in vars(chosen).items() if name in names}
    count = chosen.episodes
    found = [(Plan(s, m, **asked), count) for s in scenes for m in modes]
    attacked = chosen.zero or chosen.large or chosen.weak_brake != 1.0
    special = attacked or (chosen.plant, chosen.swing) != ("exact", "onwards")
    if special or chosen.scene or chosen.mode:
        return found
    for term in TERMS:
        scene = "movers" if term == "top_speed" else "bay"
        guard = "filter" if term in FILTERED_TERMS else chosen.guard
        for key in ("zero", "large"):
            plan = Plan(scene, "path", **{**asked, "guard": guard, key: term})
            found.append((plan, max(int(TEETH * count), 1)))
    more = [({"weak_brake": 0.7}, WEAK), ({"needless": True}, NEEDLESS)]
    more.append(({"guard": "filter"}, FILTERED))
    more.append(({"guard": "reference"}, REFERENCE))
    for change, share in more:
        for scene in scenes if "guard" in change else ["bay"]:
            plan = Plan(scene, "path", **{**asked, **change})
            found.append((plan, max(int(share * count), 1)))
    return found


def run_episode(plan: Plan, seed: int) -> Episode:
    """An episode; of the reference guard, the same with the real one beside it.

    Raises:
        LeftOut: The plant broke a figure that is declared for it.
    """
    found = dict(work((plan, seed)))
    if found["broke"] is not None:
        touched = ", and something touched" if found["contact"] else ""
        raise LeftOut(f"the plant broke its own figures ({found['broke']}){touched}")
    if plan.guard == "reference":
        found["beside"] = work((beside(plan), seed))
    return found


def is_broken(figures: Mapping[str, Any]) -> bool:
    """Whether there were contacts though what is declared is true."""
    plan = figures["plan"]
    honest = not plan["zero"] and plan["weak_brake"] == 1.0
    return bool(honest and figures["contacts"] > 0)


def campaign_of(plans: Mapping[str, Plan]) -> Campaign:
    """The campaign that runs some plans, by their names."""
    return Campaign(
        results=DOCS / "closed_loop.json",
        kinds={name: partial(run_episode, plan) for name, plan in plans.items()},
        version=version_of("closed_loop.plan"),
        extreme=EXTREME,
        summed_up=lambda name, episodes: sums(plans[name], episodes),
        derived=lambda name, found: derived(plans[name], found),
        digest=digest,
        is_broken=is_broken,
        is_notable=lambda episode: episode["contact"] is not None,
    )


def main() -> int:
    """Run; write docs/closed_loop.json and .md; 1 if the guard's promise is broken."""
    chosen = arguments()
    found = plans(chosen)
    campaign = campaign_of({plan.name: plan for plan, _ in found})
    return campaign.do(chosen, {plan.name: count for plan, count in found})


if __name__ == "__main__":
    sys.exit(main())
