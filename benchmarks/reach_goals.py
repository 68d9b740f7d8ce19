"""Operators with goals: who gets there, with each response and with a peer.

python benchmarks/reach_goals.py                                  all of it; it resumes
python benchmarks/reach_goals.py --episodes 20 --scene bay --response deflect
python benchmarks/reach_goals.py --seconds 600 --processes 2      as far as it gets
python benchmarks/reach_goals.py --slides 3 --episodes 0          slides only
python benchmarks/reach_goals.py --show 17 --scene bay            one trial, in full
python benchmarks/reach_goals.py --page                           from what is done

The peer, mink, is left out where it is not installed: `pip install mink "qpsolvers"`.
"""

import argparse
import json
import sys
from pathlib import Path
from time import monotonic
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.cli.console import jsonable, say
from armguard.kernel import kernel_digest
from reach.answers import ANSWERS
from reach.page import goal_section, slide_section, write_page
from reach.peer import PEERS, is_installed
from reach.runs import run_trials, work
from reach.scenes import SCENES, is_there
from reach.summary import ROADS, slid_far, summed_up

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "reach.json"
FOLDER = ROOT / "out" / "reach"


def arguments() -> argparse.Namespace:
    """What the user asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=100, help="goals of a scene")
    parser.add_argument("--slides", type=int, default=3, help="slides of a scene")
    parser.add_argument("--scene", choices=SCENES, help="all if left out")
    parser.add_argument("--response", choices=ANSWERS, help="all if left out")
    parser.add_argument("--seconds", type=float, help="bound for all of it [s]")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--show", type=int, metavar="SEED", help="one trial")
    parser.add_argument("--page", action="store_true", help="from what is done")
    return parser.parse_args()


def main() -> int:
    """Run; write docs/reach.json and .md; 1 if a guard let something touch."""
    chosen = arguments()
    scenes = [s for s in SCENES if chosen.scene in (None, s)]
    names = [a for a in ANSWERS if chosen.response in (None, a)]
    for scene in [s for s in scenes if not is_there(s)]:
        say(f"{scene} is left out: the public scenes are not here")
        scenes.remove(scene)
    if not is_installed() and any(name in PEERS for name in names):
        say("the peer is left out: mink or qpsolvers is not installed")
        names = [name for name in names if name not in PEERS]
    if chosen.show is not None:
        for name in names:
            print(json.dumps(work((scenes[0], name, "goals", chosen.show)), indent=1))
        return 0
    end = None if chosen.seconds is None else monotonic() + chosen.seconds
    if chosen.page:
        end = monotonic() - 1.0
    found = {"goals": {}, "slides": {}}
    folder = chosen.folder / kernel_digest()
    for scene in scenes:
        for name in names:
            for what, count in (("slides", chosen.slides), ("goals", chosen.episodes)):
                trials = run_trials(
                    scene,
                    name,
                    what,
                    count,
                    folder,
                    processes=1 if chosen.page else chosen.processes,
                    end=end,
                )
                if trials:
                    figures = summed_up(trials) if what == "goals" else slid_far(trials)
                    found[what].setdefault(scene, {})[name] = figures
    told(found)
    keep(found)
    return int(touched(found))


def told(found: dict[str, Any]) -> None:
    """The tables, on standard output."""
    for road in ROADS:
        print("\n".join(goal_section(found["goals"], road)))
    print("\n".join(slide_section(found["slides"])))


def keep(found: dict[str, Any]) -> None:
    """Put figures beside those of other scenes and responses in docs/."""
    results: dict[str, Any] = {"goals": {}, "slides": {}}
    if RESULTS.exists():
        results = json.loads(RESULTS.read_text("utf-8"))
    for what, scenes in found.items():
        for scene, figures in scenes.items():
            results[what].setdefault(scene, {}).update(jsonable(figures))
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    write_page(results, RESULTS.parent)
    say(f"wrote {RESULTS.relative_to(ROOT)} and its page")


def touched(found: dict[str, Any]) -> bool:
    """Whether anything touched that a guard watched."""
    guarded = [
        figures
        for scene in found["goals"].values()
        for name, roads in scene.items()
        if name not in PEERS
        for figures in (roads[road] for road in ROADS)
        if figures
    ]
    return any(figures["contacts"] for figures in guarded)


if __name__ == "__main__":
    sys.exit(main())
