"""One episode: operator, plant, measurements, guard, orders, judge, cycle by cycle."""

from collections import Counter
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from time import perf_counter
from typing import Any

import numpy as np

from arrays import Bools, Floats
from closed_loop import plant as plants
from closed_loop.answers import BRAKE, STOP
from closed_loop.arena import Arena
from closed_loop.conformance import Stopping, broken, declared_of
from closed_loop.drives import Drives, Stamps
from closed_loop.judge_model import SIGHT
from closed_loop.movers import Movers
from closed_loop.operators import (
    OBEDIENT,
    SPEEDS,
    View,
    drawn_operator,
    within_limits,
)
from closed_loop.search import THOROUGH
from closed_loop.settings import SUBSTEP, Plan
from closed_loop.torque import driven_figures
from closed_loop.truth import Styles, Truth, pick
from closed_loop.watch import Contact, Watch


@dataclass(slots=True)
class Stop:
    """One stop of one arm.

    Attributes:
        arm: Its name.
        time: When it was ordered [s].
        reason: Why, in one word of the guard.
        speed: Largest joint speed at the order, in shares of its declared top [-].
        distance: Least distance of any checked pair at the order [m].
        needless: Whether nothing could have happened without it; None if not asked.
    """

    arm: str
    time: float
    reason: str
    speed: float
    distance: float
    needless: bool | None = None


