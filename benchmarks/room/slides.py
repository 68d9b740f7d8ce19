"""Arms that are one sliding joint each, guarded in a closed loop at their worst.

Everything the declared figures leave open is against the guard: measurements are as old
as they may be and seem farther and slower, the operator pushes at top speed from the
last measurement on that orders no stop, and stops are as late and soft as declared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armguard import Guard, Scene
from armguard.geometry import Box, Pose
from armguard.guard import Level, Verdict
from armguard.robot.stopping import StoppingFigures, stopping_figures
from arrays import Floats
from closed_loop.plant import FREE, HELD, Plant, advance, order_stop, plant_at
from robots import carriage

# Half the edge of the cube that slides [m], and how far it can [m].
HALF = 0.05
REACH = 4.0

PERIOD = 1e-3  # [s]
SUBSTEP = 2.5e-4  # [s]
SUBSTEPS = round(PERIOD / SUBSTEP)

# Longest run [s], and by how much a speed may miss what is wanted [m/s].
LONGEST = 8.0
GRAIN = 1e-9

# Starts of a run are spread over one cycle's way, so much before the gap at which a
# first one was stopped [m].
LEAD = 0.03

# What a pair needs by cause.
TERMS = ("floor", "base", "object", "error", "reaction", "stopping", "path")

# The verdict of a cycle: its time and the stamp of its measurement [s], and measured
# positions and velocities of all slides.
Judge = Callable[[float, float, Floats, Floats], Sequence[Verdict]]

CUBE = Box(size=(2 * HALF, 2 * HALF, 2 * HALF))

SLIDE = carriage(CUBE, REACH)


def slide_figures(**figures: Any) -> StoppingFigures:
    """Figures of a slide, as `stopping_figures` takes them."""
    return stopping_figures(SLIDE, **figures)


def guarded(scene: Scene) -> Judge:
    """All slides of a scene under one guard."""
    guard = Guard(scene, self_test=False)

    def judge(now: float, stamp: float, q: Floats, v: Floats) -> Sequence[Verdict]:
        if stamp == 0.0:
            guard.reset()
        return [guard.step(q, stamp, velocity=v, now=now)]

    return judge


def cube_at(x: float) -> Pose:
    """Pose of a cube whose middle is at x [m]."""
    return Pose(xyz=(x, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Run:
    """What came of a run.

    Attributes:
        distance: Distance the guard had when it ordered the first stop [m].
        least: Least true distance until all was at rest [m].
        verdict: The verdict that ordered it.
        order_cycle: Its number.
    """

    distance: float
    least: float
    verdict: Verdict
    order_cycle: int


@dataclass(frozen=True)
class Track:
    """Slides that all start at one place, on their way to what they may touch.

    Attributes:
        judge: Makes a cycle of the guard, or of each arm's.
        figures: Of every slide; `sensing` is a number of periods.
        count: How many slides.
        gap_of: Distance of what may touch, from the positions [m].
        start_of: Where all slides start for a gap [m].
    """

    judge: Judge
    figures: StoppingFigures
    count: int
    gap_of: Callable[[Floats], float]
    start_of: Callable[[float], float]

    def at_stop(self, first: float, speed: float, phases: int) -> list[Run]:
        """Worst runs from where a first one, which begins at a gap, is stopped [m]."""
        calm = self.run(self.start_of(first), speed)
        return self.worst_runs(calm.distance, speed, phases)

    def worst_runs(self, gap: float, speed: float, phases: int) -> list[Run]:
        """Worst runs that get their speed before a gap [m].

        Their starts are spread over the way of one cycle.
        """
        gap += LEAD + self.speeding_up(speed)
        backs = speed * PERIOD * np.arange(phases) / phases
        return [self.worst_run(self.start_of(gap) - back, speed) for back in backs]

    def speeding_up(self, speed: float) -> float:
        """What a gap shrinks by until the slides have a speed [m]."""
        return 0.5 * self.count * speed * speed / float(self.figures.acceleration[0])

    def worst_run(self, start: float, speed: float) -> Run:
        """The run in which the operator pushes at the last moment.

        When that is follows from a run without the push.
        """
        calm = self.run(start, speed)
        return self.run(start, speed, (calm.order_cycle - 1) * PERIOD)

    def run(self, start: float, speed: float, push_at: float | None = None) -> Run:
        """One run until all slides are at rest.

        Args:
            start: Where the slides start, at rest [m].
            speed: Speed the operator wants [m/s].
            push_at: Time from which on top speed is desired [s]; None if it never is,
                and the run ends with the first order.

        Raises:
            RuntimeError: No stop was ordered while the slides moved at their speed.
        """
        figures, count = self.figures, self.count
        plant = plant_of(figures, np.full(count, start))
        age = round(figures.sensing / PERIOD)
        q_rows, v_rows = np.zeros((2, SUBSTEPS, count))
        free_rows = np.zeros((SUBSTEPS, count), dtype=np.bool_)
        # States at the beginning of each period; measurements look back into them.
        past = [(plant.q.copy(), plant.v.copy())]
        stopped: Run | None = None
        least = np.inf
        for k in range(round(LONGEST / PERIOD)):
            while len(past) <= k + age:
                began = len(past) - 1
                pushes = push_at is not None and began * PERIOD >= push_at
                desired = np.where(pushes, figures.velocity, speed).repeat(count)
                tick = began * SUBSTEPS
                advance(plant, tick, SUBSTEP, desired, q_rows, v_rows, free_rows)
                past.append((plant.q.copy(), plant.v.copy()))
                least = min(least, *map(self.gap_of, q_rows))
            true_q, true_v = past[k]
            verdicts = self.judge(
                (k + age) * PERIOD,
                k * PERIOD,
                true_q - figures.position_error,
                true_v - figures.velocity_error * (true_v > 0.0),
            )
            for arm in np.flatnonzero(stopped_by(verdicts, count)):
                at = (k + age) * PERIOD + figures.command
                order_stop(plant, int(arm), at, worst_stop(figures, count))
            order = next((v for v in verdicts if v.level >= Level.STOP), None)
            if stopped is None and order is not None:
                near = order.nearest
                distance = np.nan if near is None else near.primitive_distance
                stopped = Run(distance, np.nan, order, k)
                if not true_v.max() >= speed - GRAIN:
                    raise RuntimeError(f"stopped on its way to {speed} m/s")
            if stopped and (push_at is None or (plant.phase == HELD).all()):
                return replace(stopped, least=least)
        raise RuntimeError(f"no stop, or no rest, within {LONGEST} s")


def stopped_by(verdicts: Sequence[Verdict], count: int) -> list[bool]:
    """Which of the slides are to stop, by one guard for all or one for each."""
    if len(verdicts) == count > 1:
        return [v.level >= Level.STOP for v in verdicts]
    levels = list(verdicts[0].levels.values()) or [verdicts[0].level] * count
    return [level >= Level.STOP for level in levels]


def plant_of(figures: StoppingFigures, starts: Floats) -> Plant:
    """Slides at rest that are their operators', with the figures as declared."""
    count = len(starts)
    names = ("velocity", "acceleration", "brake_deceleration")
    own = (np.repeat(getattr(figures, name), count) for name in names)
    plant = plant_at(starts, np.arange(count + 1), *own)
    plant.phase[:] = FREE
    return plant


def worst_stop(
    figures: StoppingFigures, count: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Deceleration, ramp, swing and its time at their worst, each shape (count,)."""
    return (
        np.repeat(figures.deceleration, count),
        np.full(count, figures.ramp),
        np.repeat(figures.settle, count),
        np.full(count, figures.settle_time),
    )


def figures_of(runs: Sequence[Run]) -> tuple[float, dict[str, Any]]:
    """Mean distance at the stop, the least of all runs [m], and the need by cause."""
    budget = runs[0].verdict.budget
    terms = {name: float(getattr(budget, name)) for name in TERMS if budget is not None}
    distance = float(np.mean([r.distance for r in runs]))
    return distance, {"least": min(r.least for r in runs), "terms": terms}
