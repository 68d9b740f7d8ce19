"""`bench stop`: what the prediction of stops costs, by mode, in the bay."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.motion import sway
from armguard.benchmark.timing import percentiles, quiet, time_in_turns
from armguard.guard import Level, Verdict
from armguard.respond import Guard
from armguard.scene import bay_scene
from armguard.scene.settings import MODES

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

CYCLES = 2000
PERIOD = 1e-3


class Run:
    """A guard that is driven through a motion, again and again.

    Where it orders a stop, and where the motion begins anew, it is reset: a recorded
    motion does not obey.

    Args:
        guard: The guard.
        rows: Joint positions of the motion, shape (k, n).
        paced: Whether velocities and stamps are given.
    """

    def __init__(self, guard: Guard, rows: Floats, paced: bool) -> None:
        self.guard = guard
        self.velocity = np.gradient(rows, PERIOD, axis=0)
        self.places = {row.tobytes(): k for k, row in enumerate(rows)}
        self.paced = paced
        self.last, self.time = -2, 0.0
        self.times: list[float] = []

    def ready(self, row: Floats) -> tuple[Floats, float]:
        """Velocity and stamp of the next cycle."""
        k = self.places[row.tobytes()]
        if self.paced and k != self.last + 1:
            # A guard starts with robots at rest.
            self.guard.reset()
            self.time += PERIOD
            still = np.zeros_like(row)
            self.guard.step(row, self.time, velocity=still, now=self.time)
        self.last = k
        self.time += PERIOD
        return self.velocity[k], self.time

    def cycle(self, row: Floats) -> Verdict:
        """One cycle, and how long it took [ns]."""
        velocity, time = self.ready(row)
        if self.paced:
            verdict = self.guard.step(row, time, velocity=velocity, now=time)
        else:
            verdict = self.guard.step(row)
        self.times.append(verdict.cycle_time * 1e9)
        return verdict


def bench_stop(cycles: int | None, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.step` in each mode over the same motion.

    Args:
        cycles: Cycles to measure.
        progress: Called with a sentence before each part.
    """
    count = CYCLES if cycles is None else cycles
    guards = {mode: Guard(bay_scene(mode), progress=progress) for mode in MODES}
    tables = guards["fixed"].tables
    q = sway(tables.home, tables.lower, tables.upper, cycles=count, period=PERIOD)
    runs = {mode: Run(guard, q, mode != "fixed") for mode, guard in guards.items()}
    progress(f"measuring {count} cycles in each of {len(runs)} modes")
    with quiet():
        # The turns share the machine's moods; what counts is what a cycle took itself.
        time_in_turns([run.cycle for run in runs.values()], q)
    times = {mode: percentiles(np.array(run.times)) for mode, run in runs.items()}
    return {
        "name": "stop",
        "machine": describe_machine(),
        "scene": "bay",
        "cycles": count,
        "modes": {mode: {**times[mode], **judged(runs[mode], q)} for mode in times},
        "path_over_fixed": times["path"]["median_us"] / times["fixed"]["median_us"],
        "hard": hard_cycles(guards["path"], progress),
    }


def judged(run: Run, q: Floats) -> dict[str, float]:
    """What the cycles of a run had to do."""
    spans, tested, stops = [], [], 0
    for row in q:
        verdict = run.cycle(row)
        spans.append(verdict.counts.spans_tested)
        tested.append(verdict.counts.pairs_tested)
        if run.paced and verdict.level >= Level.STOP:
            stops += 1
            run.last = -2
    return {
        "pairs_tested_mean": float(np.mean(tested)),
        "spans_tested_mean": float(np.mean(spans)),
        "spans_tested_max": float(max(spans)),
        "stops": float(stops),
    }


def hard_cycles(guard: Guard, progress: Progress) -> dict[str, float]:
    """Cycles nobody would drive through: random poses and speeds, most of them stops.

    Returns:
        Percentiles of their durations, and the spans they tested.
    """
    rng = np.random.default_rng(0)
    low, high = guard.tables.lower, guard.tables.upper
    progress("measuring 2000 random states at full speed")
    times, spans = [], []
    for k in range(2000):
        q = np.clip(guard.home + rng.uniform(-0.8, 0.8, len(low)), low, high)
        v = rng.uniform(-1.25, 1.25, len(low))
        guard.reset()
        guard.step(q, k - PERIOD, velocity=0.0 * v, now=k - PERIOD)
        verdict = guard.step(q, k, velocity=v, now=k)
        times.append(verdict.cycle_time * 1e9)
        spans.append(verdict.counts.spans_tested)
    return {
        **percentiles(np.array(times)),
        "spans_tested_mean": float(np.mean(spans)),
        "spans_tested_max": float(max(spans)),
    }
