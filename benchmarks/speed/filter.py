"""`bench filter`: what a filtered command costs, in a crowded bay."""

from collections.abc import Iterator
from time import perf_counter_ns
from typing import Any, NamedTuple

import numpy as np

from armguard.geometry import Pose, Sphere
from armguard.respond import Guard
from armguard.respond.command import Command
from armguard.scene import Scene, bay_scene
from arrays import Floats
from speed.scenes import PERIOD
from timing import Progress, percentiles, quiet

CYCLES = 20_000

# Small balls near both arms, so that many pairs are near [-].
BALLS = 34
RADIUS = 0.01

# Least and greatest distance of a ball from the nearest link [m].
SHELL = (0.009, 0.024)

# Amplitude and frequency of the desired velocities [rad/s], [Hz].
SPEED = 0.15
FREQUENCY = 0.7


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.filter` with both arms moving among balls.

    The same desired velocities go through a bay without balls, and the same states
    through `step`.
    """
    progress("putting balls around the arms")
    guards = {"crowded": crowded_guard(progress), "bay": Guard(bay_scene("path"))}
    answer: dict[str, Any] = {"cycles": cycles}
    for name, guard in guards.items():
        progress(f"measuring {cycles} filtered cycles: {name}")
        with quiet():
            answer[name] = filtered(guard, cycles)
    return answer


def crowded_guard(progress: Progress) -> Guard:
    """A guard of the crowded bay."""
    return Guard(crowded_scene(progress), self_test=False)


def crowded_scene(progress: Progress) -> Scene:
    """The bay with balls close to the arms at home."""
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
            near = guard.judge_at_rest(guard.home).near
            gaps = [pair.distance for pair in near if pair.b == name]
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


class Cycle(NamedTuple):
    """A filtered cycle.

    Attributes:
        q: Positions [rad].
        desired: Desired velocities [rad/s].
        command: The filter's answer.
        taken: Duration of the call [ns].
    """

    q: Floats
    desired: Floats
    command: Command
    taken: int


def driven(guard: Guard, count: int) -> Iterator[Cycle]:
    """Drive both arms to and fro through the filter; they follow its commands."""
    n = len(guard.q_names)
    phases = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, n)
    q, v = guard.home, np.zeros(n)
    for k in range(count):
        desired = SPEED * np.sin(2.0 * np.pi * FREQUENCY * k * PERIOD + phases)
        begin = perf_counter_ns()
        command = guard.filter(q, desired, k * PERIOD, velocity=v)
        yield Cycle(q, desired, command, perf_counter_ns() - begin)
        v = command.velocity
        q = q + v * PERIOD


def filtered(guard: Guard, count: int) -> dict[str, Any]:
    """Durations of filtered cycles, what they had to do, and those of `step`."""
    times, steps, near, stops, changed = [], [], [], 0, 0
    guard.reset()
    for cycle in driven(guard, count):
        v = cycle.command.velocity
        times.append(cycle.taken)
        near.append(len(cycle.command.verdict.near))
        stops += cycle.command.action > 0
        changed += bool((np.abs(v - cycle.desired) > 1e-9).any())
    q = cycle.q + v * PERIOD
    for k in range(count // 10):
        begin = perf_counter_ns()
        guard.step(q, (count + k) * PERIOD, velocity=v)
        steps.append(perf_counter_ns() - begin)
    return {
        **percentiles(times[count // 20 :]),
        "near_pairs_median": float(np.median(near)),
        "near_pairs_max": float(max(near)),
        "share_changed": changed / count,
        "cycles_stopped": stops,
        "step_median_us": float(np.median(steps)) / 1e3,
    }
