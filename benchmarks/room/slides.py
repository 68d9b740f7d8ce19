"""Arms that are one sliding joint each, guarded in a closed loop at their worst.

Everything the declared figures leave open is against the guard: measurements are as old
as they may be and seem farther and slower, the operator pushes with all he has from the
last measurement on that does not stop him, and stops are as late and soft as declared.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armguard import Guard, Scene
from armguard.geometry import Box, Pose
from armguard.guard import Level, Verdict
from armguard.robot.stopping import StoppingFigures, stopping_figures
from arrays import Floats
from closed_loop.plant import FREE, HELD, Plant, advance, order_stop, plant_at
from rail import carriage

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

# The verdict of a cycle: its time and the stamp of its measurement [s], and measured
# positions and velocities of all slides.
Judge = Callable[[float, float, Floats, Floats], Sequence[Verdict]]


CUBE = Box(half_extents=(HALF, HALF, HALF))

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


def worst_run(
    judge: Judge,
    figures: StoppingFigures,
    starts: Sequence[float],
    speed: float,
    gap_of: Callable[[Floats], float],
) -> Run:
    """The run in which the operator pushes at the last moment.

    Where that is follows from a run in which he does not.

    Args:
        judge: Makes a cycle of the guard, or of each arm's.
        figures: Of every slide.
        starts: Where the slides start, at rest [m].
        speed: Speed the operator wants [m/s].
        gap_of: Distance of what may touch, from the positions [m].
    """
    calm = run(judge, figures, starts, speed, gap_of)
    push_at = (calm.order_cycle - 1) * PERIOD
    return run(judge, figures, starts, speed, gap_of, push_at)


def worst_runs(
    judge: Judge,
    figures: StoppingFigures,
    begin: Sequence[float],
    speed: float,
    phases: int,
    gap_of: Callable[[Floats], float],
) -> Iterator[Run]:
    """The same from starts that are spread over the way of one cycle.

    Args:
        judge: See `worst_run`.
        figures: See there.
        begin: The foremost start of each slide [m].
        speed: See there.
        phases: How many starts.
        gap_of: See there.
    """
    backs = speed * PERIOD * np.arange(phases) / phases
    for back in backs:
        yield worst_run(judge, figures, [x - back for x in begin], speed, gap_of)


def run(
    judge: Judge,
    figures: StoppingFigures,
    starts: Sequence[float],
    speed: float,
    gap_of: Callable[[Floats], float],
    push_at: float | None = None,
) -> Run:
    """One run until all slides are at rest; see `worst_run`.

    Args:
        judge: Makes a cycle of the guard.
        figures: Of every slide; `sensing` is a number of periods.
        starts: Where the slides start, at rest [m].
        speed: Speed the operator wants [m/s].
        gap_of: Distance of what may touch [m].
        push_at: Time from which on he wants top speed [s]; None if he never does, and
            the run ends with the first order.

    Raises:
        RuntimeError: No stop was ordered while the slides moved at their speed.
    """
    plant, count = plant_of(figures, starts), len(starts)
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
            least = min(least, *(gap_of(q) for q in q_rows))
        true_q, true_v = past[k]
        verdicts = judge(
            (k + age) * PERIOD,
            k * PERIOD,
            true_q - figures.position_error,
            true_v - figures.velocity_error * (true_v > 0.0),
        )
        for arm, stops in enumerate(stopped_by(verdicts, count)):
            if stops:
                at = (k + age) * PERIOD + figures.command
                order_stop(plant, arm, at, worst_stop(figures, count))
        if stopped is None and any(v.level >= Level.STOP for v in verdicts):
            stopped = first_stop(verdicts, k)
            if not true_v.max() >= speed - GRAIN:
                raise RuntimeError(f"stopped on its way to {speed} m/s")
        if stopped is not None and (push_at is None or (plant.phase == HELD).all()):
            return replace(stopped, least=least)
    raise RuntimeError(f"no stop, or no rest, within {LONGEST} s")


def first_stop(verdicts: Sequence[Verdict], k: int) -> Run:
    """What came of the first stop, ordered in cycle k."""
    verdict = next(v for v in verdicts if v.level >= Level.STOP)
    near = verdict.nearest
    distance = np.nan if near is None else near.primitive_distance
    return Run(distance, np.nan, verdict, k)


def stopped_by(verdicts: Sequence[Verdict], count: int) -> list[bool]:
    """Which of the slides are to stop, by one guard for all or one for each."""
    if len(verdicts) == count > 1:
        return [v.level >= Level.STOP for v in verdicts]
    levels = list(verdicts[0].levels.values())
    if not levels:
        return [verdicts[0].level >= Level.STOP] * count
    return [level >= Level.STOP for level in levels]


def plant_of(figures: StoppingFigures, starts: Sequence[float]) -> Plant:
    """Slides at rest that are their operators', with the figures as declared."""
    count = len(starts)
    plant = plant_at(
        np.array(starts, dtype=np.float64),
        np.arange(count + 1),
        np.repeat(figures.velocity, count),
        np.repeat(figures.acceleration, count),
        np.repeat(figures.brake_deceleration, count),
    )
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


def terms(verdict: Verdict) -> dict[str, float]:
    """What the nearest pair needs, by cause [m]; empty where buffers are fixed."""
    budget = verdict.budget
    if budget is None:
        return {}
    names = ("floor", "base", "object", "error", "reaction", "stopping", "path")
    return {name: float(getattr(budget, name)) for name in names}
