"""Settling: greatest speed of a joint's swing after its stop."""

from math import sqrt

from armguard.kernel import kernel
from armguard.motion.figures import JointFigures, RobotFigures

# A swing is modelled as half a sine that takes at least 0.3 of its longest time: its
# speed is at most this multiple of displacement by time [-].
SWING_SPEED = 10.5

# An unknown greatest deceleration is assumed as this multiple of the least [-].
HARDEST = 10.0


@kernel
def swing_speed(robot: RobotFigures, figures: JointFigures) -> float:
    """Greatest speed of settling, which is no failure to stop [rad/s].

    For the declared swing: by its duration, or by the deceleration that ends it.
    """
    swing = figures.settle
    speed = 0.0
    if robot.settle_time > 0.0:
        speed = SWING_SPEED * swing / robot.settle_time
    return float(max(speed, sqrt(2.0 * hardest_stop(figures) * swing)))


@kernel
def hardest_stop(figures: JointFigures) -> float:
    """Greatest deceleration of a stop, declared or assumed [rad/s²]."""
    return float(min(figures.deceleration_most, HARDEST * figures.deceleration))
