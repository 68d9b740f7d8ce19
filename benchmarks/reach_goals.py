"""Operators with goals: how many are reached, with each response and with a peer.

make reach                                            all of it; it resumes
make reach ARGS="--episodes 20 --scene bay --response deflect"
make reach ARGS="--seconds 600 --processes 2"         as far as it gets
make reach ARGS="--slides 3 --episodes 0"             slides only
make reach ARGS="--scene bay --show --first 17 --episodes 1"   one trial, in full
make reach ARGS="--page"                              from what is known

All guards and peers are given the same goals, some at a time, so that wherever it ends
they can be compared. It resumes: trials that were run with the same kernels and
operators are known from docs/episodes/reach.jsonl.
The peer, mink, is left out where it is not installed: `pip install mink "qpsolvers"`.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from time import monotonic
from typing import Any

from armguard.cli.console import say
from episodes.campaign import Campaign, Episode, parser_of
from episodes.records import Figures, version_of
from pages import DOCS
from reach.answers import ANSWERS, PEERS, is_installed
from reach.arena import SCENES, is_there
from reach.runs import work
from reach.summary import digest, write_page

# So many trials are run with one answer before the next one has its turn.
TURN = 10


def arguments() -> argparse.Namespace:
    """Options of the user."""
    parser = parser_of(__doc__, 100)
    parser.add_argument("--slides", type=int, default=3, help="slides of a scene")
    parser.add_argument("--scene", choices=SCENES, help="all if left out")
    parser.add_argument("--response", choices=ANSWERS, help="all if left out")
    return parser.parse_args()


def main() -> int:
    """Run; write docs/reach.json and .md; 1 if a guard let something touch."""
    chosen = arguments()
    kinds = list(kinds_of(chosen))
    campaign = campaign_of(kinds)
    if chosen.show or chosen.again:
        return campaign.do(chosen, dict.fromkeys(kinds, chosen.episodes))
    end = None if chosen.seconds is None else monotonic() + chosen.seconds
    broken = False
    for first in (
        [] if chosen.page else range(0, max(chosen.slides, chosen.episodes), TURN)
    ):
        for kind in kinds:
            count = chosen.slides if kind.endswith("slides") else chosen.episodes
            if first < count and (end is None or monotonic() < end):
                turn = argparse.Namespace(**{**vars(chosen), "first": first})
                turn.seconds = None if end is None else end - monotonic()
                broken |= campaign.go_on(kind, turn, min(TURN, count - first))
    write_page(campaign.records, DOCS)
    say("wrote docs/reach.json and its page")
    return int(broken)


def kinds_of(chosen: argparse.Namespace) -> Iterator[str]:
    """What is to be run, a scene after the other."""
    names = [a for a in ANSWERS if chosen.response in (None, a)]
    if not is_installed() and any(name in PEERS for name in names):
        say("the peer is left out: mink or qpsolvers is not installed")
        names = [name for name in names if name not in PEERS]
    for scene in [s for s in SCENES if chosen.scene in (None, s)]:
        if is_there(scene):
            yield from (f"{scene}/{n}/{w}" for n in names for w in ("slides", "goals"))
        else:
            say(f"{scene} is left out: the public scenes are not here")


def campaign_of(kinds: list[str]) -> Campaign:
    """The campaign that runs some kinds of trials."""
    return Campaign(
        results=DOCS / "reach.json",
        kinds={kind: partial(work, *kind.split("/")) for kind in kinds},
        version=version_of("reach.runs"),
        extreme={"first": lambda one, _: one},
        summed_up=summed_up,
        digest=digest,
        sentence=lambda kind, found: f"{kind}: {found['episodes']} trials",
        page=lambda _: "",
        is_broken=is_broken,
        is_notable=lambda trial: False,
        written=TURN,
    )


def summed_up(kind: str, trials: list[Episode]) -> Figures:
    """What is known of trials beside what is kept of each."""
    answer = kind.split("/")[1]
    contacts = sum("contact" in digest(t).outcome for t in trials)
    found: Figures = {
        "episodes": len(trials),
        "contacts": contacts,
        "guarded": int(answer not in PEERS),
    }
    if kind.endswith("slides"):
        drawn = ("along_m", "step_s")
        found["first"] = {key: trials[0]["slide"][key] for key in drawn}
    return found


def is_broken(figures: Mapping[str, Any]) -> bool:
    """Whether anything touched that a guard watched."""
    return bool(figures["guarded"] and figures["contacts"])


if __name__ == "__main__":
    sys.exit(main())
