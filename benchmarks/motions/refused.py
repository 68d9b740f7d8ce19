"""One wrong cycle, and a plant that stops as declared: is it called a liar?

A carriage on a rail runs at a wall: a guard of one joint whose truth is a line.
"""

from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from armguard.geometry import Box, Pose, Sphere
from armguard.guard import Level
from armguard.guard.watch import RUNNING
from armguard.respond import Guard
from armguard.scene import Scene
from closed_loop.plant import stopping_travel
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures, version_of
from robots import carriage

# Radius of the carriage, place of the wall's face, how far the joint goes [m].
RADIUS = 0.05
WALL = 10.0
LIMIT = 40.0

# What every pair keeps [m].
BUFFER = 0.005


@dataclass(frozen=True)
class Corner:
    """Declared figures at a corner of what they may be.

    Attributes:
        period: Time from one cycle to the next [s].
        late: How much later one may come [s].
        figures: Stopping figures.
    """

    period: float
    late: float
    figures: dict[str, float]


def corner_of(rng: np.random.Generator) -> Corner:
    """Some figures: each of them small or large."""

    def either(low: float, high: float) -> float:
        return float(rng.choice([low, high]))

    deceleration = either(2.0, 8.0)
    sensing = either(0.0, 0.003)
    figures = {
        "velocity": 1.5,
        "acceleration": either(2.0, 10.0),
        "deceleration": deceleration,
        "deceleration_most": either(2.0 * deceleration, np.inf),
        "ramp": either(0.0, 0.05),
        "position_error": either(0.0, 2e-4),
        "velocity_error": either(5e-4, 0.02),
        "sensing": sensing,
        "command": either(0.0, 0.01),
        "stale": sensing + 0.02,
    }
    return Corner(either(0.001, 0.004), either(0.0, 0.001), figures)


@cache
def guard_of(number: int) -> tuple[Corner, Guard]:
    """Figures of a number, and a guard of a carriage that has them."""
    corner = corner_of(np.random.default_rng(number))
    scene = Scene(
        period=corner.period, late=corner.late, buffer=BUFFER, margin=0.5, mode="path"
    )
    ball = carriage(Sphere(radius=RADIUS), LIMIT)
    scene.add_robot(ball, name="carriage", stopping=dict(corner.figures))
    wall = Pose(xyz=(WALL + 0.5, 0.0, 0.0))
    scene.add(Box(size=(1.0, 2.0, 2.0)), name="wall", pose=wall)
    return corner, Guard(scene, self_test=False)


class Truth:
    """Where the carriage truly is: it goes evenly until a stop takes effect.

    Args:
        place: Where it is at time 0 [m].
        speed: Its speed [m/s].
        stop: Delay [s], ramp [s] and deceleration [m/s²] of its stop.
    """

    def __init__(
        self, place: float, speed: float, stop: tuple[float, float, float]
    ) -> None:
        self.place, self.speed, self.stop = place, speed, stop
        self.effect = np.inf

    def order(self, now: float) -> None:
        """Have it stop, unless it was to already."""
        self.effect = min(self.effect, now + self.stop[0])

    def at(self, time: float) -> tuple[float, float]:
        """Position [m] and speed [m/s]."""
        if time <= self.effect:
            return self.place + self.speed * time, self.speed
        _, ramp, least = self.stop
        way, speed = stopping_travel(time - self.effect, self.speed, least, ramp)
        return self.place + self.speed * self.effect + way, speed


Given = dict[str, Any]


# Corners of figures that episodes take turns with, and cycles before the wrong one.
CORNERS = 24
CALM = 30

# After its stop a carriage is watched for so long [s].
LINGER = 0.15

nan, inf = np.nan, np.inf


def put(**what: Any) -> Callable[[Given], Given]:
    """Something else is given."""
    return lambda given: {**given, **what}


def moved(name: str, by: float) -> Callable[[Given], Given]:
    """A number is off by so much."""
    return lambda given: {**given, name: given[name] + by}


def scaled(name: str, by: float) -> Callable[[Given], Given]:
    """A list of numbers is so many times as large."""
    return lambda given: {**given, name: [by * x for x in given[name]]}


def shifted(by: float) -> Callable[[Given], Given]:
    """The position is off by so much."""
    return lambda given: {**given, "q": [x + by for x in given["q"]]}


KINDS: dict[str, Callable[[Given], Given]] = {
    "position NaN": put(q=[nan]),
    "position infinite": put(q=[inf]),
    "position minus infinite": put(q=[-inf]),
    "position 1e308": put(q=[1e308]),
    "position 1 m ahead": shifted(1.0),
    "position 1 m back": shifted(-1.0),
    "position 20 mm ahead": shifted(0.02),
    "position 20 mm back": shifted(-0.02),
    "position outside its limits": put(q=[50.0]),
    "position 0": put(q=[0.0]),
    "no position": put(q=[]),
    "a position too many": lambda given: {**given, "q": [*given["q"], 0.0]},
    "position in words": put(q="here"),
    "position missing": put(q=None),
    "velocity NaN": put(velocity=[nan]),
    "velocity infinite": put(velocity=[inf]),
    "velocity 1e308": put(velocity=[1e308]),
    "velocity 9 m/s": put(velocity=[9.0]),
    "velocity 0": put(velocity=[0.0]),
    "velocity of the wrong sign": scaled("velocity", -1.0),
    "velocity half as large": scaled("velocity", 0.5),
    "velocity twice as large": scaled("velocity", 2.0),
    "no velocity": put(velocity=[]),
    "velocity in words": put(velocity="fast"),
    "velocity missing": put(velocity=None),
    "stamp missing": put(stamp=None),
    "stamp NaN": put(stamp=nan),
    "stamp infinite": put(stamp=inf),
    "stamp in words": put(stamp="now"),
    "stamp 5 ms ahead": moved("stamp", 0.005),
    "stamp 1000 s ahead": moved("stamp", 1000.0),
    "stamp 1000 s back": moved("stamp", -1000.0),
    "stamp of an unknown robot": lambda given: {
        **given,
        "stamp": {"carriage": given["stamp"], "lift": given["stamp"]},
    },
    "time infinite": put(now=inf),
    "time in words": put(now="later"),
    "time 10 ms ahead": moved("now", 0.010),
    "time 1000 s ahead": moved("now", 1000.0),
    "time 1000 s back": moved("now", -1000.0),
    "position and stamp NaN": put(q=[nan], stamp=nan),
    "position and time NaN": put(q=[nan], now=nan),
}  # fmt: skip