@dataclass(slots=True)
class Outcome:
    """Figures of an episode.

    Attributes:
        seed: Number of the episode.
        setting: Name of its setting.
        operator: Its operators.
        worst: Whether the plant used every declared figure up.
        duration: How long it was [s].
        contact: The first contact that counts.
        met_at_rest: How often an object met an arm on its way out that would have met
            it at rest as well.
        least: Least distance of a pair of which an arm moved, no more than what the
            judge sees [m].
        floor: Distance the guard is to keep [m].
        braked_before: Whether an arm of the contact was ordered to brake before it.
        brakes: How many arms were ordered to brake.
        broke: The figure the plant broke, None if it kept all that were checked.
        saturated: Share of the time in which a motor gave all its torque [-].
        rest: Least distance of any checked pair at the end [m].
        rest_q: Positions at the end, in the order of q [rad or m].
        stops: All stops.
        releases: How often an arm was given back.
        cycles: Cycles of the guard.
        judged: States judged.
        levels: Cycles at each level, by arm.
        joint_way: Way of all joints under their operator [rad and m].
        joint_wish: The same of what the operator desired [rad and m].
        tool_way: Way of the last bodies under their operator [m].
        stop_jerk: Greatest jerk of commands to an arm that is to stop; 0 where none
            are sent [rad/s³ or m/s³].
        cycle_times: Median, 99th percentile and longest cycle of the guard [s].
        wall: Time the whole episode took to compute [s].
    """

    seed: int
    setting: str
    operator: str
    worst: bool
    duration: float = 0.0
    contact: Contact | None = None
    met_at_rest: int = 0
    least: float = 0.0
    floor: float = 0.0
    braked_before: bool = False
    brakes: int = 0
    broke: str | None = None
    saturated: float = 0.0
    rest: float = 0.0
    rest_q: list[float] = field(default_factory=list)
    stops: list[Stop] = field(default_factory=list)
    releases: int = 0
    cycles: int = 0
    judged: int = 0
    levels: dict[str, dict[str, int]] = field(default_factory=dict)
    joint_way: float = 0.0
    joint_wish: float = 0.0
    tool_way: float = 0.0
    stop_jerk: float = 0.0
    cycle_times: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wall: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers, lists and strings."""
        found = asdict(self)
        if self.contact is not None:
            found["contact"] = self.contact._asdict()
        return found


# An episode goes on this long after a contact, to see how deep it gets, and after the
# last arm came to rest, to see whether one is given back [s].
AFTER_CONTACT = 0.1
AFTER_REST = 0.15

# Longest time between two sightings of an object, and longest until the guard has
# one [s].
SIGHTING = 0.01
SIGHTING_AGE = 0.01

# Terms of which a guard that knows of none would notice errors that jump.
UNNOTICED = ("position_error", "velocity_error")

# Substeps after which operators look at the world again.
THINK = 16

# Substeps between two samples of the tools' ways.
TOOL_STEP = 40


# What an episode is of unless it is said.
PLAN = Plan()


class Episode(Drives):
    """One episode, from a random start to its end.

    Args:
        arena: Where.
        seed: Its number; the same number is the same episode.
        duration: Its longest time [s]; the plan's if None.
        plan: What it is an episode of.
    """

    arena: Arena

    def __init__(
        self,
        arena: Arena,
        seed: int,
        *,
        duration: float | None = None,
        plan: Plan = PLAN,
    ) -> None:
        self.arena, self.plan = arena, plan
        self.rng = rng = np.random.default_rng(seed)
        errors = "quiet" if plan.zero in UNNOTICED else "adverse"
        styles = Styles.worst(errors) if plan.attack else Styles.drawn(rng)
        figures = [*arena.figures.values()]
        self.arms = arena.arms if plan.plant == "torque" else None
        if self.arms is not None:
            figures = [driven_figures(f) for f in figures]
        truth = Truth(
            rng, figures, styles, plan.weak_brake, swings_back=plan.swing == "both"
        )
        self.nearest = SIGHT
        judge = arena.judge
        for name, shift in zip(arena.robots, truth.base_shifts, strict=True):
            judge.displace_base(name, shift)
        outer = np.append(truth.outer, 0.0)[judge.arm_of]
        self.movers = Movers(
            rng,
            {name: T[:3, 3] for name, T in arena.poses.items()},
            arena.room,
            arena.setting.top_speed,
        )
        q = arena.start(rng, outer, self.movers)
        self.stopped: list[Stopping] = []
        if self.arms is not None:
            self.arms.start(q, np.random.default_rng([seed, 1]), full=styles.full)
        own = np.arange(len(q)) < arena.first[1]
        name, self.operator = drawn_operator(rng, judge, arena.movers, own, plan.attack)
        self.speed = 1.0 if plan.attack else pick(rng, SPEEDS)
        self.obedient = not plan.attack and rng.random() < OBEDIENT
        places = dict(zip(self.movers.names, self.movers.p, strict=True))
        self.watch = Watch(judge, arena.first, q, outer, places)
        self.ticks = round((duration or plan.duration) / SUBSTEP)
        self.p_rows = np.tile(self.movers.p, (self.ticks + 1, 1, 1))
        super().__init__(arena, truth, q, self.ticks)
        self.due = [0] * len(self.movers.names)
        self.seen_at = [0] * len(self.movers.names)
        self.shares = np.ones(len(arena.robots))
        self.desired_way = 0.0
        self.asked, self.desired = np.zeros((2, len(q)))
        self.outcome = Outcome(
            seed=seed,
            setting=arena.setting.name,
            operator=f"{name}, speed {self.speed:g}",
            worst=styles == Styles.worst(),
            floor=arena.setting.floor,
        )
        self.driven: set[int] = set()
        self.braked: dict[str, float] = {}
        self.levels: list[Counter[IntEnum]] = [Counter() for _ in arena.robots]
        self.times: list[float] = []
        self.last: Any = None

    def run(self) -> Outcome:
        """Go through all cycles; the figures."""
        begin = perf_counter()
        arena, outcome = self.arena, self.outcome
        arena.guard.reset()
        cycle = rested = 0
        styles = self.truth.styles
        follows = styles.stops == "adverse" or styles.errors in ("adverse", "quiet")
        looked = -THINK
        while True:
            thinks = self.tick - looked >= THINK
            if thinks:
                looked = self.tick
                outward = self.outward() if follows else np.zeros(len(self.q))
                if not follows:
                    # The operator looks at the present state.
                    arena.judge.place(self.q)
            self.one_cycle(cycle, outward, thinks)
            cycle += 1
            if plants.FREE in self.plant.phase.tolist():
                rested = self.tick
            contact = self.watch.contact
            late = self.truth.lateness(cycle, arena.setting.late)
            target = round((cycle * arena.setting.period + late) / SUBSTEP)
            if (
                target > self.ticks
                or (self.tick - rested) * SUBSTEP > AFTER_REST
                or (contact and self.now > contact.time + AFTER_CONTACT)
            ):
                break
            self.move(max(target, self.tick + 1))
        outcome.cycles = cycle
        self.sum_up()
        outcome.wall = perf_counter() - begin
        return outcome

    @property
    def q(self) -> Floats:
        """True positions now, shape (n,) [rad or m]."""
        return self.q_rows[self.tick]

    @property
    def v(self) -> Floats:
        """True velocities now, shape (n,) [rad/s or m/s]."""
        return self.v_rows[self.tick]

    def outward(self) -> Floats:
        """Gradient of the least distance now, zero if nothing is near, shape (n,)."""
        self.watch.see_last(self.tick)
        self.nearest, outward = self.arena.judge.nearest()
        return outward

    def measure(self, cycle: int, outward: Floats) -> tuple[Floats, Floats, Stamps]:
        """What arrives for a cycle: positions, velocities, and the arms' stamps."""
        self.sight(self.now)
        q, v, stamps = self.measured(cycle, outward)
        if self.plan.zero == "sensing":
            stamps = dict.fromkeys(stamps, self.now)
        return q, v, stamps

    def one_cycle(self, cycle: int, outward: Floats, thinks: bool) -> None:
        """Measurements to the guard, its orders to the plant, what the operator asks.

        Args:
            cycle: Its number.
            outward: Gradient of the least distance, shape (n,).
            thinks: Whether the operator looks at the world again.
        """
        arena, plant, now = self.arena, self.plant, self.now
        q, v, stamp = self.measure(cycle, outward)
        verdict = arena.guard.step(q, stamp, velocity=v, now=now)
        self.times.append(verdict.cycle_time)
        for arm, name in enumerate(arena.robots):
            level = verdict.levels[name]
            self.levels[arm][level] += 1
            if level >= STOP:
                if self.stop(arm, name, now, outward, verdict) and self.plan.needless:
                    needless = self.is_needless(q, v, stamp, now)
                    self.outcome.stops[-1].needless = needless
            elif plants.release(plant, arm):
                self.released(arm)
            if level >= BRAKE:
                self.brake(arm, name)
        self.last = verdict
        if self.obedient and verdict.speed_scale is not None:
            self.shares[:] = [verdict.speed_scale[name] for name in arena.robots]
        free = np.repeat(plant.phase == plants.FREE, arena.joint_counts)
        self.ask(thinks, free)

    def ask(self, thinks: bool, free: Bools) -> None:
        """What the operator desires now, within the limits of the joints.

        Args:
            thinks: Whether the operator looks at the world again.
            free: Whether the operator has the arm of each joint, shape (n,).
        """
        arena = self.arena
        if thinks:
            view = View(self.now, arena.judge, self.q, self.v, free)
            self.asked = self.speed * self.operator.desired(view)
        self.desired_way = within_limits(
            self.asked,
            self.shares,
            arena.first,
            self.plant.velocity,
            self.plant.q,
            arena.tables.lower,
            arena.tables.upper,
            self.truth.slowest,
            self.desired,
        )

    def released(self, arm: int) -> None:
        """Count an arm that is given back; at first it is given."""
        self.outcome.releases += arm in self.driven
        self.driven.add(arm)

    def brake(self, arm: int, name: str) -> None:
        """Order the brake of an arm."""
        self.braked.setdefault(name, self.now)
        self.order_brake(arm)

    def stop(
        self, arm: int, name: str, now: float, outward: Floats, verdict: Any
    ) -> bool:
        """Order a stop, and write it down; whether it is a new one."""
        if not self.order_stop(arm, -outward * self.v):
            return False
        own = slice(self.arena.first[arm], self.arena.first[arm + 1])
        share = np.abs(self.v[own]) / self.truth.figures[arm].velocity
        distance = self.arena.judge.distance(self.q)
        reason = verdict.reason.name
        stop = Stop(name, now, reason, float(share.max()), distance)
        self.outcome.stops.append(stop)
        return True

    def is_needless(self, q: Floats, v: Floats, stamp: Stamps, now: float) -> bool:
        """Whether a thorough search finds no future in which a floor is broken.

        What the guard was given is searched, one cycle longer without a stop.
        """
        search = self.arena.reference
        for i, (name, at) in enumerate(
            zip(self.movers.names, self.seen_at, strict=True)
        ):
            pose = self.arena.pose(name, self.p_rows[at, i])
            search.place(name, pose, at * SUBSTEP)
        return search.breach(q, stamp, v, now, THOROUGH) is None

    def move(self, target: int) -> None:
        """Let time pass until the next cycle, and judge it."""
        rows = slice(self.tick + 1, target + 1)
        q_rows, p_rows = self.q_rows[rows], self.p_rows[rows]
        self.drive(target)
        self.outcome.joint_wish += self.desired_way * (target - self.tick) * SUBSTEP
        judge = self.arena.judge
        if self.movers.names:
            self.movers.advance(self.now, SUBSTEP, judge.tips(), p_rows)
        self.watch.look(self.tick, q_rows, p_rows)
        for name, p in zip(self.movers.names, self.movers.p, strict=True):
            judge.stand_at(name, p)
        self.tick = target

    def drive(self, target: int) -> None:
        """Move the arms until the next cycle."""
        self.follow(self.tick, target, self.desired)

    def follow(self, tick: int, target: int, desired: Floats) -> None:
        """Move the arms over some substeps; see `Drives.advance`."""
        plant, before = self.plant, self.plant.began.copy()
        q_rows, v_rows = self.advance(tick, target, desired)
        if self.arms is None:
            return
        for arm in np.flatnonzero(plant.began != before).tolist():
            at = float(plant.began[arm])
            self.stopped.append(Stopping(arm, at, bool(plant.braked[arm])))
        self.arms.follow(q_rows, v_rows)

    def broke(self) -> str | None:
        """The declared figure the arms broke, None if they kept all."""
        rows = slice(self.tick + 1)
        return broken(
            self.q_rows[rows],
            self.v_rows[rows],
            self.free_rows[rows],
            self.arena.first,
            self.stopped,
            declared_of([*self.arena.figures.values()], self.truth),
        )

    def sight(self, now: float) -> None:
        """Place moving objects for the guard where they were a moment ago."""
        for i, name in enumerate(self.movers.names):
            if self.tick < self.due[i]:
                continue
            age = int(self.truth.delay(SIGHTING_AGE) / SUBSTEP)
            # Sightings arrive in their order.
            at = max(self.tick - age, self.seen_at[i], 0)
            pose = self.arena.pose(name, self.p_rows[at, i])
            self.arena.guard.place(name, pose, at * SUBSTEP)
            self.seen_at[i] = at
            wait = int(self.truth.delay(SIGHTING) / SUBSTEP)
            self.due[i] = self.tick + wait

    def sum_up(self) -> None:
        """The figures of the whole episode."""
        outcome, watch, judge = self.outcome, self.watch, self.arena.judge
        outcome.duration = self.now
        watch.judge_meetings(self.p_rows[: self.tick + 1])
        outcome.contact, outcome.met_at_rest = watch.contact, watch.met_at_rest
        outcome.least, outcome.judged = watch.least, watch.judged
        for name, counts in zip(self.arena.robots, self.levels, strict=True):
            outcome.levels[name] = {level.name: n for level, n in counts.items()}
        if watch.contact is not None:
            arms = {watch.contact.a.split("/")[0], watch.contact.b.split("/")[0]}
            times = [self.braked[arm] for arm in arms if arm in self.braked]
            outcome.braked_before = min(times, default=np.inf) < watch.contact.time
        outcome.brakes = len(self.braked)
        if self.arms is not None:
            outcome.broke = self.broke()
            outcome.saturated = self.arms.saturated / max(self.tick, 1)
        outcome.rest = judge.distance(self.q)
        outcome.rest_q = [round(float(x), 6) for x in self.q]
        rows, free = self.q_rows[: self.tick + 1], self.free_rows[: self.tick + 1]
        spread = np.repeat(free[1:], self.arena.joint_counts, axis=1)
        outcome.joint_way = float((np.abs(np.diff(rows, axis=0)) * spread).sum())
        tips = []
        for q in rows[::TOOL_STEP]:
            judge.place(q)
            tips.append(judge.tips())
        if len(tips) > 1:
            ways = np.linalg.norm(np.diff(tips, axis=0), axis=2)
            outcome.tool_way = float((ways * free[::TOOL_STEP][1:]).sum())
        found = np.percentile(self.times, (50, 99, 100))
        outcome.cycle_times = tuple(found.tolist())
