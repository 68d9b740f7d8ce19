"""A plant whose stops get slower in the middle of a run: is it noticed, and when?"""

from itertools import pairwise
from typing import Any

import numpy as np

from armguard.cli.console import say
from arrays import Floats
from closed_loop.answers import BRAKE
from closed_loop.episode import Episode
from closed_loop.plan import Plan, arena_of
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Styles

# What is left of the declared deceleration from the middle of a run on [-].
LEFT = 0.8

# How long a run is, and when its middle is [s].
DURATION = 1.6
MIDDLE = 0.6

# Delays and ramps anywhere inside the declared ones, stops as weak as declared, errors
# of measurements anywhere inside the declared ones.
HONEST = Styles("random", "least", "noise", True)

# Classes of a stop by its fastest joint, in shares of that joint's top speed [-].
CLASSES = (0.0, 0.1, 0.25, 0.5, 1.01)


class Slowed(Episode):
    """An episode in which stops are slower than declared from its middle on.

    Attributes:
        found: For every stop of an arm: when, from which share of the top speed,
            whether slower than declared, when it was escalated, and what was said.
    """

    def __init__(self, seed: int) -> None:
        arena = arena_of(Plan("bay", "path", duration=DURATION), seed)
        super().__init__(arena, seed, duration=DURATION)
        self.truth.styles = HONEST
        self.found: list[dict[str, Any]] = []

    def one_cycle(self, cycle: int, outward: Floats, thinks: bool) -> None:
        """The same, with slower stops after a while, and written down."""
        now = self.tick * SUBSTEP
        self.truth.weak = LEFT if now >= MIDDLE else 1.0
        known = len(self.outcome.stops)
        super().one_cycle(cycle, outward, thinks)
        for stop in self.outcome.stops[known:]:
            self.found.append(
                {
                    "arm": stop.arm,
                    "time": now,
                    "share": stop.speed,
                    "slower": now >= MIDDLE,
                    "escalated": None,
                }
            )
        for arm in self.arena.robots:
            level = self.last.levels[arm]
            own = [stop for stop in self.found if stop["arm"] == arm]
            if level >= BRAKE and own and own[-1]["escalated"] is None:
                why = self.last.why
                joints = [j for j in self.last.disproved if j.startswith(arm)]
                own[-1]["escalated"] = now
                own[-1]["named"] = bool(joints) and "slower than declared" in why
                own[-1]["why"] = why


def slower_figures(count: int, seed: int) -> dict[str, Any]:
    """Figures of runs whose plant gets slower.

    Args:
        count: Runs.
        seed: Of the first.
    """
    stops: list[dict[str, Any]] = []
    runs = 0
    for k in range(count):
        if k % 20 == 0:
            say(f"{k} of {count} runs")
        episode = Slowed(seed + k)
        episode.run()
        profile = episode.arena.setting.profile
        seen: set[str] = set()
        for stop in episode.found:
            # After its first slower stop an arm is not what this asks about.
            if stop["arm"] in seen:
                continue
            if stop["slower"]:
                seen.add(stop["arm"])
            stops.append({**stop, "profile": profile})
        runs += bool(seen)
    honest = [s for s in stops if not s["slower"]]
    slower = [s for s in stops if s["slower"]]
    profiles = sorted({s["profile"] for s in slower})
    return {
        "left": LEFT,
        "runs": count,
        "runs_with_a_slower_stop": runs,
        "honest": summed_up(honest),
        "slower": summed_up(slower),
        "classes": [
            {"from": low, "to": min(high, 1.0), **summed_up(between(slower, low, high))}
            for low, high in pairwise(CLASSES)
        ],
        "profiles": {
            p: summed_up([s for s in slower if s["profile"] == p]) for p in profiles
        },
        "example": next((s["why"] for s in slower if s["escalated"]), ""),
    }


def between(stops: list[dict[str, Any]], low: float, high: float) -> list[Any]:
    """Stops whose fastest joint was in a class."""
    return [s for s in stops if low <= s["share"] < high]


def summed_up(stops: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures of stops."""
    noticed = [s for s in stops if s["escalated"] is not None]
    times = np.array([1e3 * (s["escalated"] - s["time"]) for s in noticed])
    return {
        "stops": len(stops),
        "escalated": len(noticed),
        "named": sum(s["named"] for s in noticed),
        "median_ms": float(np.median(times)) if noticed else None,
        "longest_ms": float(times.max()) if noticed else None,
    }
