"""A hundred million cycles of one guard: no exception, no growth, the verdicts as new.

make soak                                   100 million cycles of each kind, an hour
make soak ARGS="--kind filter --episodes 3"     three million of one kind
nice -n 19 make soak ARGS="--processes 1"   all in one process each, beside other work

It resumes: an episode is a million cycles, and those that were run with the same
kernels are known from docs/soak.json. A guard lives as long as its process, so that
memory is compared over all the cycles of a process. What comes of an episode depends on
its seed alone: of kind filter it begins at home with the state of a new guard.
"""

import sys
from collections import Counter
from collections.abc import Mapping
from functools import cache, partial
from time import process_time

import numpy as np

from armguard.respond import Action, Guard
from armguard.scene import bay_scene
from episodes.campaign import Campaign, Episode
from episodes.follower import Arms
from episodes.records import Digest, Figures, version_of
from pages import DOCS
from speed.memory import resident_kib
from speed.scenes import sway

# Cycles of an episode, and of those before the first one of a process: from then on the
# growth of memory counts.
CYCLES, WARM = 1_000_000, 50_000

# Time from one cycle to the next [s].
PERIOD = 1e-3

# Rows of the motion that is stepped through, and every how many of them is compared.
ROWS, EVERY = 20_000, 997

# Share of the top speeds an operator desires [-], for how many cycles of one mind, and
# how often a measurement cannot be read.
SPEED, OF_ONE_MIND, UNREADABLE = 0.3, 500, 10_007

# Most that memory may grow by [KiB].
GROWTH = 1024


class Soak:
    """A guard that lives as long as its process.

    Attributes:
        cycles: How many it has had.
        resident: Memory of the process after its first cycles [KiB].
        as_new: What the guard said before the first one.
    """

    def __init__(self, mode: str) -> None:
        self.guard = Guard(bay_scene(mode), self_test=False)
        t = self.guard.tables
        self.rows = sway(t, ROWS, PERIOD)
        self.cycles = 0
        self.resident = 0
        self.as_new = self.verdicts()

    def begin(self, seed: int) -> None:
        """Forget the episodes before, where a cycle depends on earlier ones."""

    def chunk(self, rng: np.random.Generator, count: int) -> Counter[str]:
        """Run cycles; what happened, by name."""
        raise NotImplementedError

    def verdicts(self) -> list[bytes]:
        """What the guard says of some configurations, all of it."""
        raise NotImplementedError

    def episode(self, seed: int) -> Episode:
        """A million cycles more."""
        start = process_time()
        if self.resident == 0:
            self.begin(seed)
            self.chunk(np.random.default_rng([seed, 7]), WARM)
            self.verdicts()
            self.resident = resident_kib()
        self.begin(seed)
        found = self.chunk(np.random.default_rng([seed, 6]), CYCLES)
        self.cycles += CYCLES
        return {
            "seed": seed,
            "counts": dict(found),
            "growth_kib": resident_kib() - self.resident,
            "in_a_row": self.cycles,
            "same": self.verdicts() == self.as_new,
            "worked_s": process_time() - start,
        }


class Stepped(Soak):
    """Joint positions are judged, buffers are fixed."""

    def chunk(self, rng: np.random.Generator, count: int) -> Counter[str]:
        """See `Soak`."""
        found: Counter[str] = Counter()
        step, rows = self.guard.step, self.rows
        for k in range(count):
            row = rows[k % ROWS]
            if k % UNREADABLE == 0:
                row = row + np.nan
            try:
                step(row)
            except Exception as error:  # what is promised is that there is none
                found[f"raised {type(error).__name__}"] += 1
        return found

    def verdicts(self) -> list[bytes]:
        """See `Soak`."""
        return [self.guard.step(row).tobytes() for row in self.rows[::EVERY]]


class Filtered(Soak):
    """An operator of random desires drives both arms, which follow all commands."""

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        # The first cycle allocates what later ones need, so it is part of a checkpoint.
        self.guard.filter(self.guard.home, np.zeros_like(self.guard.home), 0.0, now=0.0)
        self.guard.reset()
        self.new = self.guard.checkpoint()
        self.top = Arms(self.guard.tables).joined("velocity")

    def begin(self, seed: int) -> None:
        """Both arms rest at home, the clock is that of the seed, the guard as new."""
        self.guard.restore(self.new)
        self.q = self.guard.home.copy()
        self.v = np.zeros_like(self.q)
        self.time = PERIOD * CYCLES * seed

    def chunk(self, rng: np.random.Generator, count: int) -> Counter[str]:
        """See `Soak`."""
        found: Counter[str] = Counter()
        guard, desired = self.guard, np.zeros_like(self.q)
        for k in range(count):
            if k % OF_ONE_MIND == 0:
                desired = SPEED * self.top * rng.uniform(-1.0, 1.0, len(self.q))
                guard.engage()
            q = self.q + np.nan if k % UNREADABLE == 0 else self.q
            try:
                command = guard.filter(
                    q, desired, self.time, velocity=self.v, now=self.time
                )
            except Exception as error:  # what is promised is that there is none
                found[f"raised {type(error).__name__}"] += 1
                continue
            if command.action is not Action.FOLLOW:
                found[command.action.name] += 1
            self.v = command.velocity
            self.q = self.q + PERIOD * self.v
            self.time += PERIOD
        return found

    def verdicts(self) -> list[bytes]:
        """See `Soak`."""
        return [self.guard.judge_at_rest(row).tobytes() for row in self.rows[::EVERY]]


KINDS: Mapping[str, tuple[type[Soak], str]] = {
    "step": (Stepped, "fixed"),
    "filter": (Filtered, "path"),
}


@cache
def soak_of(kind: str) -> Soak:
    """The guard of a kind; built once in a process."""
    made, mode = KINDS[kind]
    return made(mode)


def run_episode(kind: str, seed: int) -> Episode:
    """A million cycles more of a kind."""
    return soak_of(kind).episode(seed)


def raised(counts: Mapping[str, int]) -> int:
    """How many exceptions there were."""
    return sum(n for name, n in counts.items() if name.startswith("raised"))


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but extremes are sums."""
    counts: Counter[str] = Counter()
    for episode in episodes:
        counts.update(episode["counts"])
    return {
        "episodes": len(episodes),
        "cycles": CYCLES * len(episodes),
        "most_in_a_row": max(e["in_a_row"] for e in episodes),
        "exceptions": raised(counts),
        "most_growth_kib": max(e["growth_kib"] for e in episodes),
        "not_as_new": sum(not e["same"] for e in episodes),
        "counts": dict(counts),
        "worked_s": sum(e["worked_s"] for e in episodes),
    }


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short: nothing of it is by chance but memory."""
    outcome = "" if episode["same"] else "not as new"
    if raised(episode["counts"]):
        outcome = "raised an exception"
    return Digest(episode["seed"], outcome, None, episode["counts"])


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    found = figures["exceptions"] + figures["not_as_new"]
    return bool(found > 0 or figures["most_growth_kib"] > GROWTH)


CAMPAIGN = Campaign(
    results=DOCS / "soak.json",
    kinds={kind: partial(run_episode, kind) for kind in KINDS},
    version=version_of("soak_campaign"),
    extreme={"most_in_a_row": max, "most_growth_kib": max},
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: not episode["same"] or raised(episode["counts"]) > 0,
    count=100,
    written=1,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
