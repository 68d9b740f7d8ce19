"""The paper's arm at a wall: the least fixed buffer that does, beside what is kept.

The arm is one joint that slides; its figures are those of docs/paper.md.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

import paper_buffer as paper
from armguard import Box, Scene
from armguard.robot.stopping import StoppingFigures, stop_travel
from armguard.scene.settings import Mode
from arrays import Floats
from room.slides import (
    HALF,
    LEAD,
    PERIOD,
    SLIDE,
    Judge,
    cube_at,
    guarded,
    run,
    slide_figures,
    terms,
    worst_runs,
)

SPEEDS = (6.0 * paper.INCH, 12.0 * paper.INCH, 24.0 * paper.INCH)  # [m/s]

# Floors beside the stopping figures [m]: none, and what a scene has by default.
FLOORS = (0.0, 0.005)

# The wall's face, from where the slide's frame is, and where the bisection begins and
# how fine it is [m].
WALL = 1.5
WIDEST = 0.6
GRAIN = 2e-4

# Starts of a run.
PHASES = 4

# The paper's latency is 25 ms, split over a few ms of delivery, a cycle, and drives.
SENSING = 0.003
ARMS: Mapping[str, Mapping[str, float]] = {
    "short stop, long swing": {
        "velocity": paper.TOP,
        "acceleration": paper.ACCELERATION,
        "deceleration": paper.DECELERATION,
        "ramp": paper.RAMP,
        "settle": paper.SWING,
        "settle_time": paper.SWING_TIME,
        "sensing": SENSING,
        "command": paper.LATENCY - SENSING - PERIOD,
    },
    "one deceleration": {
        "velocity": paper.TOP,
        "deceleration": 48.0 * paper.INCH,
        "sensing": SENSING,
        "command": paper.LATENCY - SENSING - PERIOD,
    },
}


def gap_of(q: Floats) -> float:
    """Distance of the cube and the wall [m]."""
    return WALL - HALF - float(q[0])


def before_wall(figures: StoppingFigures, mode: Mode, buffer: float) -> Judge:
    """The slide before the wall, under a guard."""
    scene = Scene(mode=mode, buffer=buffer)
    scene.add_robot(SLIDE, name="arm", stopping=figures)
    wall = Box(half_extents=(HALF, 1.0, 1.0))
    scene.add(wall, name="wall", pose=cube_at(WALL + HALF))
    return guarded(scene)


def start_of(figures: StoppingFigures, speed: float, gap: float) -> list[float]:
    """The start of a run that has its speed a little before a gap [m]."""
    speeding_up = 0.5 * speed * speed / float(figures.acceleration[0])
    return [WALL - HALF - gap - LEAD - speeding_up]


def kept_by(figures: StoppingFigures, buffer: float, speed: float) -> bool:
    """Whether nothing is ever touched with a fixed buffer [m]."""
    judge = before_wall(figures, "fixed", buffer)
    begin = start_of(figures, speed, buffer)
    runs = worst_runs(judge, figures, begin, speed, PHASES, gap_of)
    return all(run.least >= 0.0 for run in runs)


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
    """Clearance at which a mode orders the stop, and what comes of it [m]."""
    judge = before_wall(figures, mode, floor)
    calm = run(judge, figures, start_of(figures, speed, WIDEST), speed, gap_of)
    begin = start_of(figures, speed, calm.distance)
    runs = list(worst_runs(judge, figures, begin, speed, PHASES, gap_of))
    return {
        "distance": float(np.mean([r.distance for r in runs])),
        "least": min(r.least for r in runs),
        "terms": terms(runs[0].verdict),
    }


def measure() -> list[dict[str, Any]]:
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
                row[f"path, floor {1e3 * floor:g} mm"] = ordered_at(
                    figures, "path", floor, speed
                )
            row["speed mode"] = ordered_at(figures, "speed", FLOORS[0], speed)
            rows.append(row)
    return rows
