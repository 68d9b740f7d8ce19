"""Slides before a wall, and head-on: what a guard keeps, beside the least that does.

Before a wall: the least fixed buffer that does, beside what is kept. The arm's figures
are those of docs/paper.md. Head-on: two arms under one guard, and each under its own.
An own guard takes the other arm for an object: of the other's declared top speed, or,
which is fairer, of the speed it has, for all of the time until this arm rests.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

import paper_buffer as paper
from armguard import Box, Guard, Pose, Scene
from armguard.guard import Verdict
from armguard.guard.objects import SightingError
from armguard.robot.stopping import StoppingFigures, stop_travel
from armguard.scene.settings import Mode
from arrays import Floats
from room.slides import (
    CUBE,
    HALF,
    LEAD,
    PERIOD,
    SLIDE,
    Track,
    cube_at,
    figures_of,
    guarded,
    slide_figures,
)

# Speeds before a wall, and head-on [m/s].
SPEEDS = (6.0 * paper.INCH, 12.0 * paper.INCH, 24.0 * paper.INCH)
SPEEDS_HEAD_ON = (0.1, 0.25, 0.4, 0.6)

# Floors beside the stopping figures [m]: none, and what a scene has by default, which
# is that of arms head-on too.
FLOORS = (0.0, 0.005)
FLOOR = FLOORS[1]

# The wall's face, from where the slide's frame is, and where the bisection begins and
# how fine it is [m].
WALL = 1.5
WIDEST = 0.6
GRAIN = 2e-4

# Starts of a run, before the wall and head-on.
PHASES, PHASES_HEAD_ON = 4, 2

# The paper's latency is 25 ms, split over a few ms of delivery, a cycle, and drives.
SENSING = 0.003
LATENCY = {"sensing": SENSING, "command": paper.LATENCY - SENSING - PERIOD}
ARMS: Mapping[str, Mapping[str, float]] = {
    "short stop, long swing": {
        "velocity": paper.TOP,
        "acceleration": paper.ACCELERATION,
        "deceleration": paper.DECELERATION,
        "ramp": paper.RAMP,
        "settle": paper.SWING,
        "settle_time": paper.SWING_TIME,
        **LATENCY,
    },
    "one deceleration": {
        "velocity": paper.TOP,
        "deceleration": 48.0 * paper.INCH,
        **LATENCY,
    },
}

# Head-on: how far apart the slides' frames are [m]; the first run begins at a gap that
# is not needed: so much at rest [m], and what is driven in so long a time [s].
FARTHEST = 3.0
REST_GAP, GAP_TIME = 0.3, 2.0

# The bay's figures with a metre for a radian; the same without swing; a slow arm.
TOP = 1.25  # [m/s]
BAY: Mapping[str, Any] = {
    "velocity": TOP,
    "acceleration": 8.0,
    "deceleration": 4.0,
    "deceleration_most": 8.0,
    "ramp": 0.020,
    "settle": 0.005,
    "settle_time": 0.2,
    "position_error": 0.0002,
    "velocity_error": 0.02,
    "sensing": 0.003,
    "command": 0.003,
    "stale": 0.010,
}
CALM = {**BAY, "settle": 0.0, "settle_time": 0.0}
SLOW = {"acceleration": 3.0, "deceleration": 1.5, "deceleration_most": 3.0}
ARMS_HEAD_ON: Mapping[str, Mapping[str, Any]] = {
    "the bay's": BAY,
    "the bay's, no swing": CALM,
    "weak, no swing": {**CALM, **SLOW},
}

WAYS = ("one guard", "own guard, actual speed", "own guard, top speed")


def before_wall(figures: StoppingFigures, mode: Mode, buffer: float) -> Track:
    """The slide before the wall, under a guard."""
    scene = Scene(mode=mode, buffer=buffer)
    scene.add_robot(SLIDE, name="arm", stopping=figures)
    wall = Box(size=(2 * HALF, 2.0, 2.0))
    scene.add(wall, name="wall", pose=cube_at(WALL + HALF))
    free = WALL - HALF
    return Track(
        guarded(scene), figures, 1, lambda q: free - float(q[0]), lambda gap: free - gap
    )


def kept_by(figures: StoppingFigures, buffer: float, speed: float) -> bool:
    """Whether nothing is ever touched with a fixed buffer [m]."""
    track = before_wall(figures, "fixed", buffer)
    return all(run.least >= 0.0 for run in track.worst_runs(buffer, speed, PHASES))


def least_fixed(figures: StoppingFigures, speed: float) -> float:
    """Least fixed buffer that is always kept, by bisection [m]."""
    low, high = 0.0, WIDEST
    while high - low > GRAIN:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if kept_by(figures, middle, speed) else (middle, high)
    return high


def ordered_at(
    figures: StoppingFigures, mode: Mode, floor: float, speed: float
) -> dict[str, Any]:
    """Distance at which a mode orders the stop, and what comes of it [m]."""
    track = before_wall(figures, mode, floor)
    first = WIDEST + LEAD + track.speeding_up(speed)
    distance, more = figures_of(track.at_stop(first, speed, PHASES))
    return {"distance": distance, **more}


def measure_walls() -> list[dict[str, Any]]:
    """The least that does and what is kept, for each set of figures and each speed."""
    rows = []
    for name, declared in ARMS.items():
        figures = slide_figures(**declared)
        for speed in SPEEDS:
            stop = stop_travel(figures, 0, speed, period=PERIOD)
            row: dict[str, Any] = {
                "arm": name,
                "tool_speed": speed,
                "least": least_fixed(figures, speed),
                "closed_form": stop.travel + float(figures.position_error[0]),
            }
            for floor in FLOORS:
                key = f"path, floor {1e3 * floor:g} mm"
                row[key] = ordered_at(figures, "path", floor, speed)
            row["speed mode"] = ordered_at(figures, "speed", FLOORS[0], speed)
            rows.append(row)
    return rows


def together(figures: StoppingFigures) -> Track:
    """Two slides head-on under one guard."""
    scene = Scene(mode="path", buffer=FLOOR)
    facing = Pose(xyz=(FARTHEST, 0.0, 0.0), rpy=(0.0, 0.0, np.pi))
    scene.add_robot(SLIDE, name="one", stopping=figures)
    scene.add_robot(SLIDE, name="other", base=facing, stopping=figures)
    free = FARTHEST - 2.0 * HALF
    return Track(
        guarded(scene),
        figures,
        2,
        lambda q: FARTHEST - float(q.sum()) - 2.0 * HALF,
        lambda gap: 0.5 * (free - gap),
    )


def apart(figures: StoppingFigures, speed: float) -> Track:
    """Each slide under its own guard, the other an object of a top speed [m/s]."""
    guards = []
    for _ in range(2):
        scene = Scene(mode="path", buffer=FLOOR)
        scene.add_robot(SLIDE, name="one", stopping=figures)
        scene.add(CUBE, name="other", pose=cube_at(FARTHEST), top_speed=speed)
        guards.append(Guard(scene, self_test=False))

    def judge(now: float, stamp: float, q: Floats, v: Floats) -> Sequence[Verdict]:
        verdicts = []
        for k, guard in enumerate(guards):
            if stamp == 0.0:
                guard.reset()
            # Its operator pushes until the stop takes effect, and it is soon faster
            # than declared: such sightings are refused while the arm stops.
            with suppress(SightingError):
                guard.place("other", cube_at(FARTHEST - q[1 - k]), stamp=stamp)
            own = slice(k, k + 1)
            verdicts.append(guard.step(q[own], stamp, velocity=v[own], now=now))
        return verdicts

    return replace(together(figures), judge=judge)


def measure_head_on() -> list[dict[str, Any]]:
    """Gaps at the stop, for each kind of arm and each speed."""
    rows = []
    for name, declared in ARMS_HEAD_ON.items():
        figures = slide_figures(**declared)
        one, top = together(figures), apart(figures, TOP)
        for speed in SPEEDS_HEAD_ON:
            # Its operator pushes for a period before the stop is ordered.
            fastest = speed + float(figures.acceleration[0]) * PERIOD
            row: dict[str, Any] = {"arm": name, "tool_speed": speed}
            tracks = (one, apart(figures, fastest), top)
            for way, track in zip(WAYS, tracks, strict=True):
                row[way] = gap_at_stop(track, speed)
            rows.append(row)
    return rows


def gap_at_stop(track: Track, speed: float) -> dict[str, Any]:
    """Mean gap at the first stop, least gap of all runs, the need by cause."""
    runs = track.at_stop(REST_GAP + GAP_TIME * speed, speed, PHASES_HEAD_ON)
    gap, more = figures_of(runs)
    touched = sum(r.least < 0.0 for r in runs)
    return {"gap": gap, **more, "contacts": touched, "runs": len(runs)}
