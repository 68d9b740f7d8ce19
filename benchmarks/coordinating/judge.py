"""Two arms at a belt with late and early items, beside the guard; Coal judges."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from time import thread_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.maps.online import GAIN, Job, Line, LineCell, LinePlan
from armguard.maps.right_of_way import Order
from armguard.respond.command import Action
from armguard.simulation.plant import Imperfection, Plant
from arrays import Floats
from coordinating.cells import (
    CONVEYOR,
    FLOOR,
    MADE_FOR,
    PERIOD,
    ROBOTS,
    cell,
    plans_of,
)

# Jobs of each arm in an episode.
JOBS = 10

# Items of an arm arrive so long after each other, early or late by this [s].
APART, VARIES = 14.0, 1.5

# The belt: usual speed, greatest deviation, time in which that changes [m/s, -, s].
USUAL, DEVIATES, SWAYS = 0.2, 0.2, 7.0

# How exact the belt is measured: place [m], and speed, as a share.
PLACE_ERROR, SPEED_ERROR = 0.0005, 0.01

# A command leads a joint back to its plan at this rate [1/s].
LEADS_BACK = 4.0

# One state in so many is judged.
JUDGED = 5

# An episode that lasts longer is a deadlock [s].
PATIENCE = 400.0

# Commands that differ by less are the same [rad/s].
SAME = 1e-9

# How far Coal's distances may be off [m].
ACCURACY = 1e-6


class Belt:
    """A belt whose speed changes, and what is measured of it.

    Attributes:
        travel: How far it has moved [m].
        speed: Its speed [m/s].
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.travel, self._rng = 0.0, rng
        self._phases = rng.uniform(0.0, 2.0 * np.pi, 2)
        self.speed = USUAL

    def advance(self, now: float) -> None:
        """Let a cycle pass."""
        turn = 2.0 * np.pi * now / SWAYS
        parts = np.sin(np.array([1.0, 0.37]) * turn + self._phases)
        share = 0.5 * float(parts.sum())
        self.speed = USUAL * (1.0 + DEVIATES * share)
        self.travel += self.speed * PERIOD

    def measured(self) -> tuple[float, float]:
        """Travel [m] and speed [m/s] as measured."""
        place, share = self._rng.uniform(-1.0, 1.0, 2)
        return (
            self.travel + PLACE_ERROR * float(place),
            self.speed * (1.0 + SPEED_ERROR * float(share)),
        )


class Alone(Line):
    """Robots that are not in each other's way, for comparison."""

    def _order(self, first: int) -> Order:
        a, b = (lane.plan for lane in self.lanes)
        k, m = self.cell.crossings[a, b].blocked.shape
        needs = np.zeros(k, dtype=np.intp), np.zeros(m, dtype=np.intp)
        return Order(first, needs, tight=False)


class ByUsualSpeed(Line):
    """Coordination without the error of the belt's speed.

    It takes an arm that follows the belt to be where the usual speed would have it.
    """

    def __init__(self, known: LineCell) -> None:
        self._began: dict[int, float] = {}
        super().__init__(known)

    def seen(self, k: int) -> float:
        """Where the arm would be at the usual speed [s]."""
        lane = self.lanes[k]
        span = self.plans[lane.plan].reserved
        if lane.job is None or span is None or not span[0] < lane.place < span[1]:
            return lane.place
        since = self._now - self._began.setdefault(lane.job.number, self._now)
        return span[0] + since * USUAL / MADE_FOR


@dataclass(slots=True)
class Found:
    """What came of an episode.

    Attributes:
        rows: True states that are judged.
        counts: Counts by name.
        seconds: Time of each decision [s].
    """

    rows: list[Floats] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)

    def count(self, name: str, more: int = 1) -> None:
        """Count something."""
        self.counts[name] = self.counts.get(name, 0) + more


@cache
def guard() -> ag.Guard:
    """The guard of the cell."""
    return ag.Guard(cell().scene, self_test=False)


@cache
def known_cell(seed: int) -> LineCell:
    """What is known of the arms with the plans of a seed."""
    plans = plans_of(seed)
    return LineCell.of(cell().tables, plans, conveyor=CONVEYOR, floor=FLOOR)


