"""Gripping: what is meant succeeds, what is not meant is never touched.

make gripping                                       10,000 episodes of each kind, hours
make gripping ARGS="--episodes 500 --seconds 600"   some of them, for so long at most
make gripping ARGS="--kind changing --first 17 --episodes 1 --show"   one of them

An operator drives a gantry with a gripper through `Guard.filter`. Its plant is late and
misses what it is told, by all that the scene declares. In `placing` he picks one of
several things up among clutter and puts it down where it is free, on a way that is
proven at rest. In `changing` he is among things 20 mm apart, and changes his mind.
Judged are true states, by closed forms that share nothing with the guard's distances.
"""

import argparse
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.cli.console import jsonable, say
from gripping import changing_intent, pick_and_place
from gripping.summary import is_broken, page, sentence, summed_up

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "gripping_campaign.json"

KINDS: Mapping[str, Callable[[int], dict[str, Any]]] = {
    "placing": pick_and_place.run_episode,
    "changing": changing_intent.run_episode,
}


def run(
    kind: str,
    episodes: int,
    *,
    first: int = 0,
    processes: int = 1,
    seconds: float | None = None,
    told: Callable[[dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """Figures of episodes, in the order of their seeds.

    Args:
        kind: Which, a key of `KINDS`.
        episodes: How many.
        first: First seed.
        processes: How many work at a time; 1 works in this one.
        seconds: Time after which no more are begun [s]; None for no end.
        told: Called with the figures of each.
    """
    end = None if seconds is None else monotonic() + seconds
    found = []
    for episode in answers(kind, range(first, first + episodes), processes):
        found.append(episode)
        if told is not None:
            told(episode)
        if end is not None and monotonic() > end:
            break
    return found


def answers(kind: str, seeds: range, processes: int) -> Iterator[dict[str, Any]]:
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=10_000, help="of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kind", choices=tuple(KINDS), help="all if left out")
    parser.add_argument("--seconds", type=float, help="bound for each kind [s]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="episodes, no results")
    chosen = parser.parse_args()
    results = json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}
    broken = False
    for kind in [chosen.kind] if chosen.kind else KINDS:
        say(f"{kind}: {chosen.episodes} episodes")
        episodes = run(
            kind,
            chosen.episodes,
            first=chosen.first,
            processes=chosen.processes,
            seconds=chosen.seconds,
            told=tell,
        )
        if chosen.show:
            print(json.dumps(jsonable(episodes), indent=1))
        figures = summed_up(kind, episodes)
        print(sentence(kind, figures))
        broken |= is_broken(figures)
        results[kind] = jsonable(figures)
    if not chosen.show:
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
        RESULTS.with_suffix(".md").write_text(page(results), encoding="utf-8")
        say(f"wrote {RESULTS.relative_to(ROOT)} and its page")
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
