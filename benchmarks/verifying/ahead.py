"""Announced plans of both arms of the bay, against the first time that Coal finds."""

from dataclasses import replace
from functools import cache
from math import floor, inf
from typing import Any

import numpy as np

import armguard as ag
from armguard.guard import Level
from armguard.guard.ahead import Ahead, AheadReason
from armguard.plans.coal_world import CoalWorld, checked_pairs
from armguard.prove.tube import Tube
from armguard.scene import Scene, Trajectory
from arrays import Floats
from episodes.records import Figures
from verifying.oracle import positions

# Time from one row of a plan to the next [s].
STEP = 1.5

# Joints of the rows vary so far about home, those of a row that is too near so far, and
# all keep so far from their limits [rad].
VARIES, REACHES, INSIDE = 0.4, 1.0, 0.05

# Speeds of joints in the rows between are up to this [rad/s]; states among which one is
# sought that is too near.
SPEED, STATES = 0.2, 4000

# Time from one sample of Coal's to the next, and to this it is refined [s].
SAMPLE, REFINED = 2e-4, 1e-6

# Time of the guard's clock at which a plan begins [s].
START = 100.0

# How far joints may be off their curves [rad], and Coal's distances be off [m].
FOLLOWING, ACCURACY = 1e-9, 1e-6

# Counts that break a promise, and figures of which the greatest counts.
LEADS = ("too_long", "too_short", "late")
MOST_AHEAD = ("lead_error", "known_after", "lacks")


@cache
def scene() -> Scene:
    """The bay, with positions that are measured without an error.

    So the time at which a lead ends is known to Coal, and not a bound of it alone.
    """
    found = ag.bay_scene("path")
    for name, robot in found.robots.items():
        assert robot.stopping is not None
        exact = 0.0 * robot.stopping.position_error
        figures = replace(robot.stopping, position_error=exact)
        found.set_stopping(name, figures)
    return found


@cache
def guard() -> ag.Guard:
    """Its guard."""
    return ag.Guard(scene(), self_test=False)


class Oracle:
    """The first time at which a pair is below its buffer, by samples of Coal.

    A sample of a pair is left out where the pair cannot be below its buffer: neither
    side moves farther than the joints' speeds and their levers allow.
    """

    def __init__(self) -> None:
        t = guard().tables
        self.coal, self.pairs = CoalWorld(t), checked_pairs(t)
        first, second = t.groups[self.pairs].T
        self.buffers: Floats = t.buffers[first, second]
        self.levers: Floats = self.coal.levers[self.pairs].sum(axis=1)
        self.names = np.array(t.body_names)[self.pairs]

    def spare(self, k: int) -> float:
        """Distance of a pair beyond its buffer where the shapes were moved to [m]."""
        i, j = self.pairs[k].tolist()
        return float(self.coal.distance(i, j) - self.buffers[k])

    def first_below(self, tube: Tube) -> float:
        """The first time at which a pair is below its buffer; infinite if none is."""
        count = floor(tube.times[-1] / SAMPLE) + 1
        rows = positions(tube, SAMPLE * np.arange(count))
        carried = SAMPLE * self.levers @ tube.top_speeds().max(axis=0)
        due = np.zeros(len(self.pairs), dtype=np.int64)
        while (at := int(due.min())) < count:
            self.coal.move(rows[at])
            own = np.flatnonzero(due == at)
            spares = np.array([self.spare(k) for k in own])
            below = own[spares < 0.0]
            if len(below):
                before = SAMPLE * max(at - 1, 0)
                return min(self.refined(tube, k, before, SAMPLE * at) for k in below)
            due[own] += np.maximum(spares / carried[own], 1.0).astype(np.int64)
        return inf

    def refined(self, tube: Tube, k: int, before: float, after: float) -> float:
        """Time at which a pair comes below its buffer, between two samples [s]."""
        while after - before > REFINED:
            middle = 0.5 * (before + after)
            self.coal.move(positions(tube, np.array([middle]))[0])
            below = self.spare(k) < 0.0
            before, after = (before, middle) if below else (middle, after)
        return after

    def is_near(self, tube: Tube, ahead: Ahead, time: float, span: float) -> bool:
        """Whether a named pair is at its buffer soon after a time, between samples."""
        pair = {ahead.a, ahead.b}
        own = [k for k, names in enumerate(self.names) if set(names) == pair]
        for q in positions(tube, np.linspace(time, time + span, 200)):
            self.coal.move(q)
            if min(map(self.spare, own)) < ACCURACY:
                return True
        return False


