"""Plans that start in turn by reservations of space, with all errors at their worst."""

from time import process_time
from typing import Any

import numpy as np

from armguard.maps.cell_plan import CoordinationError
from armguard.maps.reservations import Reservations
from mapping.cells import ROBOTS, cell_of, plans_of
from mapping.judge import CYCLES, WORST_FOLLOWING, WORST_SKEW, contacts_in

# Time between states that are judged [s], and questions that are timed.
TICK = 0.008 * CYCLES
ASKED = 10_000


def judged_reservation(apart: float, seed: int) -> dict[str, Any]:
    """Starts of both arms' plans, and what Coal says of their execution.

    Args:
        apart: How far the arms are apart [m].
        seed: Of the plans.
    """
    cell = cell_of(apart)
    plans = plans_of(cell, seed, WORST_FOLLOWING, WORST_SKEW)
    space = Reservations(cell.scene)
    start = process_time()
    regions = {robot: space.region(robot, plans[robot]) for robot in ROBOTS}
    reserving = (process_time() - start) / len(regions)
    try:
        first, second = space.in_turn(regions.values())
    except CoordinationError:
        return {"no_way": 1}
    # The same again up to the second plan.
    for one in regions.values():
        space.rest(one.robot, one.first, one.error)
    space.reserve(regions[first.robot], first.start)
    start = process_time()
    starts = space.starts(regions[second.robot])
    finding = process_time() - start
    start = process_time()
    for _ in range(ASKED):
        starts.earliest(second.start)
    asking = (process_time() - start) / ASKED
    begins = {first.robot: first.start, second.robot: second.start}
    ticks = np.arange(0.0, max(first.end, second.end), TICK)
    times = np.column_stack([ticks - begins[robot] for robot in ROBOTS])
    return {
        "no_way": 0,
        "contacts": contacts_in(cell, plans, times, WORST_FOLLOWING, WORST_SKEW),
        "states": len(ticks),
        "reserving": reserving,
        "finding": finding,
        "asking": asking,
        "waits": int(second.start > first.start),
        "executed": float(max(first.end, second.end)),
        "one_after_another": sum(one.duration for one in regions.values()),
        "alone": max(one.duration for one in regions.values()),
    }
