"""Evading: things are thrown and pushed at arms, and those that can get out of the way.

make evading                              1,000 episodes, half of them of two Pandas
make evading ARGS="--episodes 500 --seconds 600"   some of them, for so long at most
make evading ARGS="--place bay --first 17 --episodes 1 --show"   one of them

It resumes: seeds that were run with the same kernels, plant, throws and judge are known
from docs/evading.json, which is written every twenty episodes.

A ball or a box comes straight at a link of an arm that rests or works. The guard is
told where it is and how fast it comes; the plant is late and misses what it is told, by
all that the scene declares. MuJoCo judges true states; an off-line search says whether
there was a way out at all.
"""

import argparse
import json
import multiprocessing
import sys
from collections.abc import Iterable, Iterator
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.cli.console import jsonable, say
from armguard.kernel import kernel_digest
from evading.episode import run_episode
from evading.summary import EXTREME, is_broken, page, sentence, summed_up
from gripping.records import Records

HERE = Path(__file__).parent
RESULTS = HERE.parent / "docs" / "evading.json"

PLACES = ("bay", "pandas")

# Files that tell of episodes, and do not change any; and those of others that do.
TELLING = ("summary.py",)
SHARED = ("judge.py", "judge_model.py", "scenes.py")

# After so many episodes what they came to is written down.
WRITTEN = 20


@cache
def version(place: str) -> str:
    """Hash of all that decides what comes of an episode."""
    digest = sha256(place.encode() + kernel_digest().encode())
    own = sorted((HERE / "evading").glob("*.py"))
    for path in [*own, *(HERE / "closed_loop" / name for name in SHARED)]:
        if path.name not in TELLING:
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def run(
    place: str,
    seeds: Iterable[int],
    *,
    processes: int = 1,
    seconds: float | None = None,
    evade: bool = True,
) -> Iterator[dict[str, Any]]:
    """Figures of episodes as they become ready, in the order of their seeds.

    Args:
        place: Where, one of `PLACES`.
        seeds: Their seeds.
        processes: How many work at a time; 1 works in this one.
        seconds: Time after which no more are waited for [s]; None for no end.
        evade: Whether the arms get out of the way.
    """
    end = None if seconds is None else monotonic() + seconds
    for episode in answers(partial(run_episode, place, evade=evade), seeds, processes):
        yield episode
        if end is not None and monotonic() > end:
            return


def answers(
    work: "partial[dict[str, Any]]", seeds: Iterable[int], processes: int
) -> Iterator[dict[str, Any]]:
    """Figures of episodes as they become ready, by seed."""
    if processes == 1:
        yield from map(work, seeds)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(work, seeds)


def tell(place: str, episode: dict[str, Any]) -> None:
    """An episode in which something is to be looked at, on standard output."""
    if episode["touched"] or (episode["evadable"] and not episode["evaded"]):
        told = {key: value for key, value in episode.items() if key != "cycle_times"}
        print(place, json.dumps(jsonable(told)), flush=True)


def main() -> int:
    """Run; write docs/evading.json and .md; 1 if a promise is broken."""
    chosen = arguments()
    records = Records(RESULTS, version, EXTREME)
    places = (chosen.place,) if chosen.place else PLACES
    broken = False
    for place in places:
        count = chosen.episodes // len(places)
        seeds = range(chosen.first, chosen.first + count)
        todo = seeds if chosen.show else records.todo(place, seeds.start, seeds.stop)
        say(f"{place}: {count} episodes")
        waiting: list[dict[str, Any]] = []
        for episode in run(
            place, todo, processes=chosen.processes, seconds=chosen.seconds
        ):
            tell(place, episode)
            waiting.append(episode)
            if len(waiting) >= WRITTEN and not chosen.show:
                records.add(place, summed_up(waiting))
                waiting = []
        if chosen.show:
            print(json.dumps(jsonable(summed_up(waiting)), indent=1))
            broken |= is_broken(summed_up(waiting))
            continue
        if waiting:
            records.add(place, summed_up(waiting))
        figures = records.kinds.get(place)
        if figures is not None:
            print(sentence(place, figures))
            broken |= is_broken(figures)
    if not chosen.show:
        text = page(records.kinds)
        RESULTS.with_suffix(".md").write_text(text, encoding="utf-8")
        say(f"wrote {RESULTS.name} and its page")
    return int(broken)


def arguments() -> argparse.Namespace:
    """What the user asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=1000, help="of all places")
    parser.add_argument("--first", type=int, default=0, help="first seed of each")
    parser.add_argument("--place", choices=PLACES, help="all if left out")
    parser.add_argument("--seconds", type=float, help="bound for each place [s]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="episodes, no results")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