@cache
def oracle() -> Oracle:
    """The oracle of the bay."""
    return Oracle()


@cache
def checker() -> ag.Checker:
    """Its checker, which chooses where plans lead."""
    return ag.Checker(scene())


def too_near(rng: np.random.Generator, *, arms: bool) -> Floats:
    """A state in which an arm is too near the other one, or else anything [rad]."""
    t, home = checker().tables, scene().home
    rows = home + rng.uniform(-REACHES, REACHES, (STATES, len(home)))
    rows = np.clip(rows, t.lower + INSIDE, t.upper - INSIDE)
    found = checker().distances(rows)
    group, moving = t.groups, t.moving_count
    near = found.distance < t.buffers[group[found.a], group[found.b]]
    both = near & (found.b < moving)
    robots = t.robot_of_primitive
    both[both] = robots[found.a[both]] != robots[found.b[both]]
    return np.asarray(rows[both if arms and both.any() else near][0])


def plan_of(seed: int) -> ag.Plan:
    """Cubics of both arms, from home to where a pair is too near, and on."""
    one, rng = scene(), np.random.default_rng([seed, 78])
    t, home = checker().tables, one.home
    rows = home + rng.uniform(-VARIES, VARIES, (4, len(home)))
    rows = np.clip(rows, t.lower + INSIDE, t.upper - INSIDE)
    speeds = rng.uniform(-SPEED, SPEED, rows.shape)
    rows[0], speeds[[0, -1]] = home, 0.0
    rows[2] = too_near(rng, arms=seed % 2 == 0)
    times = STEP * np.arange(len(rows))
    names = one.q_names
    motion = Trajectory(names, rows, times, f"plan {seed}", velocities=speeds)
    return ag.Plan.of(motion, one)


def watched(tube: Tube) -> tuple[list[Ahead], bool]:
    """Answers of each cycle until the guard stops an arm, and whether it did so."""
    period, found = guard().tables.period, list[Ahead]()
    times = period * np.arange(floor(tube.times[-1] / period) + 1)
    rates = tube.velocities(times)
    for t, q, v in zip(times.tolist(), positions(tube, times), rates, strict=True):
        verdict = guard().step(q, START + t, velocity=v, now=START + t)
        if verdict.level >= Level.STOP:
            return found, True
        found.append(verdict.ahead)
    return found, False


def announced(seed: int) -> dict[str, Any]:
    """A plan that is executed until the guard stops it, and its leads beside Coal's."""
    plan = plan_of(seed)
    guard().reset()
    guard().announce(plan, START, following_error=FOLLOWING)
    every, stopped = watched(plan.tube)
    first, period = oracle().first_below(plan.tube), guard().tables.period
    too_long, too_short, error = 0, 0, 0.0
    near = dict[int, bool]()
    for k, ahead in enumerate(every):
        left = first - period * k
        too_long += ahead.lead > left + REFINED + SAMPLE * (left == inf)
        if ahead.reason is not AheadReason.NEAR:
            continue
        short = left - ahead.lead
        if short <= period:
            error = max(error, abs(short))
            continue
        end = period * k + ahead.lead
        at = round(end / REFINED)
        if at not in near:
            near[at] = oracle().is_near(plan.tube, ahead, end, period)
        too_short += not near[at]
    return {
        "cycles": len(every),
        "near": int(first < inf),
        "stopped": int(stopped),
        "too_long": too_long,
        "too_short": too_short,
        "lead_error": error,
        **first_reports(every),
    }


def first_reports(every: list[Ahead]) -> dict[str, Any]:
    """When a run learnt of its end, and how long its lead was when it lacked first."""
    known = [one.reason in (AheadReason.NEAR, AheadReason.PROVEN) for one in every]
    lacks = [k for k, one in enumerate(every) if not one.enough]
    at = known.index(True) if any(known) else len(every)
    first = every[lacks[0]] if lacks else None
    return {
        "known_after": at,
        "late": int(bool(lacks) and lacks[0] <= at),
        "not_enough": len(lacks[:1]),
        "lacks": first.needed - first.lead if first and first.needed < inf else 0.0,
    }


def summed_leads(episodes: list[Figures]) -> Figures:
    """Figures of some plans: sums, and the greatest of some."""
    keys = [key for key in episodes[0] if key != "seed"]
    every = {key: [one[key] for one in episodes] for key in keys}
    greatest = {key: max(every[key]) for key in MOST_AHEAD}
    sums = {key: sum(values) for key, values in every.items()}
    return {"episodes": len(episodes), **sums, **greatest}
