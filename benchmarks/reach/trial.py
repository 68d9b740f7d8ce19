"""One trial: operator, filter, drives, judge, cycle by cycle; and how smooth it was."""

from collections import Counter
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from armguard.guard import Verdict
from arrays import Bools, Floats
from closed_loop.watch import Watch
from reach.answers import Answering, Orders, Seen
from reach.arena import PERIOD, Arena, Drives
from reach.operators import Operator

# Share of its acceleration a joint must speed up or slow down by to count [-].
COUNTS = 0.02

# What is ordered differs from what is desired by more than this [rad/s or m/s].
DIFFERS = 1e-3


def jerk(v: Floats, dt: float) -> tuple[float, float]:
    """Root mean square and peak of the jerk of some joints [rad/s³].

    Args:
        v: Velocities by cycle, shape (c, k).
        dt: Period [s].
    """
    found = np.diff(v, 2, axis=0) / (dt * dt)
    if found.size == 0:
        return 0.0, 0.0
    return float(np.sqrt((found * found).mean())), float(np.abs(found).max())


def held_back(ordered: Floats, asked: Floats) -> Bools:
    """Cycles in which something else is ordered than what is desired, shape (c,)."""
    found: Bools = (np.abs(ordered - asked) > DIFFERS).any(axis=1)
    return found


def chatter(ordered: Floats, acceleration: Floats, dt: float, where: Bools) -> float:
    """How often a joint's acceleration changes its sign where it is held back [1/s].

    Of the joint that does so most.

    Args:
        ordered: Velocities ordered, by cycle, shape (c, k).
        acceleration: Greatest accelerations, shape (k,).
        dt: Period [s].
        where: Cycles that count, shape (c,).
    """
    time = dt * float(where[1:].sum())
    if time < 50 * dt:
        return 0.0
    a = np.diff(ordered, axis=0) / dt
    most = 0
    for k in range(ordered.shape[1]):
        there = where[1:] & (np.abs(a[:, k]) > COUNTS * acceleration[k])
        signs = np.sign(a[there, k])
        most = max(most, int((signs[1:] != signs[:-1]).sum()))
    return most / time


def share_blocked(ordered: Floats, asked: Floats) -> float:
    """Share of the time in which less than a tenth of what is asked is ordered [-]."""
    size = (asked * asked).sum(axis=1)
    wants = size > 1e-8
    along = (ordered * asked).sum(axis=1)
    return float((along[wants] < 0.1 * size[wants]).mean()) if wants.any() else 0.0


# A trial ends this long after the goal was reached, or a contact [s].
AFTER = 0.3
AFTER_CONTACT = 0.1

# It counts as stuck when what is left has not shrunk by a hundredth in this time [s].
PATIENCE = 1.5
PROGRESS = 0.01

# Longest time of a trial: so many times what an unobstructed robot needs, and more [s].
TIMES = 4.0
MORE = 4.0

# How long an operator lets go after a stop [s], and how often motion begins again.
PAUSE = 0.3
STOPS = 3


