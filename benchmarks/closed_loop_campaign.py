"""The closed loop: operators who mean no good against the guard's certificate.

make closed-loop                                         all of it, hours; it resumes
make closed-loop ARGS="--episodes 500 --scene bay"       some of it, to try it out
make closed-loop ARGS="--first 500 --episodes 500"       a chunk of it
python benchmarks/closed_loop_campaign.py --zero command     the test must see this
python benchmarks/closed_loop_campaign.py --weak-brake 0.7   does the guard brake?
python benchmarks/closed_loop_campaign.py --show 17 --scene bay     one episode
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.cli.console import jsonable, say
from armguard.kernel import kernel_digest
from closed_loop.guards import GUARDS
from closed_loop.page import page
from closed_loop.plan import Plan, work
from closed_loop.runs import finished, run_plan
from closed_loop.settings import SCENES
from closed_loop.summary import summed_up
from closed_loop.zeroing import FILTERED as FILTERED_TERMS
from closed_loop.zeroing import TERMS

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "closed_loop.json"
FOLDER = ROOT / "out" / "closed_loop"

# Episodes of one guard are kept apart from those of another: in a folder of its own.
KERNELS = kernel_digest()

# Share of the episodes that go to each question when all are asked [-].
TEETH = 0.05
WEAK = 0.1
NEEDLESS = 0.05
REFERENCE = 0.02
FILTERED = 0.2


def arguments() -> argparse.Namespace:
    """What the user asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=10_000, help="a scene and mode")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--scene", choices=SCENES, help="all if left out")
    parser.add_argument("--mode", choices=("path", "speed"), help="both if left out")
    parser.add_argument("--zero", choices=TERMS, help="term told to be nothing")
    parser.add_argument("--large", choices=TERMS, help="the same, but told as it is")
    parser.add_argument("--weak-brake", type=float, default=1.0)
    parser.add_argument("--floor", type=float, help="in place of the settings' [m]")
    parser.add_argument("--guard", choices=tuple(GUARDS), default="armguard")
    parser.add_argument("--duration", type=float, default=1.0, help="longest [s]")
    parser.add_argument("--needless", action="store_true", help="search every stop")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seconds", type=float, help="bound for each plan [s]")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--show", type=int, metavar="SEED", help="one episode")
    parser.add_argument("--page", action="store_true", help="from the last results")
    return parser.parse_args()


def plans(chosen: argparse.Namespace) -> list[tuple[Plan, int]]:
    """What is to be run, and how many episodes of it."""
    scenes = [chosen.scene] if chosen.scene else list(SCENES)
    modes = [chosen.mode] if chosen.mode else ["path", "speed"]
    asked = {
        "guard": chosen.guard,
        "zero": chosen.zero,
        "large": chosen.large,
        "weak_brake": chosen.weak_brake,
        "floor": chosen.floor,
        "duration": chosen.duration,
        "needless": chosen.needless,
    }
    count = chosen.episodes
    found = [(Plan(s, m, **asked), count) for s in scenes for m in modes]
    special = chosen.zero or chosen.large or chosen.weak_brake != 1.0
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


def main() -> int:
    """Run; write docs/closed_loop.json and .md; 1 if the guard's promise is broken."""
    chosen = arguments()
    if chosen.page:
        write_page(json.loads(RESULTS.read_text("utf-8")))
        return 0
    todo = plans(chosen)
    if chosen.show is not None:
        print(json.dumps(jsonable(work((todo[0][0], chosen.show))), indent=1))
        return 0
    broken, folder = False, chosen.folder / KERNELS
    for plan, count in todo:
        episodes = run_plan(
            plan,
            count,
            folder,
            first=chosen.first,
            processes=chosen.processes,
            seconds=chosen.seconds,
        )
        figures = {**summed_up(plan, episodes), "kernels": KERNELS}
        if plan.guard == "reference":
            figures["armguard"] = beside(plan, episodes, folder)
        told(figures)
        kept = not plan.zero and plan.weak_brake == 1.0
        broken |= kept and figures["contacts"] > 0
        if plan.guard in ("armguard", "filter", "reference"):
            keep(plan.name, figures)
    return int(broken)


def beside(
    plan: Plan, episodes: list[dict[str, Any]], folder: Path
) -> dict[str, Any] | None:
    """Figures of the real guard in the same episodes; None if it was not in all."""
    real = replace(plan, guard="armguard")
    done = finished(folder / f"{real.name}.jsonl")
    seeds = [e["seed"] for e in episodes]
    if not all(seed in done for seed in seeds):
        return None
    return summed_up(real, [done[seed] for seed in seeds])


def told(figures: dict[str, Any]) -> None:
    """The figures that matter, on standard output."""
    print(
        f"{Plan(**figures['plan']).name}: {figures['episodes']} episodes, "
        f"{figures['contacts']} contacts ({figures['braked_before_contact']} after a "
        f"brake), least {figures['least_distance_mm']:.2f} mm, "
        f"{figures['breaches_of_floor']} below the floor, {figures['stops']} stops, "
        f"{figures['share_of_wish']:.0%} of the wish, "
        f"{figures['wall_s_an_episode']:.2f} s an episode"
    )


def keep(name: str, figures: dict[str, Any]) -> None:
    """Put figures of a plan beside the others' in docs/."""
    results = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}
    results[name] = jsonable(figures)
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    write_page(results)
    say(f"wrote {RESULTS.relative_to(ROOT)} and its page")


def write_page(results: dict[str, Any]) -> None:
    """Write docs/closed_loop.md."""
    RESULTS.with_suffix(".md").write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
