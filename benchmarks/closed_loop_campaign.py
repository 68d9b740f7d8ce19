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
from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from closed_loop.plan import work
from closed_loop.settings import FILTERED_TERMS, SCENES, TERMS, Plan
from closed_loop.summary import EXTREME, beside, derived, digest, sums
from episodes.campaign import Campaign, Episode, LeftOut, parser_of
from episodes.records import version_of
from pages import DOCS

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
    """What the user asks for."""
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
        version=version_of(Path(__file__).parent / "closed_loop"),
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