NAMES = tuple(KINDS)


def episode(seed: int) -> Episode:
    """A carriage that runs at a wall; a cycle on its way or in its stop is wrong."""
    rng = np.random.default_rng(seed)
    kind = NAMES[seed % len(NAMES)]
    corner, guard = guard_of(int(rng.integers(CORNERS)))
    f, period = corner.figures, corner.period
    speed = float(rng.choice([0.05, 0.3, 1.0, 1.5]))
    worst = rng.random() < 0.5
    hardest = min(f["deceleration_most"], 4.0 * f["deceleration"])
    stop = (
        f["command"] * (1.0 if worst else rng.random()),
        f["ramp"] * (1.0 if worst else rng.random()),
        f["deceleration"] if worst else float(rng.uniform(f["deceleration"], hardest)),
    )
    # Half of the faults come while it runs, the others while it stops.
    in_stop = rng.random() < 0.5
    delay = f["command"] + f["ramp"] + speed / f["deceleration"]
    way = speed * (CALM * period + delay) + 0.2
    truth = Truth(WALL - RADIUS - way - rng.uniform(0.0, 0.2), speed, stop)
    says_now = rng.random() < 0.75
    guard.reset()
    guard._watch.phase[:] = RUNNING
    wrong = CALM if not in_stop else None
    now, stamp, ordered, seen = 0.0, -1.0, None, None
    for k in range(20_000):
        now += period + corner.late * rng.random()
        stamp = max(now - f["sensing"] * rng.random(), stamp + 1e-5)
        q, v = truth.at(stamp)
        given: Given = {
            "q": [q + f["position_error"] * rng.choice([-1.0, 1.0])],
            "velocity": [max(v + f["velocity_error"] * rng.uniform(-1.0, 1.0), 0.0)],
            "stamp": 100.0 + stamp,
            "now": 100.0 + now if says_now else None,
        }
        if k == wrong:
            # Where no time is given, none can be wrong.
            able = says_now or "time" not in kind
            given = KINDS[kind](given) if able else put(q=[nan])(given)
        verdict = guard.step(
            given["q"], given["stamp"], velocity=given["velocity"], now=given["now"]
        )
        if k == wrong:
            seen = verdict.reason.name
        if verdict.level >= Level.STOP and ordered is None:
            ordered = now
            truth.order(now)
            if wrong is None:
                wrong = k + 1 + int(rng.integers(max(int(delay / period), 1)))
        if verdict.level >= Level.BRAKE or guard._watch.disproved.any():
            break
        if ordered is not None and now > ordered + delay + LINGER:
            break
    gap = WALL - RADIUS - truth.at(now + 10.0)[0]
    return {
        "seed": seed,
        "kind": kind,
        "seen": seen or "not reached",
        "stopped": int(ordered is not None),
        "disproved": int(bool(guard._watch.disproved.any())),
        "contact": int(gap < 0.0),
        "gap_mm": 1e3 * gap,
    }


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but the least gap are sums."""
    return {
        "episodes": len(episodes),
        **{name: sum(e[name] for e in episodes) for name in COUNTED},
        "least_gap_mm": min(e["gap_mm"] for e in episodes),
        "seen": Counter(e["seen"] for e in episodes),
        "found": [e["seed"] for e in episodes if e["disproved"] or e["contact"]],
    }


COUNTED = ("stopped", "disproved", "contact")


def digest(e: Episode) -> Digest:
    """What came of an episode, in short."""
    found = next((name for name in COUNTED[1:] if e[name]), "")
    return Digest(e["seed"], found, e["gap_mm"])


def refused_figures(count: int, first: int, folder: Path) -> Figures:
    """Figures of episodes with one wrong cycle; each is kept.

    Args:
        count: Episodes.
        first: First seed.
        folder: Where figures are kept, and in `episodes` what came of each.
    """
    campaign = Campaign(
        results=folder / "inputs.json",
        kinds={"refused": episode},
        version=version_of("motions.refused"),
        extreme={"least_gap_mm": min},
        summed_up=summed_up,
        digest=digest,
        is_broken=lambda figures: figures["disproved"] + figures["contact"] > 0,
        is_notable=lambda e: bool(e["disproved"] or e["contact"]),
        written=200,
    )
    chosen = Namespace(first=first, processes=1, seconds=None)
    campaign.go_on("refused", chosen, count)
    return {**campaign.records.kinds["refused"], "kinds_of_fault": len(KINDS)}
