"""What Coal says of maps and of executions, with all errors at their worst."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from time import process_time
from typing import Any

import numpy as np

from armguard.maps.cell_plan import CoordinationError
from armguard.maps.coordination import CoordinationMap
from armguard.maps.execution import CYCLE
from arrays import Floats
from mapping.cells import ROBOTS, Cell, cell_of, plans_of
from timing import quiet
from verifying.oracle import positions

# What joints [rad] and clocks [s] are off: of maps, and of schedules that are executed.
FOLLOWING, SKEW = 0.004, 0.02
WORST_FOLLOWING, WORST_SKEW = 0.015, 0.05

# Times of each plan at which a map is judged, with those of the other.
SAMPLES = 300

# Of all samples, one in so many is judged where the map does not call it free.
SHARE = 10

# What is so far apart is to be found free [m].
CLEAR = 0.05

# Look-ups that are timed.
ROUNDS = 100_000

# How far Coal's distances may be off [m].
ACCURACY = 1e-6

# Executions of each schedule, and cycles between two that are judged.
RUNS, CYCLES = 2, 6


@dataclass(frozen=True, slots=True)
class Placed:
    """Poses of one arm's primitives at some rows.

    Attributes:
        poses: Of each row and primitive, as Coal has them.
        middles: Their origins, shape (k, p, 3) [m].
    """

    poses: list[list[Any]]
    middles: Floats


def placed_at(cell: Cell, rows: Floats, sides: Sequence[int]) -> list[Placed]:
    """Poses of the primitives of some arms, 0 or 1 each, at rows of shape (k, n)."""
    poses: list[list[Any]] = [[] for _ in sides]
    origins: list[list[Floats]] = [[] for _ in sides]
    for q in rows:
        every = cell.oracle.place(q)
        for k, side in enumerate(sides):
            poses[k].append(cell.oracle.poses(cell.sides[side]))
            origins[k].append(every[cell.sides[side]])
    return [Placed(*one) for one in zip(poses, map(np.array, origins), strict=True)]


def off_rows(
    cell: Cell, robot: str, plans: Any, times: Floats, rng: np.random.Generator
) -> Floats:
    """Rows of one arm with every joint and its clock off to one side."""
    tube = plans[robot].plan.tube
    late = times + SKEW * rng.choice([-1.0, 1.0], len(times))
    rows = positions(tube, np.clip(late, tube.times[0], tube.times[-1]))
    return np.asarray(rows + FOLLOWING * rng.choice([-1.0, 1.0], rows.shape))


def nearer_than(
    cell: Cell, one: Placed, other: Placed, pairs: Any, limit: float
) -> Any:
    """Which pairs of rows have links of both arms nearer than a limit.

    Args:
        cell: The cell.
        one: The left arm at some rows.
        other: The right arm at some rows.
        pairs: Row of each, shape (k, 2).
        limit: The limit [m].

    Returns:
        Shape (k,).
    """
    left, right = cell.sides
    reach = cell.oracle.radii[left][:, None] + cell.oracle.radii[right] + limit
    found = np.zeros(len(pairs), dtype=bool)
    for first in range(0, len(pairs), 2000):
        part = pairs[first : first + 2000]
        a, b = one.middles[part[:, 0]], other.middles[part[:, 1]]
        # |a - b|² without the vectors between.
        squared = (a**2).sum(2)[:, :, None] + (b**2).sum(2)[:, None, :]
        squared -= 2.0 * a @ b.transpose(0, 2, 1)
        near = np.argwhere(squared < reach**2 + 1e-9)
        for k, i, j in near.tolist():
            if found[first + k]:
                continue
            r, s = part[k]
            gap = cell.oracle.distance_at(
                left[i], one.poses[r][i], right[j], other.poses[s][j]
            )
            found[first + k] = gap < limit - ACCURACY
    return found


def judged_map(apart: float, seed: int, samples: int = SAMPLES) -> dict[str, Any]:
    """A map of 20 x 20 segments, and what dense samples say of it."""
    cell, rng = cell_of(apart), np.random.default_rng([seed, 92])
    plans = plans_of(cell, seed, FOLLOWING, SKEW)
    # The first map in a cell compiles, and fills its cells.
    cell.coordinator.map(plans)
    start = process_time()
    found = cell.coordinator.map(plans)
    seconds = process_time() - start
    times = rng.uniform(0.0, plans["left"].plan.duration, (2, samples))
    placed = [
        placed_at(cell, off_rows(cell, robot, plans, times[k], rng), [k])[0]
        for k, robot in enumerate(ROBOTS)
    ]
    pairs = np.indices((samples, samples)).reshape(2, -1).T
    allowed = np.array(
        [[found.allowed(a, b) for b in times[1]] for a in times[0]]
    ).reshape(-1)
    touching = nearer_than(cell, *placed, pairs[allowed], 0.0)
    some = rng.permutation(len(pairs))[: len(pairs) // SHARE]
    near = nearer_than(cell, *placed, pairs[some], CLEAR)
    contact = nearer_than(cell, *placed, pairs[some[near]], 0.0)
    return {
        "samples": len(pairs),
        "false_free": int(touching.sum()),
        "some": len(some),
        "touching": int(contact.sum()),
        "clear": int((~near).sum()),
        "found": int((~near & allowed[some]).sum()),
        "unknown": found.unknown,
        "free": found.free,
        "forbidden": found.touching,
        "seconds": seconds,
    }


def worst_rows(
    cell: Cell, plans: Any, plan_times: Floats, following: float, skew: float
) -> Floats:
    """Rows with clocks and joints off to where both arms are nearest, (k, n) [rad].

    Of the four ends of both clocks the nearest one counts; each joint is then off
    against the derivative of that distance.
    """
    best, least = np.zeros(0), np.full(len(plan_times), np.inf)
    for late in product((-skew, skew), repeat=2):
        rows = np.tile(cell.scene.home, (len(plan_times), 1))
        for k, robot in enumerate(ROBOTS):
            tube = plans[robot].plan.tube
            times = np.clip(plan_times[:, k] + late[k], *tube.times[[0, -1]])
            own = [name.startswith(f"{robot}/") for name in cell.scene.q_names]
            rows[:, own] = positions(tube, times)[:, own]
        gaps = cell.checker.distances(rows).distance
        best = np.where((gaps < least)[:, None], rows, best) if best.size else rows
        least = np.minimum(least, gaps)
    near = cell.checker.witnesses(best, cell.checker.distances(best))
    return np.asarray(best - following * np.sign(near.gradient))


def contacts_in(cell: Cell, plans: Any, plan_times: Floats, *errors: float) -> int:
    """States in which links of both arms touch, with errors as in `worst_rows`."""
    rows = worst_rows(cell, plans, plan_times, *errors)
    placed = placed_at(cell, rows, (0, 1))
    both = np.repeat(np.arange(len(rows))[:, None], 2, axis=1)
    return int(nearer_than(cell, *placed, both, 0.0).sum())


def in_step(found: CoordinationMap) -> float | None:
    """Time if both robots begin each segment together, or one after the other [s].

    Returns:
        None where some segments of both cannot be executed so.
    """
    free, step = ~found.diagrams[0].blocked, found.diagrams[0].step
    whole, (i, j) = 0.0, (0, 0)
    ends = [[one.end for one in found.segments[robot]] for robot in ROBOTS]
    for end, last in zip(*ends, strict=True):
        k, m = round(end / step), round(last / step)
        share = np.arange(k - i) / (k - i)
        together = free[i:k][np.arange(k - i), j + (share * (m - j)).astype(int)]
        # The one robot first while the other rests, then the other; or reversed.
        first = (
            free[i:k, max(j - 1, 0)].all() and free[min(k, len(free) - 1), j:m].all()
        )
        second = free[max(i - 1, 0), j:m].all() and (
            free[i:k, min(m, free.shape[1] - 1)].all()
        )
        if together.all():
            whole += step * max(k - i, m - j)
        elif first or second:
            whole += step * (k - i + m - j)
        else:
            return None
        i, j = k, m
    return whole


def judged_schedule(apart: float, seed: int, left_out: str = "") -> dict[str, Any]:
    """A schedule, and executions by its interlocks alone, with the worst errors.

    Args:
        apart: How far the arms are apart [m].
        seed: Of the plans.
        left_out: "following error" or "skew": the arms have this error alone, and the
            map knows none; by default both know both.
    """
    cell, rng = cell_of(apart), np.random.default_rng([seed, 93])
    following = 0.0 if left_out == "skew" else WORST_FOLLOWING
    skew = 0.0 if left_out == "following error" else WORST_SKEW
    known = (0.0, 0.0) if left_out else (following, skew)
    found = cell.coordinator.map(plans_of(cell, seed, *known))
    try:
        schedule = found.schedule()
    except CoordinationError:
        return {"no_way": 1}
    rules = found.interlocks(schedule)
    ticks = np.arange(0.0, schedule.makespan, CYCLES * CYCLE)
    walks = [np.array([schedule.at(t) for t in ticks])]
    deadlocks, executed = 0, 0.0
    for k in range(RUNS):
        paces = {} if k == 0 else dict(zip(ROBOTS, rng.uniform(0.3, 1, 2), strict=True))
        run = found.execute(rules, paces=paces)
        deadlocks += not run.finished
        executed = executed or float(run.times[-1])
        walks.append(run.plan_times[::CYCLES])
    together = in_step(found)
    return {
        "no_way": 0,
        "contacts": contacts_in(
            cell, found.plans, np.concatenate(walks), following, skew
        ),
        "deadlocks": deadlocks,
        "states": sum(map(len, walks)),
        "interlocks": len(rules),
        "waits": int(bool(schedule.waits)),
        "quickest": schedule.makespan,
        "executed": executed,
        "one_after_another": found.one_after_another,
        "alone": found.without_interference,
        "in_step": together or found.one_after_another,
        "in_step_ways": int(together is not None),
    }


def look_up_time(seed: int) -> float:
    """Processor time of a look-up in a map [ns]."""
    cell = cell_of(1.0)
    found = cell.coordinator.map(plans_of(cell, seed, FOLLOWING, SKEW))
    allowed = found.allowed
    with quiet():
        start = process_time()
        for _ in range(ROUNDS):
            allowed(4.3, 6.1)
        seconds = process_time() - start
    return 1e9 * seconds / ROUNDS
