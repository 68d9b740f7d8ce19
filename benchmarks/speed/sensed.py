"""`bench sensed`: the filtered bay cycle among cells, in processor time."""

from time import thread_time_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.cells.deltas import Delta
from armguard.cells.grid import Bools, packed
from armguard.record import Records, records
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene
from timing import Progress, percentiles, quiet

CYCLES = 4_000

# Region of the bay: 256 cells an edge.
CENTRE, CELL, SIZE = (1.4, 0.0, 1.0), 0.03, 256

# Cycles between two motions that are desired, and their greatest speed [rad/s].
TURN, FASTEST = 200, 0.6

# Cells of each case by their distance from the arms at home [m], and whether they are
# unknown; `unknown` of the scene.
CASES: dict[str, tuple[tuple[float, float], bool, str]] = {
    "no cell": ((0.0, 0.0), False, "free"),
    "none near": ((0.8, 1.05), False, "free"),
    "around": ((0.2, 0.5), False, "free"),
    "unknown, still": ((0.3, 9.0), True, "still"),
    "unknown, moving": ((0.3, 9.0), True, "moving"),
    "crowded, unknown, still": ((0.05, 9.0), True, "still"),
}


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.filter` by the cells around, and of 512 changes of a map."""
    progress(f"measuring {cycles} filtered cycles without sensed space")
    guard = Guard(bay_scene("path"), self_test=False, clock=thread_time_ns)
    answer: dict[str, Any] = {"cycles": cycles, "without": timed(guard, cycles, False)}
    guard.judge_at_rest(guard.home)
    moving = guard.tables.moving_count
    distance = distances(guard.index.world.boxes[:moving])
    for name, ((low, high), unknown, mode) in CASES.items():
        progress(f"measuring {cycles} filtered cycles: {name}")
        cells = (distance > low) & (distance < high)
        guard = Guard(sensed_bay(mode), self_test=False, clock=thread_time_ns)
        none = np.zeros_like(cells)
        found = changes(none if unknown else cells, cells if unknown else none)
        for k in range(0, len(found), 512):
            guard.update_cells(found[k : k + 512], -1.0)
        answer[name] = {"cells": int(cells.sum()), **timed(guard, cycles, True)}
        answer[name]["512 changes"] = percentiles(of_changes(guard, found))
    return answer


def sensed_bay(unknown: str) -> Scene:
    """The bay in sensed space."""
    scene = bay_scene("path")
    scene.set_sensing(
        region={"centre": CENTRE, "size": SIZE},
        cell=CELL,
        unknown=unknown,
        reason="a benchmark",
        intruder={"speed": 0.25, "size": 0.05},
    )
    return scene


def distances(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of the middle of each cell to the nearest bounding box [m]."""
    axes = [c + CELL * (np.arange(SIZE) + 0.5 - SIZE / 2) for c in CENTRE]
    nearest = np.full((SIZE,) * 3, np.inf)
    for box in boxes:
        x, y, z = (
            np.maximum(np.maximum(box[k] - axes[k], axes[k] - box[k + 3]), 0.0) ** 2
            for k in range(3)
        )
        squares = x[:, None, None] + y[None, :, None] + z[None, None, :]
        nearest = np.minimum(nearest, squares)
    return np.sqrt(nearest)


def changes(occupied: Bools, unknown: Bools) -> Records[Delta]:
    """All words of a map as changes."""
    words = packed(occupied)
    found = records(len(words), Delta)
    found["bits"][:, 0], found["bits"][:, 1] = words, packed(unknown)
    found["word"], found["stamp"] = np.arange(len(words)), -1.0
    return found


def timed(guard: Guard, cycles: int, sensed: bool) -> dict[str, Any]:
    """Durations of cycles under random desired motions, near pairs and stops."""
    draw = np.random.default_rng(0)
    none = records(0, Delta)
    q, period = guard.home, guard.tables.period
    v, wanted = np.zeros(len(q)), np.zeros(len(q))
    taken, near, stops = [], 0, 0
    with quiet():
        for k in range(cycles):
            if k % TURN == 0:
                wanted = draw.uniform(-FASTEST, FASTEST, len(q))
                guard.engage()
            if sensed:
                guard.update_cells(none, k * period)
            command = guard.filter(q, wanted, k * period, velocity=v)
            taken.append(command.verdict.cycle_time * 1e9)
            near += len(command.verdict.near)
            stops += not command.velocity.any()
            v = command.velocity
            q = q + period * v
    return {**percentiles(taken), "near": near / cycles, "at rest": stops / cycles}


def of_changes(guard: Guard, found: Records[Delta]) -> list[int]:
    """Durations of calls with 512 changes [ns]."""
    taken = []
    for k in range(0, len(found), 512):
        begin = thread_time_ns()
        guard.update_cells(found[k : k + 512], 1e6)
        taken.append(thread_time_ns() - begin)
    return taken
