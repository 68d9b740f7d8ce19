"""How far and how long a joint goes on after the guard has seen it, in named parts."""

from dataclasses import dataclass
from math import sqrt

from armguard.robot.stopping.figures import FiguresError, StoppingFigures


@dataclass(frozen=True, slots=True)
class StopTravel:
    """Worst case of one joint's stop, from the instant its speed was measured.

    Attributes:
        reaction: Way until the drives obey; the joint may still speed up [rad or m].
        braking: Way from then to rest [rad or m].
        settle: Swing beyond that [rad or m].
        reaction_time: Time until the drives obey [s].
        braking_time: Time from then to rest [s].
        settle_time: Time it may swing [s].
        speed: Speed at which the drives obey [rad/s or m/s].
    """

    reaction: float
    braking: float
    settle: float
    reaction_time: float
    braking_time: float
    settle_time: float
    speed: float

    @property
    def travel(self) -> float:
        """The whole way [rad or m]."""
        return self.reaction + self.braking + self.settle

    @property
    def time(self) -> float:
        """The whole time [s]."""
        return self.reaction_time + self.braking_time + self.settle_time


def stop_travel(
    figures: StoppingFigures,
    joint_index: int,
    speed: float,
    period: float,
    late: float = 0.0,
) -> StopTravel:
    """Worst case of a joint's controlled stop from a speed, at any pose.

    The measurement is `sensing` old when the guard has it, the order comes with the
    next cycle and takes `command` to be obeyed. All that time the joint speeds up as
    hard as it can, as long as it is slower than its top speed. Then the deceleration
    rises from 0 along the ramp and stays, and what swings does so in proportion to the
    speed. A joint with a table of measured stops does what that says instead.

    Args:
        figures: How the robot stops.
        joint_index: The joint's place among the robot's.
        speed: Its true speed when measured, either way [rad/s or m/s].
        period: Time from one cycle to the next [s].
        late: How much later a cycle may come [s].

    Returns:
        The parts. All are NaN when the speed is.

    Raises:
        FiguresError: The period or `late` is negative.

    Example:
        >>> from armguard.robot.named import find_named_robot
        >>> from armguard.robot.stopping import named_figures
        >>> from armguard.robot.urdf import load_urdf
        >>> figures = named_figures("ur5", load_urdf(find_named_robot("ur5").urdf))
        >>> stop = stop_travel(figures, 1, speed=1.0, period=0.008)
        >>> round(stop.reaction, 3), round(stop.braking, 3), round(stop.settle, 3)
        (0.057, 0.486, 0.002)
    """
    if not (period >= 0.0 and late >= 0.0):
        raise FiguresError(
            f"a period of {period} s, late by {late} s: both must be >= 0"
        )
    j = joint_index
    reaction_time = figures.sensing + period + late + figures.command
    reaction, v = speed_up(
        abs(speed),
        float(figures.acceleration[j]),
        float(figures.velocity[j]),
        reaction_time,
    )
    table = figures.table_of(j)
    if table is not None:
        braking_time, braking = table.at(v)
        return StopTravel(reaction, braking, 0.0, reaction_time, braking_time, 0.0, v)
    braking, braking_time = brake_way(v, float(figures.deceleration[j]), figures.ramp)
    settle = float(figures.settle[j]) * v / float(figures.velocity[j])
    times = reaction_time, braking_time, figures.settle_time
    return StopTravel(reaction, braking, settle, *times, v)


def speed_up(
    speed: float, acceleration: float, top: float, time: float
) -> tuple[float, float]:
    """Way of a joint that speeds up to its top speed, and the speed it then has.

    Args:
        speed: Speed at the beginning, >= 0 [rad/s or m/s].
        acceleration: Acceleration [rad/s² or m/s²].
        top: Speed at which it ends; a joint that is faster keeps its speed.
        time: Time [s].

    Returns:
        Way [rad or m] and speed [rad/s or m/s].
    """
    if speed >= top:
        return speed * time, speed
    rising = min(time, (top - speed) / acceleration)
    end = min(top, speed + acceleration * rising)
    if speed != speed:
        end = speed
    return (
        speed * rising + acceleration * rising**2 / 2.0 + end * (time - rising),
        end,
    )


def brake_way(speed: float, deceleration: float, ramp: float) -> tuple[float, float]:
    """Way and time to rest, the deceleration rising from 0 to its full value.

    Args:
        speed: Speed at the beginning, >= 0 [rad/s or m/s].
        deceleration: Full deceleration [rad/s² or m/s²].
        ramp: Time in which it rises [s].

    Returns:
        Way [rad or m] and time [s].
    """
    lost = deceleration * ramp / 2.0
    if speed < lost:
        time = sqrt(2.0 * ramp * speed / deceleration)
        return 2.0 / 3.0 * speed * time, time
    rest = speed - lost
    way = speed * ramp - deceleration * ramp**2 / 6.0
    return way + rest**2 / (2.0 * deceleration), ramp + rest / deceleration
