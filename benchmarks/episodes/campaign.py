"""A campaign: kinds of episodes, how many of each, and what is written of them."""

import argparse
import json
import multiprocessing
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from math import ceil, inf
from pathlib import Path
from time import monotonic
from typing import Any

from armguard.cli.console import jsonable, say
from episodes.records import Digest, Extreme, Figures, Records, ranges_of
from pages import page

Episode = dict[str, Any]

# Longest an episode may take; the first of a process builds its scene, and may compile
# [s].
PATIENCE = 900.0

# So many episodes of an earlier version are to be the same before all of them count.
COMPARED = 50


class LeftOut(Exception):
    """An episode without a result: its message is the reason it is counted by."""


def numbers(kind: str, figures: Figures) -> str:
    """The plain numbers among figures, in one line."""
    found = ((n, f) for n, f in figures.items() if isinstance(f, int | float))
    return f"{kind}: " + ", ".join(f"{name} {figure:g}" for name, figure in found)


@dataclass(frozen=True)
class Campaign:
    """What is run, and how it is reported.

    Attributes:
        results: Where figures are kept; their page is beside them.
        kinds: What runs the episode of a seed, by kind; it goes to other processes.
        version: Hash of all that decides what comes of an episode of a kind.
        extreme: Figures that are no sums, and how two of one name are put together.
        summed_up: Figures of episodes of a kind.
        digest: What came of an episode, in short.
        is_broken: Whether figures break a promise.
        is_notable: Whether an episode is printed: it is to be looked at.
        count: How many episodes of each kind are run if nothing is said.
        shares: How many of them are run of a kind, 1 if left out [-].
        written: After so many what they came to is written down.
        derived: Figures of a kind that follow from its sums.
        sentence: Sentence about the figures of a kind.
        page: The page, from the figures of all kinds; None for its template.
    """

    results: Path
    kinds: Mapping[str, Callable[[int], Episode]]
    version: Callable[[str], str]
    extreme: Extreme
    summed_up: Callable[[str, list[Episode]], Figures]
    digest: Callable[[Episode], Digest]
    is_broken: Callable[[Figures], bool]
    is_notable: Callable[[Episode], bool]
    count: int = 10_000
    shares: Mapping[str, float] = field(default_factory=dict)
    written: int = 100
    derived: Callable[[str, Figures], Figures] = lambda _, __: {}
    sentence: Callable[[str, Figures], str] = numbers
    page: Callable[[Mapping[str, Figures]], str] | None = None

    @property
    def records(self) -> Records:
        """What is known of all kinds."""
        return Records(self.results, self.version, self.extreme, self.derived)

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
        end = inf if seconds is None else monotonic() + seconds
        attempt = partial(attempted, self.kinds[kind])
        with ExitStack() as stack:
            ready: Iterator[Episode] = map(attempt, seeds)
            if processes > 1:
                context = multiprocessing.get_context("spawn")
                pool = stack.enter_context(context.Pool(processes))
                ready = pool.imap(attempt, seeds)
            for episode in ready:
                yield episode
                if monotonic() > end:
                    return

    def show(self, kind: str, chosen: argparse.Namespace) -> bool:
        """Run episodes and print them, each in full; whether a promise is broken."""
        seeds = range(chosen.first, chosen.first + chosen.episodes)
        found = list(self.run(kind, seeds, processes=chosen.processes))
        print(json.dumps(jsonable(found), indent=1))
        figures = self.figures_of(kind, found)
        if figures["episodes"] == 0:
            return False
        return self.is_broken(figures | self.derived(kind, figures))

    def again(self, kind: str, chosen: argparse.Namespace) -> bool:
        """Run some of the known episodes again; whether the outcome of any differs.

        Half of them are those with the least distances, which a change of a rule is
        most likely to change; the others are spread over all. Where enough of another
        version were run and all are the same, the whole row counts as one of today's
        version, and names how many were compared.
        """
        records = self.records
        version = records.version_of(kind)
        known = list(records.digests(kind, version).values())
        nearest = sorted(known, key=lambda digest: digest.least or 0.0)
        some = nearest[: chosen.again // 2]
        rest = sorted(nearest[len(some) :], key=lambda digest: digest.seed)
        left = chosen.again - len(some)
        some += rest[:: max(len(rest) // left, 1)][:left]
        seeds = [digest.seed for digest in some]
        found = map(self.digest_of, self.run(kind, seeds, processes=chosen.processes))
        differ = [e.seed for e, k in zip(found, some, strict=True) if e != k]
        print(f"{kind}: {len(some)} episodes again, {len(differ)} differ: {differ}")
        if len(some) >= COMPARED and not differ and version != self.version(kind):
            records.carry(kind, len(some))
            say(f"{kind}: its {len(known)} episodes count for today's kernels")
        return bool(differ)

    def figures_of(self, kind: str, episodes: list[Episode]) -> Figures:
        """Figures of episodes of a kind, and of which, and how many were left out."""
        counted = [e for e in episodes if "left_out" not in e]
        return {
            "episodes": 0,
            **(self.summed_up(kind, counted) if counted else {}),
            "seeds": ranges_of(e["seed"] for e in episodes),
            "left_out": Counter(e["left_out"] for e in episodes if "left_out" in e),
        }

    def digest_of(self, episode: Episode) -> Digest:
        """What came of an episode, or why it was left out."""
        if "left_out" in episode:
            return Digest(episode["seed"], f"left out: {episode['left_out']}")
        full = self.digest(episode)
        counts = {name: count for name, count in full.counts.items() if count}
        least = None if full.least is None else round(full.least, 2)
        return full._replace(counts=counts, least=least)

    def go_on(self, kind: str, chosen: argparse.Namespace, count: int) -> bool:
        """Run what is not known yet of a kind; whether a promise is broken."""
        records = self.records
        todo = list(records.todo(kind, chosen.first, chosen.first + count))
        say(f"{kind}: {len(todo)} of {count} episodes are to be run")
        waiting: list[Episode] = []
        for episode in self.run(
            kind, todo, processes=chosen.processes, seconds=chosen.seconds
        ):
            if "left_out" in episode or self.is_notable(episode):
                print(kind, json.dumps(jsonable(episode)), flush=True)
            waiting.append(episode)
            if len(waiting) >= self.written:
                self.write(kind, waiting, records)
                waiting = []
        if waiting:
            self.write(kind, waiting, records)
        figures = records.kinds.get(kind)
        if figures is None or figures["episodes"] == 0:
            return False
        print(self.sentence(kind, figures))
        return self.is_broken(figures)

    def write(self, kind: str, episodes: list[Episode], records: Records) -> None:
        """Write down what episodes came to."""
        digests = list(map(self.digest_of, episodes))
        found = records.add(kind, self.figures_of(kind, episodes), digests)
        say(f"{kind}: {found['episodes']} episodes are known")

    def main(self, says: str | None) -> int:
        """Do as the command line asks; 1 if a promise is broken.

        Args:
            says: What the command says of itself.
        """
        parser = parser_of(says, self.count)
        parser.add_argument("--kind", choices=tuple(self.kinds), help="all if left out")
        chosen = parser.parse_args()
        count = chosen.episodes
        shares = {kind: self.shares.get(kind, 1.0) for kind in self.kinds}
        every = {kind: ceil(share * count) for kind, share in shares.items()}
        return self.do(chosen, {chosen.kind: count} if chosen.kind else every)

    def do(self, chosen: argparse.Namespace, counts: Mapping[str, int]) -> int:
        """Do as the command line asks of some kinds; 1 if a promise is broken."""
        if chosen.show or chosen.again:
            look = self.show if chosen.show else self.again
            found = [look(kind, chosen) for kind in counts]
            return int(any(found))
        todo = {} if chosen.page else counts
        broken = [self.go_on(kind, chosen, count) for kind, count in todo.items()]
        written = self.page or partial(page, self.results.stem)
        text = written(self.records.kinds)
        self.results.with_suffix(".md").write_text(text, encoding="utf-8")
        say(f"wrote {self.results.name} and its page")
        return int(any(broken))


def command(says: str | None) -> argparse.ArgumentParser:
    """A parser whose help is what a command says of itself, line by line."""
    return argparse.ArgumentParser(
        description=says, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def parser_of(says: str | None, count: int) -> argparse.ArgumentParser:
    """Options of every campaign of episodes.

    Args:
        says: What the command says of itself.
        count: How many episodes of each kind are run if nothing is said.
    """
    parser = command(says)
    parser.add_argument("--episodes", type=int, default=count, help="of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seconds", type=float, help="bound for each kind [s]")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="episodes, no results")
    parser.add_argument(
        "--again",
        type=int,
        default=0,
        help="known, compared: 50 or more carry a row over",
    )
    parser.add_argument("--page", action="store_true", help="from what is known")
    return parser


def attempted(work: Callable[[int], Episode], seed: int) -> Episode:
    """The episode of a seed, or why it is left out."""
    try:
        with patience(PATIENCE):
            return work(seed)
    except (LeftOut, TimeoutError) as reason:
        return {"seed": seed, "left_out": str(reason)}


@contextmanager
def patience(seconds: float) -> Iterator[None]:
    """Raise TimeoutError where what is done takes longer than so many seconds."""

    def end(*_: object) -> None:
        raise TimeoutError(f"it took longer than {seconds:g} s")

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
