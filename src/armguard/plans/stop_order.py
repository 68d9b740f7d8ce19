"""How long before two links come too near a guard has to order a stop."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.prove.tube import Tube
from armguard.robot.stopping.distance import stop_travel
from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# Orders that are tried are this far from each other [s].
STEP = 1e-3


@dataclass(frozen=True, slots=True)
class StopOrder:
    """The latest time at which a stop keeps two links apart, by the declared figures.

    Attributes:
        time: That time; None if the plan begins later than that [s].
        lead: From then until the two come too near [s].
        reaction: What passes of it until the slowest drive obeys [s].
        stop: What passes then until the slowest joint rests [s].
        robots: Those that have to stop.
    """

    time: float | None
    lead: float
    reaction: float
    stop: float
    robots: tuple[str, ...]


def stop_order(
    names: Sequence[str], near: float, tube: Tube, tables: SceneTables
) -> StopOrder | None:
    """The latest order of a stop that comes in time.

    Args:
        names: Two links or objects, 'robot/link' or an object's name.
        near: Time at which they come too near [s].
        tube: The plan.
        tables: The scene.

    Returns:
        None where no robot of the two has stopping figures.
    """
    moving = [
        part
        for part in tables.robots
        if part.stopping is not None
        and any(name.startswith(f"{part.name}/") for name in names)
    ]
    if not moving:
        return None
    steps = max(int((near - tube.times[0]) / STEP), 1)
    orders: Floats = near - STEP * np.arange(1.0, steps + 1.0)
    velocities = np.abs(tube.velocities(orders))
    robots = tuple(part.name for part in moving)
    for order, speeds in zip(orders.tolist(), velocities, strict=True):
        every = [stop_times(part, speeds, tables) for part in moving]
        reaction, stop = max(every, key=sum)
        if order + reaction + stop <= near:
            return StopOrder(order, near - order, reaction, stop, robots)
    return StopOrder(None, near - float(tube.times[0]), reaction, stop, robots)


def stop_times(
    part: RobotPart, speeds: Floats, tables: SceneTables
) -> tuple[float, float]:
    """Reaction and stop of a robot's slowest joint, from the speeds of all [s]."""
    assert part.stopping is not None
    stops = [
        stop_travel(
            part.stopping,
            j,
            float(speeds[part.first_joint + j]),
            tables.period,
            tables.late,
        )
        for j in range(part.joint_count)
    ]
    worst = max(stops, key=lambda stop: stop.time)
    return worst.reaction_time, worst.braking_time + worst.settle_time
