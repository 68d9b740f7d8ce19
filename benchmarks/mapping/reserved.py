"""Plans that start in turn by reservations of space, with all errors at their worst."""

from time import perf_counter, process_time
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
    regions = [space.region(robot, plans[robot]) for robot in ROBOTS]
    seconds = (process_time() - start) / len(regions)
    try:
        booked = {one.robot: one for one in space.in_turn(regions)}
    except CoordinationError:
        return {"no_way": 1}
    starts = space.starts(regions[-1]) if len(booked) == 1 else None
    del starts
    ends = [booked[robot].end for robot in ROBOTS]
    ticks = np.arange(0.0, max(ends), TICK)
    times = np.column_stack([ticks - booked[robot].start for robot in ROBOTS])
    return {
        "no_way": 0,
        "contacts": contacts_in(cell, plans, times, WORST_FOLLOWING, WORST_SKEW),
        "states": len(ticks),
        "seconds": seconds,
        "microseconds": asked_time(space, regions),
        "executed": max(ends),
        "one_after_another": sum(one.duration for one in regions),
        "alone": max(one.duration for one in regions),
    }
