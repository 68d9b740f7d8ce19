"""`bench filter`: what it costs to have commands filtered, in a crowded bay."""

from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.timing import percentiles, quiet
from armguard.geometry import Pose, Sphere
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

CYCLES = 20_000
PERIOD = 1e-3

# Small balls put close to both arms, so that so many pairs are near [-].
BALLS = 34
RADIUS = 0.01

# Between which distances from what is nearest a ball is put [m].
SHELL = (0.009, 0.024)

# Amplitude and frequency of what the operators ask for [rad/s], [Hz].
SPEED = 0.15
FREQUENCY = 0.7


def bench_filter(cycles: int | None, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.filter` with both arms moving among balls.

    The same wishes go through a bay without balls, and the same states through `step`.

    Args:
        cycles: Cycles to measure.
        progress: Called with a sentence before each part.
    """
    count = CYCLES if cycles is None else cycles
    progress("putting balls around the arms")
    crowded = crowded_guard(progress)
    clear = Guard(bay_scene("path"))
    answer: dict[str, Any] = {
        "name": "filter",
        "machine": describe_machine(),
        "cycles": count,
    }
    for name, guard in (("crowded", crowded), ("bay", clear)):
        progress(f"measuring {count} filtered cycles: {name}")
        with quiet():
            answer[name] = filtered(guard, count)
    return answer


def crowded_guard(progress: Progress) -> Guard:
    """A guard of the crowded bay."""
    return Guard(crowded_scene(progress), self_test=False)


def crowded_scene(progress: Progress) -> Scene:
    """The bay with balls close to the arms where they stand at home."""
    rng = np.random.default_rng(1)
    scene = with_balls(bay_scene("path"), {})
    guard = Guard(scene, self_test=False, progress=progress)
    places: dict[str, Floats] = {}
    guard.judge_at_rest(guard.home)
    boxes = guard.index.world.boxes[: guard.tables.moving_count]
    centres = 0.5 * (boxes[:, :3] + boxes[:, 3:])
    for k in range(BALLS):
        name = f"ball{k}"
        while name not in places:
            p = centres[rng.integers(len(centres))] + rng.normal(0.0, 0.08, 3)
            guard.place(name, Pose(xyz=tuple(p)))
            gaps = [
                pair.distance
                for pair in guard.judge_at_rest(guard.home).near
                if pair.b == name
            ]
            if gaps and SHELL[0] < min(gaps) < SHELL[1]:
                places[name] = p
        guard.place(name, Pose(xyz=tuple(places[name])))
    return with_balls(bay_scene("path"), places)


def with_balls(scene: Scene, places: dict[str, Floats]) -> Scene:
    """A scene with balls, where they have a place."""
    for k in range(BALLS):
        name = f"ball{k}"
        at = places.get(name)
        scene.add(
            Sphere(radius=RADIUS),
            name=name,
            pose=None if at is None else Pose(xyz=tuple(at)),
            present=at is not None,
        )
    return scene


def filtered(guard: Guard, count: int) -> dict[str, Any]:
    """Drive both arms to and fro through the filter; they do as they are told."""
    n = len(guard.q_names)
    phases = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, n)
    q, v = guard.home, np.zeros(n)
    times, near, stops, programs = [], [], 0, 0
    steps = []
    guard.reset()
    for k in range(count):
        wish = SPEED * np.sin(2.0 * np.pi * FREQUENCY * k * PERIOD + phases)
        begin = perf_counter_ns()
        command = guard.filter(q, wish, k * PERIOD, velocity=v)
        times.append(perf_counter_ns() - begin)
        near.append(len(command.verdict.near))
        stops += command.action > 0
        programs += bool((np.abs(command.velocity - wish) > 1e-9).any())
        v = command.velocity
        q = q + v * PERIOD
    for k in range(count // 10):
        begin = perf_counter_ns()
        guard.step(q, (count + k) * PERIOD, velocity=v)
        steps.append(perf_counter_ns() - begin)
    warm = count // 20
    return {
        **percentiles(np.array(times[warm:], dtype=np.float64)),
        "near_pairs_median": float(np.median(near)),
        "near_pairs_max": float(max(near)),
        "share_changed": programs / count,
        "cycles_stopped": stops,
        "step_median_us": float(np.median(steps)) / 1e3,
    }
