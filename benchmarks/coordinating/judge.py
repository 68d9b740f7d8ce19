"""Arms at a belt with late and early items, beside the guard; Coal judges."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import combinations
from time import thread_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.maps.lane import Lanes
from armguard.maps.line_cell import Job, LineCell, LinePlan
from armguard.maps.online import GAIN, Line
from armguard.maps.right_of_way import Order, RightOfWay
from armguard.respond.command import Action
from armguard.simulation.plant import Imperfection, Plant
from arrays import Floats
from coordinating.cells import (
    CONVEYOR,
    FLOOR,
    MADE_FOR,
    PERIOD,
    Cell,
    bundled_plans,
    opposite,
    plans_of,
    side_by_side,
    three_arms,
    three_plans,
)

# Pairs of jobs in an episode.
JOBS = 15

# Items are early or late by this [s].
VARIES = 1.5

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

# A decision that takes longer is slow, processor time [s].
SLOW = 1e-3

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

    def _order(self, *_: Any) -> Order:
        return Order(((), ()), tight=False)


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


class ByPairs(Line):
    """Coordination that looks at every two robots by themselves.

    What two of them need may close a circle with what they need of a third one.
    """

    def __init__(self, known: LineCell) -> None:
        super().__init__(known)
        self._lanes = PairLanes(known, self.lanes)


class PairLanes(Lanes):
    """Robots of which every two are looked at by themselves."""

    def cost(self, right: RightOfWay) -> float:
        """See `Lanes.cost`."""
        return sum(super(PairLanes, self).cost(one) for one in self._pairs(right))

    def in_time(self, right: RightOfWay) -> bool:
        """See `Lanes.in_time`."""
        return all(super(PairLanes, self).in_time(one) for one in self._pairs(right))

    def _pairs(self, right: RightOfWay) -> list[RightOfWay]:
        """The right of way of every two."""
        count = len(self._each)
        return [RightOfWay({pair: one}, count) for pair, one in right.orders.items()]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of episodes.

    Attributes:
        every: Time from one item to the next [s].
        arms: Where arms are: "opposite", with plans of the seed; "side by side", the
            bundled cell; "three".
        left_out: "" for coordination as it is; "hysteresis"; "speed error" where an arm
            that follows the belt is taken to be where the usual speed has it; "circles"
            where every two robots are looked at by themselves.
        alternatives: Alternatives of each plan of the bundled cell.
    """

    every: float
    arms: str = "opposite"
    left_out: str = ""
    alternatives: int = 0

    @property
    def cell(self) -> Cell:
        """Its cell."""
        cells = {"side by side": side_by_side, "three": three_arms}
        return cells.get(self.arms, opposite)()

    def known(self, seed: int) -> LineCell:
        """What is known of its arms with the plans of a seed."""
        if self.arms == "three":
            return three_cell()
        if self.arms == "side by side":
            return bundled_cell(self.alternatives)
        return known_cell(seed)

    def line(self, known: LineCell) -> Line:
        """The coordination."""
        if self.left_out == "speed error":
            return ByUsualSpeed(known)
        if self.left_out == "circles":
            return ByPairs(known)
        return Line(known, gain=0.0 if self.left_out == "hysteresis" else GAIN)


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
def guard(arms: str) -> ag.Guard:
    """The guard of a cell, see `Kind.arms`."""
    return ag.Guard(Kind(0.0, arms).cell.scene, self_test=False)


@cache
def known_cell(seed: int) -> LineCell:
    """What is known of the arms with the plans of a seed."""
    plans = plans_of(seed)
    return LineCell.of(opposite().tables, plans, conveyor=CONVEYOR, floor=FLOOR)


@cache
def bundled_cell(alternatives: int) -> LineCell:
    """What is known of the bundled cell, whose plans have alternatives."""
    plans, tables = bundled_plans(alternatives), side_by_side().tables
    return LineCell.of(tables, plans, conveyor=CONVEYOR, floor=FLOOR)


@cache
def three_cell() -> LineCell:
    """What is known of three arms."""
    plans, tables = three_plans(), three_arms().tables
    return LineCell.of(tables, plans, conveyor=CONVEYOR, floor=FLOOR)


def arrivals(
    seed: int, plans: Mapping[str, LinePlan], every: float
) -> list[tuple[float, tuple[str, ...]]]:
    """When jobs arrive, and the plans of each; one in three is without an item."""
    rng, count = np.random.default_rng([seed, 96]), 2 * JOBS * 2 // 3
    given = {name: one for name, one in plans.items() if not one.instead_of}
    picks = tuple(name for name, one in given.items() if one.track)
    others = tuple(name for name, one in given.items() if not one.track)
    times = 2.0 + every * np.arange(count) + rng.uniform(-VARIES, VARIES, count)
    found = [(float(t), picks) for t in times]
    more = rng.uniform(0.0, every * count, 2 * JOBS - count)
    return sorted([*found, *((float(t), others) for t in more)])


def executed(
    line: Line, seed: int, kind: Kind, found: Found, *, guarded: bool
) -> float:
    """Execute an episode; returns the time at which all jobs are done [s]."""
    rng = np.random.default_rng([seed, 97])
    jobs = arrivals(seed, line.plans, kind.every)
    belt, k, now, waiting = Belt(rng), 0, 0.0, True
    judge = guard(kind.arms)
    plant = Plant(kind.cell.scene, imperfection=Imperfection(seed=seed))
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
        yields = {(lane.robot, lane.yields_to) for lane in line.lanes if lane.yields_to}
        both = any((other, robot) in yields for robot, other in yields)
        found.count("both_yield", int(both))
        found.count("yields", int(bool(yields)))
        begun = [e for e in line.events if "begins job" in e]
        found.count("aside", sum("alternative" in e for e in begun))
        line.events.clear()
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


def contacts(rows: list[Floats], one: Cell) -> int:
    """States in which links of two arms touch, or one touches belt or tray."""
    touching, oracle, arms = 0, one.oracle, one.sides.values()
    pairs = [(i, j) for a, b in combinations(arms, 2) for i in a for j in b]
    pairs += [(i, j) for arm in arms for i in arm[3:] for j in one.still]
    ends = np.array(pairs).T
    reach = oracle.radii[ends[0]] + oracle.radii[ends[1]]
    for q in rows:
        at = oracle.place(q)
        gaps = np.linalg.norm(at[ends[0]] - at[ends[1]], axis=1) - reach
        near = np.flatnonzero(gaps < ACCURACY)
        touching += any(oracle.distance(*pairs[k]) < -ACCURACY for k in near)
    return touching


def judged(seed: int, kind: Kind) -> dict[str, Any]:
    """An episode of some job pairs, judged."""
    found, known = Found(), kind.known(seed)
    line, alone = kind.line(known), Alone(known)
    time = executed(line, seed, kind, found, guarded=True)
    free = executed(alone, seed, kind, Found(), guarded=False)
    picked, could = (2 * JOBS - len(x.missed) for x in (line, alone))
    return {
        "pairs": JOBS,
        "contacts": contacts(found.rows, kind.cell),
        "states": len(found.rows),
        "seconds": time,
        "alone": free,
        "picked": picked,
        "could": could,
        "apart": max(line.finished.values(), default=0.0),
        "p999": float(np.quantile(found.seconds, 0.999)),
        "slow": sum(one > SLOW for one in found.seconds),
        "interventions": 0,
        "faults": int(bool(line.fault)),
        **found.counts,
    }