def arrivals(
    seed: int, plans: Mapping[str, LinePlan]
) -> list[tuple[float, tuple[str, ...]]]:
    """When items arrive, and the plans that can pick each."""
    rng = np.random.default_rng([seed, 96])
    found = []
    for robot in ROBOTS:
        own = tuple(name for name, one in plans.items() if one.robot == robot)
        times = 1.0 + rng.uniform(0.0, APART) + APART * np.arange(JOBS)
        times += rng.uniform(-VARIES, VARIES, JOBS)
        found += [(float(t), own) for t in times]
    return sorted(found)


def executed(line: Line, seed: int, found: Found, guarded: bool) -> float:
    """Execute an episode; returns the time at which all jobs are done [s]."""
    rng, jobs = np.random.default_rng([seed, 97]), arrivals(seed, line.plans)
    belt, k, now, waiting = Belt(rng), 0, 0.0, True
    plant = Plant(cell().scene, imperfection=Imperfection(seed=seed))
    judge = guard()
    judge.reset()
    while (waiting or not line.idle) and now < PATIENCE:
        belt.advance(now)
        travel, speed = belt.measured()
        while k < len(jobs) and jobs[k][0] <= now:
            line.add(Job(k, jobs[k][1], travel=travel))
            k += 1
        waiting = k < len(jobs)
        start = thread_time()
        line.step(now, travel, speed)
        found.seconds.append(thread_time() - start)
        found.count("both_yield", int(all(lane.yields for lane in line.lanes)))
        found.count("yields", int(any(lane.yields for lane in line.lanes)))
        found.count("decisions")
        if guarded:
            drive(line, plant, judge, now, found)
        now = round(now / PERIOD + 1.0) * PERIOD
    found.count("deadlocks", int(now >= PATIENCE))
    return now


def drive(line: Line, plant: Plant, judge: ag.Guard, now: float, found: Found) -> None:
    """A cycle of the arms, whose commands go through the guard."""
    goal, rate = line.motion()
    q, v = plant.measure()
    wanted = rate + LEADS_BACK * (goal - q)
    wanted[np.abs(wanted) < 1e-3] = 0.0
    command = judge.filter(q, wanted, now, velocity=v, now=now)
    same = np.abs(command.velocity - wanted).max() <= SAME
    if command.action is not Action.FOLLOW or not same:
        found.count("interventions")
    plant.advance(PERIOD, command.velocity, command.actions)
    if found.counts["decisions"] % JUDGED == 0:
        found.rows.append(plant.q)


def contacts(rows: list[Floats]) -> int:
    """States in which links of both arms touch, or one of them touches the belt."""
    one, touching = cell(), 0
    oracle, (left, right, still) = one.oracle, one.sides
    belt = [i for i in still if one.tables.body_names[one.tables.owners[i]] == "belt"]
    hands = [i for i in (*left[-12:], *right[-12:])]
    pairs = [(i, j) for i in left for j in right] + [(i, j) for i in hands for j in belt]
    ends = np.array(pairs).T
    reach = oracle.radii[ends[0]] + oracle.radii[ends[1]]
    for q in rows:
        at = oracle.place(q)
        gaps = np.linalg.norm(at[ends[0]] - at[ends[1]], axis=1) - reach
        near = np.flatnonzero(gaps < ACCURACY)
        touching += any(oracle.distance(*pairs[k]) < -ACCURACY for k in near)
    return touching


def judged(seed: int, kind: str = "") -> dict[str, Any]:
    """An episode of some job pairs, judged.

    Args:
        seed: Its seed.
        kind: "" for coordination as it is; "no hysteresis"; "usual speed" for one
            that takes the belt to move at its usual speed.
    """
    known, found = known_cell(seed), Found()
    if kind == "usual speed":
        line: Line = ByUsualSpeed(known)
    else:
        line = Line(known, gain=0.0 if kind == "no hysteresis" else GAIN)
    time = executed(line, seed, found, guarded=True)
    alone = Alone(known)
    free = executed(alone, seed, Found(), guarded=False)
    picked, could = (2 * JOBS - len(x.missed) for x in (line, alone))
    return {
        "pairs": JOBS,
        "contacts": contacts(found.rows),
        "states": len(found.rows),
        "seconds": time,
        "alone": free,
        "picked": picked,
        "could": could,
        "apart": max(line.finished.values()),
        "worst": float(np.quantile(found.seconds, 0.999)),
        "slow": sum(s > 1e-3 for s in found.seconds),
        "mean": float(np.mean(found.seconds)),
        "interventions": 0,
        "fault": line.fault,
        **found.counts,
    }
