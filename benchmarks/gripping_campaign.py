"""Gripping: what is meant succeeds, what is not meant is never touched.

make gripping                              10,000 episodes each, 500 of a Panda, hours
make gripping ARGS="--episodes 500 --seconds 600"   some of them, for so long at most
make gripping ARGS="--kind changing --first 17 --episodes 1 --show"   one of them

It resumes: seeds that were run with the same kernels, plant, operators and judge are
known from docs/gripping_campaign.json, which is written every hundred episodes.

An operator drives a gantry with a gripper through `Guard.filter`. Its plant is late and
misses what it is told, by all that the scene declares. In `placing` he picks one of
several things up among clutter and puts it down where it is free, on a way that is
proven at rest. In `changing` he is among things 20 mm apart, and changes his mind.
In `panda` he places with a Panda. Judged are true states, by closed forms that share
nothing with the guard's distances, and those of the Panda's own meshes by MuJoCo.
"""

import argparse
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import ceil
from pathlib import Path
from time import monotonic
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.cli.console import jsonable, say
from gripping import changing_intent, panda_episode, pick_and_place
from gripping.records import Records
from gripping.summary import is_broken, page, sentence, summed_up

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "gripping_campaign.json"

KINDS: Mapping[str, Callable[[int], dict[str, Any]]] = {
    "placing": pick_and_place.run_episode,
    "changing": changing_intent.run_episode,
    "panda": panda_episode.run_episode,
}

# Share of the episodes that are run of a kind where all are run [-].
SHARES = {"panda": 0.05}

# After so many episodes what they came to is written down.
WRITTEN = 100


def run(
    kind: str,
    seeds: Iterable[int],
    *,
    processes: int = 1,
    seconds: float | None = None,
) -> Iterator[dict[str, Any]]:
    """Figures of episodes as they become ready, in the order of their seeds.

    Args:
        kind: Which, a key of `KINDS`.
        seeds: Their seeds.
        processes: How many work at a time; 1 works in this one.
        seconds: Time after which no more are waited for [s]; None for no end.
    """
    end = None if seconds is None else monotonic() + seconds
    for episode in answers(kind, seeds, processes):
        yield episode
        if end is not None and monotonic() > end:
            return


def answers(
    kind: str, seeds: Iterable[int], processes: int
) -> Iterator[dict[str, Any]]:
    """Figures of episodes as they become ready, by seed."""
    if processes == 1:
        yield from map(KINDS[kind], seeds)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(KINDS[kind], seeds)


def tell(episode: dict[str, Any]) -> None:
    """An episode in which something is to be looked at, on standard output."""
    if episode["touched"] or episode["stops"] or episode.get("failed"):
        print(json.dumps(jsonable(episode)), flush=True)


def main() -> int:
    """Run; write docs/gripping_campaign.json and .md; 1 if a promise is broken."""
    chosen = arguments()
    records = Records(RESULTS)
    broken = False
    for kind in [chosen.kind] if chosen.kind else KINDS:
        share = 1.0 if chosen.kind else SHARES.get(kind, 1.0)
        count = ceil(share * chosen.episodes)
        seeds = range(chosen.first, chosen.first + count)
        todo = seeds if chosen.show else records.todo(kind, seeds.start, seeds.stop)
        say(f"{kind}: {count} episodes")
        waiting: list[dict[str, Any]] = []
        for episode in run(
            kind, todo, processes=chosen.processes, seconds=chosen.seconds
        ):
            tell(episode)
            waiting.append(episode)
            if len(waiting) >= WRITTEN and not chosen.show:
                records.add(kind, summed_up(kind, waiting))
                waiting = []
        if chosen.show:
            print(json.dumps(jsonable(waiting), indent=1))
            broken |= is_broken(summed_up(kind, waiting))
            continue
        if waiting:
            records.add(kind, summed_up(kind, waiting))
        figures = records.kinds.get(kind)
        if figures is not None:
            print(sentence(kind, figures))
            broken |= is_broken(figures)
    if not chosen.show:
        text = page(records.kinds)
        RESULTS.with_suffix(".md").write_text(text, encoding="utf-8")
        say(f"wrote {RESULTS.relative_to(ROOT)} and its page")
    return int(broken)


def arguments() -> argparse.Namespace:
    """What the user asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=10_000, help="of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kind", choices=tuple(KINDS), help="all if left out")
    parser.add_argument("--seconds", type=float, help="bound for each kind [s]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="episodes, no results")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