@dataclass(kw_only=True)
class Outcome:
    """Figures of a trial.

    Attributes:
        end: "reached", "stuck", "stopped" (too often), "late", "contact".
        reached: Time at which the goal was reached [s], None if it was not.
        stuck: Time at which it last came nearer [s].
        left: What was left in the end, in units of what counts as there [-].
        stops: Stops: time, robot, reason, and the nearest pair in words.
        contact: What touched what, when and how deep; None if nothing did.
        least: Least distance by MuJoCo, at most what it sees [m].
        nominal: Time an unobstructed robot needs [s].
        time: Length of the trial [s].
        jerk_told: Root mean square and peak of the commanded jerk [rad/s³].
        jerk_true: The same of the true velocities.
        chatter: Changes of sign of the acceleration while held back [1/s].
        held_back: Share of the time something else is ordered than is desired [-].
        blocked: Share of the time in which less than a tenth of it is ordered [-].
        why_blocked: Cycles by what the guard says of each robot.
        unsolved: Cycles in which no solution was found.
        last: What was in the way at the end.
        call: Median, 99.9th percentile and greatest of the time of a call [s].
        wall: Time the trial took [s].
    """

    end: str = "late"
    reached: float | None = None
    stuck: float = 0.0
    left: float = np.inf
    stops: list[dict[str, Any]] = field(default_factory=list)
    contact: dict[str, Any] | None = None
    least: float = np.inf
    nominal: float = 0.0
    time: float = 0.0
    jerk_told: tuple[float, float] = (0.0, 0.0)
    jerk_true: tuple[float, float] = (0.0, 0.0)
    chatter: float = 0.0
    held_back: float = 0.0
    blocked: float = 0.0
    why_blocked: dict[str, int] = field(default_factory=dict)
    unsolved: int = 0
    last: dict[str, Any] = field(default_factory=dict)
    call: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wall: float = 0.0


