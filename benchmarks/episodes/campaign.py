"""A campaign: kinds of episodes, what is run of each, and how what came is told."""

import argparse
import json
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from time import monotonic
from typing import Any

from armguard.cli.console import jsonable, say
from episodes.records import Figures, Records

Episode = dict[str, Any]


@dataclass(frozen=True)
class Campaign:
    """What is run, and who tells of it.

    Attributes:
        results: Where figures are kept; their page stands beside them.
        kinds: What runs the episode of a seed, by kind; it goes to other processes.
        version: Hash of all that decides what comes of an episode of a kind.
        extreme: Figures that are no sums, and how two of one name are put together.
        summed_up: Figures of episodes of a kind.
        sentence: Sentence about the figures of a kind.
        page: The page, from the figures of all kinds.
        is_broken: Whether figures break a promise.
        is_told: Whether something is to be looked at in an episode.
        untold: Keys of an episode that say nothing to who looks at it.
        count: How many episodes of each kind are run if nothing is said.
        shares: How many of them are run of a kind, 1 if left out [-].
        written: After so many what they came to is written down.
    """

    results: Path
    kinds: Mapping[str, Callable[[int], Episode]]
    version: Callable[[str], str]
    extreme: Mapping[str, Callable[[float, float], float]]
    summed_up: Callable[[str, list[Episode]], Figures]
    sentence: Callable[[str, Figures], str]
    page: Callable[[Mapping[str, Figures]], str]
    is_broken: Callable[[Figures], bool]
    is_told: Callable[[Episode], bool]
    untold: Sequence[str] = ()
    count: int = 10_000
    shares: Mapping[str, float] = field(default_factory=dict)
    written: int = 100

    def run(
        self,
        kind: str,
        seeds: Iterable[int],
        *,
        processes: int = 1,
        seconds: float | None = None,
    ) -> Iterator[Episode]:
        """Episodes as they become ready, in the order of their seeds.

        Args:
            kind: Which, a key of `kinds`.
            seeds: Their seeds.
            processes: How many work at a time; 1 works in this one.
            seconds: Time after which no more are waited for [s]; None for no end.
        """
        end = None if seconds is None else monotonic() + seconds
        for episode in answers(self.kinds[kind], seeds, processes):
            yield episode
            if end is not None and monotonic() > end:
                return

    def told_of(self, episode: Episode) -> Episode:
        """What of an episode somebody may look at."""
        return {key: e for key, e in episode.items() if key not in self.untold}

    def show(self, kind: str, chosen: argparse.Namespace) -> bool:
        """Run episodes and print them, each in full; whether a promise is broken."""
        seeds = range(chosen.first, chosen.first + chosen.episodes)
        found = list(self.run(kind, seeds, processes=chosen.processes))
        print(json.dumps(jsonable([self.told_of(e) for e in found]), indent=1))
        return self.is_broken(self.summed_up(kind, found))

    def go_on(self, kind: str, chosen: argparse.Namespace, records: Records) -> bool:
        """Run what is not known yet of a kind; whether a promise is broken."""
        share = 1.0 if chosen.kind else self.shares.get(kind, 1.0)
        count = ceil(share * chosen.episodes)
        say(f"{kind}: {count} episodes")
        todo = records.todo(kind, chosen.first, chosen.first + count)
        waiting: list[Episode] = []
        for episode in self.run(
            kind, todo, processes=chosen.processes, seconds=chosen.seconds
        ):
            if self.is_told(episode):
                print(kind, json.dumps(jsonable(self.told_of(episode))), flush=True)
            waiting.append(episode)
            if len(waiting) >= self.written:
                records.add(kind, self.summed_up(kind, waiting))
                waiting = []
        if waiting:
            records.add(kind, self.summed_up(kind, waiting))
        figures = records.kinds.get(kind)
        if figures is None:
            return False
        print(self.sentence(kind, figures))
        return self.is_broken(figures)

    def main(self, says: str | None) -> int:
        """Do as the command line asks; 1 if a promise is broken.

        Args:
            says: What the command says of itself.
        """
        chosen = self.arguments(says)
        kinds = [chosen.kind] if chosen.kind else list(self.kinds)
        if chosen.show:
            broken = [self.show(kind, chosen) for kind in kinds]
            return int(any(broken))
        records = Records(self.results, self.version, self.extreme)
        broken = [self.go_on(kind, chosen, records) for kind in kinds]
        text = self.page(records.kinds)
        self.results.with_suffix(".md").write_text(text, encoding="utf-8")
        say(f"wrote {self.results.name} and its page")
        return int(any(broken))

    def arguments(self, says: str | None) -> argparse.Namespace:
        """What the user asks for."""
        parser = argparse.ArgumentParser(
            description=says, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        parser.add_argument(
            "--episodes", type=int, default=self.count, help="of each kind"
        )
        parser.add_argument("--first", type=int, default=0, help="first seed")
        parser.add_argument("--kind", choices=tuple(self.kinds), help="all if left out")
        parser.add_argument("--seconds", type=float, help="bound for each kind [s]")
        parser.add_argument("--processes", type=int, default=2)
        parser.add_argument("--show", action="store_true", help="episodes, no results")
        return parser.parse_args()


def answers(
    work: Callable[[int], Episode], seeds: Iterable[int], processes: int
) -> Iterator[Episode]:
    """What work gives for each seed, as it becomes ready, in their order."""
    if processes == 1:
        yield from map(work, seeds)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(work, seeds)
