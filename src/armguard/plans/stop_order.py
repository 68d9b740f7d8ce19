"""How long before two links come too near a guard has to order a stop."""

from collections.abc import Sequence
from dataclasses import dataclass

from armguard.prove.tube import Tube
from armguard.robot.stopping.distance import stop_travel
from armguard.scene.tables import RobotPart, SceneTables


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
    speeds = tube.top_speeds()
    segment = int(tube.place(tube.times[:1] * 0.0 + near)[0][0])
    found = (0.0, 0.0)
    for k in range(segment, -1, -1):
        every = [stop_times(part, speeds[k], tables) for part in moving]
        found = max(found, max(every, key=sum), key=sum)
        order = min(near - sum(found), float(tube.times[k + 1]))
        if order >= tube.times[k]:
            break
    names_of = tuple(part.name for part in moving)
    in_time = order >= tube.times[0]
    lead = near - order if in_time else near - float(tube.times[0])
    return StopOrder(float(order) if in_time else None, float(lead), *found, names_of)


def stop_times(
    part: RobotPart, speeds: Sequence[float], tables: SceneTables
) -> tuple[float, float]:
    """Reaction and stop of a robot's slowest joint, from bounds of all speeds [s]."""
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
