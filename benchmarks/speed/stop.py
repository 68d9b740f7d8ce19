"""`bench stop`: what the prediction of stops costs, by mode, in the bay."""

from typing import Any

import numpy as np

from armguard.guard import Level, Verdict
from armguard.guard.answer import Counts
from armguard.respond import Guard
from armguard.scene import bay_scene
from armguard.scene.settings import MODES
from arrays import Floats
from speed.scenes import PERIOD, sway
from timing import Progress, percentiles, quiet, time_in_turns

CYCLES = 2000


class Run:
    """A guard that is driven through a motion, again and again.

    It is reset after a stop that it ordered, and where the motion begins anew: a
    recorded motion does not stop.

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

    def cycle(self, row: Floats) -> Verdict:
        """One cycle; its duration is kept [ns]."""
        k = self.places[row.tobytes()]
        if self.paced and k != self.last + 1:
            # A guard starts with robots at rest.
            self.guard.reset()
            self.step(row, np.zeros_like(row))
        self.last = k
        verdict = self.step(row, self.velocity[k])
        self.times.append(verdict.cycle_time * 1e9)
        return verdict

    def step(self, row: Floats, velocity: Floats) -> Verdict:
        """The next period of the guard."""
        self.time += PERIOD
        if not self.paced:
            return self.guard.step(row)
        return self.guard.step(row, self.time, velocity=velocity, now=self.time)


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.step` in each mode over the same motion."""
    guards = {mode: Guard(bay_scene(mode), progress=progress) for mode in MODES}
    q = sway(guards["fixed"].tables, cycles)
    runs = {mode: Run(guard, q, mode != "fixed") for mode, guard in guards.items()}
    progress(f"measuring {cycles} cycles in each of {len(runs)} modes")
    with quiet():
        # The turns share the machine's disturbances; the cycle's own time counts.
        time_in_turns([run.cycle for run in runs.values()], q)
    times = {mode: percentiles(run.times) for mode, run in runs.items()}
    return {
        "scene": "bay",
        "cycles": cycles,
        "modes": {mode: {**times[mode], **judged(runs[mode], q)} for mode in times},
        "path_over_fixed": times["path"]["median_us"] / times["fixed"]["median_us"],
        "hard": hard_cycles(guards["path"], progress),
    }


def judged(run: Run, q: Floats) -> dict[str, float]:
    """What the cycles of a run had to do."""
    counts, stops = [], 0
    for row in q:
        verdict = run.cycle(row)
        counts.append(verdict.counts)
        if run.paced and verdict.level >= Level.STOP:
            stops += 1
            run.last = -2
    return {
        "pairs_tested_mean": float(np.mean([c.pairs_tested for c in counts])),
        **spans_tested(counts),
        "stops": float(stops),
    }


def spans_tested(counts: list[Counts]) -> dict[str, float]:
    """Mean and greatest number of spans that a cycle tested."""
    spans = [c.spans_tested for c in counts]
    return {
        "spans_tested_mean": float(np.mean(spans)),
        "spans_tested_max": float(max(spans)),
    }


def hard_cycles(guard: Guard, progress: Progress) -> dict[str, float]:
    """Cycles of random poses and speeds, most of them stops.

    Returns:
        Percentiles of their durations, and the spans they tested.
    """
    rng = np.random.default_rng(0)
    low, high = guard.tables.lower, guard.tables.upper
    progress("measuring 2000 random states at full speed")
    times, counts = [], []
    for k in range(2000):
        q = np.clip(guard.home + rng.uniform(-0.8, 0.8, len(low)), low, high)
        v = rng.uniform(-1.25, 1.25, len(low))
        guard.reset()
        guard.step(q, k - PERIOD, velocity=0.0 * v, now=k - PERIOD)
        verdict = guard.step(q, k, velocity=v, now=k)
        times.append(verdict.cycle_time * 1e9)
        counts.append(verdict.counts)
    return {**percentiles(times), **spans_tested(counts)}
