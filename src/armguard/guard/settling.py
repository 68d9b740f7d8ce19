"""Settling: how fast a joint may swing after its stop."""

from math import sqrt

from armguard.kernel import kernel
from armguard.motion.figures import JointFigures, RobotFigures

# A swing is thought to be half a sine that takes no less than 0.3 of its longest time:
# its speed is no more than this times way by time [-].
SWING_SPEED = 10.5

# An unknown greatest deceleration is thought to be this many times the least [-].
HARDEST = 10.0


@kernel
def swing_speed(robot: RobotFigures, figures: JointFigures) -> float:
    """Speed that settling may have, which is no failure to stop [rad/s].

    Of a swing of a given way, by the time it takes, or by the deceleration that ends
    it.
    """
    swing = figures.settle
    speed = 0.0
    if robot.settle_time > 0.0:
        speed = SWING_SPEED * swing / robot.settle_time
    return float(max(speed, sqrt(2.0 * hardest_stop(figures) * swing)))


@kernel
def hardest_stop(figures: JointFigures) -> float:
    """Greatest deceleration of a stop, as far as one is known [rad/s²]."""
    return float(min(figures.deceleration_most, HARDEST * figures.deceleration))