class Trial:
    """One trial, from a start at rest to its end.

    Attributes:
        ordered: Velocities ordered, by cycle, shape (c, n).
        asked: Desired velocities, the same.
        drives: The robots.

    Args:
        arena: Where.
        seed: Draws the true figures of the robots.
        start: Where the robots are at first, shape (n,).
        operator: The operator.
        answers: The guard or peer.
        longest: Longest time [s]; if None, by how long an unobstructed robot needs.
        patient: Whether the operator goes on where the goal comes no nearer.
    """

    def __init__(
        self,
        arena: Arena,
        seed: int,
        start: Floats,
        operator: Operator,
        answers: Answering,
        *,
        longest: float | None = None,
        patient: bool = False,
    ) -> None:
        self._arena = arena
        self._operator = operator
        self._answers = answers
        self._patient = patient
        longest = TIMES * operator.nominal + MORE if longest is None else longest
        self._cycles = round(longest / PERIOD)
        rng = np.random.default_rng([seed, 7])
        self.drives = Drives(arena, rng, start, self._cycles)
        judge, truth = arena.judge, self.drives.truth
        for name, shift in zip(arena.robots, truth.base_shifts, strict=True):
            judge.displace_base(name, shift)
        outer = np.append(truth.outer, 0.0)[judge.arm_of]
        self._watch = Watch(judge, arena.first, start, outer, {})
        self._still = np.zeros((self.drives.q_rows.shape[0], 0, 3))
        self.ordered = np.zeros((self._cycles, len(start)))
        self.asked = np.zeros_like(self.ordered)
        self._calls: list[float] = []
        self._why: Counter[str] = Counter()
        self._pause_until = 0.0
        self._best, self._best_at = np.inf, 0.0
        self.outcome = Outcome(nominal=operator.nominal)

    def run(self) -> Outcome:
        """Go through all cycles; the figures."""
        begin = perf_counter()
        self._answers.reset()
        self._answers.aim(self._operator)
        cycle, orders = 0, None
        while cycle < self._cycles:
            orders = self._cycle(cycle)
            cycle += 1
            rows = self.drives.move()
            self._watch.look(
                rows.start - 1, self.drives.q_rows[rows], self._still[rows]
            )
            if self._is_over():
                break
        self._sum_up(cycle, orders)
        self.outcome.wall = perf_counter() - begin
        return self.outcome

    def _cycle(self, cycle: int) -> Orders:
        """Measurements and desires to the filter, its orders to the robots."""
        drives, outcome = self.drives, self.outcome
        now = drives.now
        seen = Seen(*drives.measure(), now)
        if now < self._pause_until:
            self._operator.let_go()
        asked = self._operator.ask(drives.plant.q, PERIOD)
        if now < self._pause_until:
            asked.joints[:] = 0.0
            if asked.twists is not None:
                asked.twists = {name: np.zeros(6) for name in asked.twists}
        start = perf_counter()
        orders = self._answers.answer(seen, asked)
        self._calls.append(perf_counter() - start)
        self.ordered[cycle], self.asked[cycle] = orders.velocity, asked.joints
        for name in drives.obey(orders.velocity, dict(orders.actions)):
            outcome.stops.append(
                {"time": now, "robot": name, "why": orders.why, **in_words(orders.near)}
            )
            self._pause_until = np.inf
        if self._pause_until == np.inf and max(orders.actions.values()) == 0:
            self._pause_until = now + PAUSE
        for name, why in orders.blocked.items():
            if why != "NOT":
                self._why[f"{name}: {why}"] += 1
        outcome.unsolved += orders.why in ("NO_SOLUTION", "NO_WAY")
        return orders

    def _is_over(self) -> bool:
        """Whether the trial ends after this cycle."""
        outcome, now = self.outcome, self.drives.now
        contact = self._watch.contact
        if contact is not None and now > contact.time + AFTER_CONTACT:
            outcome.end = "contact"
            return True
        left = self._operator.left(self.drives.plant.q)
        outcome.left = left
        if outcome.reached is None and left <= 1.0:
            outcome.reached, outcome.end = now, "reached"
        if outcome.reached is not None:
            return now > outcome.reached + AFTER
        if left < (1.0 - PROGRESS) * self._best or left == np.inf:
            self._best, self._best_at = left, now
        if len(outcome.stops) > STOPS:
            outcome.end = "stopped"
            return not self._patient
        if now > self._best_at + PATIENCE + PAUSE * len(outcome.stops):
            outcome.end = "stuck"
            return True
        return False

    def _sum_up(self, cycles: int, orders: Orders | None) -> None:
        """The figures of the whole trial."""
        outcome, drives = self.outcome, self.drives
        arena = self._arena
        used = np.flatnonzero(arena.driven)
        self.ordered, self.asked = self.ordered[:cycles], self.asked[:cycles]
        v_true = drives.v_rows[: drives.tick + 1 : round(PERIOD / 0.00025)]
        outcome.time = drives.now
        outcome.stuck = self._best_at
        outcome.least = float(self._watch.least)
        contact = self._watch.contact
        if contact is not None:
            outcome.contact = contact._asdict()
            outcome.end = "contact"
        outcome.jerk_told = jerk(self.ordered[:, used], PERIOD)
        outcome.jerk_true = jerk(v_true[:, used], PERIOD)
        # Beyond the top speeds of the robots only the direction counts.
        excess = np.abs(self.asked) / arena.velocity
        self.asked /= np.maximum(excess.max(axis=1, keepdims=True), 1.0)
        where = held_back(self.ordered[:, used], self.asked[:, used])
        outcome.held_back = float(where.mean())
        outcome.chatter = chatter(
            self.ordered[:, used], arena.acceleration[used], PERIOD, where
        )
        outcome.blocked = share_blocked(self.ordered[:, used], self.asked[:, used])
        outcome.why_blocked = dict(self._why)
        if orders is not None:
            outcome.last = {
                "why": orders.why,
                "asked": self.asked[-1].round(4).tolist(),
                "ordered": self.ordered[-1].round(4).tolist(),
                **in_words(orders.near),
            }
        median, rare, most = np.percentile(self._calls, (50, 99.9, 100)).tolist()
        outcome.call = (median, rare, most)


def in_words(verdict: Verdict | None, count: int = 4) -> dict[str, Any]:
    """The pairs with the least left, and what a cycle says."""
    if verdict is None:
        return {}
    pairs = sorted(verdict.near, key=lambda p: p.headroom)[:count]
    return {
        "says": verdict.why,
        "pairs": [
            f"{p.primitive_a} {p.primitive_b}: {1e3 * p.distance:.1f} mm apart, "
            f"{1e3 * p.headroom:.1f} mm left"
            for p in pairs
        ],
    }
