"""Two arms head-on: under one guard, and each under its own.

An own guard takes the other arm for an object: of the other's declared top speed, or,
which is fairer, of the speed it has, for all of the time until this arm rests.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from armguard import Guard, Pose, Scene
from armguard.guard import Verdict
from armguard.guard.objects import SightingError
from armguard.robot.stopping import StoppingFigures
from arrays import Floats
from room.slides import (
    CUBE,
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

SPEEDS = (0.1, 0.25, 0.4, 0.6)  # [m/s]
TOP = 1.25  # [m/s]
FLOOR = 0.005  # [m]

# How far apart the slides' frames are [m].
FARTHEST = 3.0

# The first run begins at a gap that is not needed: so much at rest [m], and what is
# driven in so long a time [s].
REST_GAP, GAP_TIME = 0.3, 2.0

# Starts of a run.
PHASES = 2

# The bay's figures with a metre for a radian; the same without swing; a slow arm.
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
ARMS: Mapping[str, Mapping[str, Any]] = {
    "the bay's": BAY,
    "the bay's, no swing": {**BAY, "settle": 0.0, "settle_time": 0.0},
    "weak, no swing": {
        **BAY,
        "acceleration": 3.0,
        "deceleration": 1.5,
        "deceleration_most": 3.0,
        "settle": 0.0,
        "settle_time": 0.0,
    },
}

WAYS = ("one guard", "own guard, actual speed", "own guard, top speed")


def gap_of(q: Floats) -> float:
    """Distance of two cubes whose slides face each other [m]."""
    return FARTHEST - float(q.sum()) - 2.0 * HALF


def start_of(gap: float) -> float:
    """Where both slides start for a gap [m]."""
    return 0.5 * (FARTHEST - 2.0 * HALF - gap)


def together(figures: StoppingFigures) -> Judge:
    """Both slides under one guard."""
    scene = Scene(mode="path", buffer=FLOOR)
    facing = Pose(xyz=(FARTHEST, 0.0, 0.0), rpy=(0.0, 0.0, np.pi))
    scene.add_robot(SLIDE, name="one", stopping=figures)
    scene.add_robot(SLIDE, name="other", base=facing, stopping=figures)
    return guarded(scene)


def apart(figures: StoppingFigures, speed: float) -> Judge:
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

    return judge


def measure() -> list[dict[str, Any]]:
    """Gaps at the stop, for each kind of arm and each speed."""
    rows = []
    for name, declared in ARMS.items():
        figures = slide_figures(**declared)
        one, top = together(figures), apart(figures, TOP)
        for speed in SPEEDS:
            # Its operator pushes for a period before the stop is ordered.
            fastest = speed + float(figures.acceleration[0]) * PERIOD
            judges = dict(zip(WAYS, (one, apart(figures, fastest), top), strict=True))
            row: dict[str, Any] = {"arm": name, "tool_speed": speed}
            for way, judge in judges.items():
                row[way] = gap_at_stop(judge, figures, speed)
            rows.append(row)
    return rows


def gap_at_stop(judge: Judge, figures: StoppingFigures, speed: float) -> dict[str, Any]:
    """Mean gap at the first stop, least gap of all runs, the need by cause."""
    begin = start_of(REST_GAP + GAP_TIME * speed)
    calm = run(judge, figures, [begin, begin], speed, gap_of)
    speeding_up = speed * speed / float(figures.acceleration[0])
    begin = start_of(calm.distance + LEAD + speeding_up)
    runs = list(worst_runs(judge, figures, [begin] * 2, speed, PHASES, gap_of))
    return {
        "gap": float(np.mean([r.distance for r in runs])),
        "least": min(r.least for r in runs),
        "contacts": sum(r.least < 0.0 for r in runs),
        "runs": len(runs),
        "terms": terms(runs[0].verdict),
    }
