"""Declared stopping figures of joints and robots, as a cycle reads them."""

from armguard.record import record


@record
class JointFigures:
    """Stopping figures of a joint, in its own unit; see `StoppingFigures`.

    Attributes:
        velocity: Top speed [rad/s or m/s].
        acceleration: Greatest acceleration by a command [rad/s² or m/s²].
        deceleration: Least deceleration of a stop [rad/s² or m/s²].
        deceleration_most: Greatest deceleration of a stop; may be infinite
            [rad/s² or m/s²].
        settle: Swing after a stop from top speed [rad or m].
        brake_deceleration: Least deceleration of a brake [rad/s² or m/s²].
        position_error: Greatest error of a measured position [rad or m].
        velocity_error: Greatest error of a measured velocity [rad/s or m/s].
        tracking_error: Greatest deviation from the pending commands [rad/s or m/s].
        led_beyond: Greatest position beyond a limit under the guard [rad or m].
        swing_share: `settle` by `velocity` [s].
        speed_up_way: Twice the displacement per squared speed at which it speeds up
            [s²/rad].
        return_way: The same for speeding up and the hardest stop after it [s²/rad].
        curve: 1 if a table of measured stops replaces the formula.
    """

    velocity: float
    acceleration: float
    deceleration: float
    deceleration_most: float
    settle: float
    brake_deceleration: float
    position_error: float
    velocity_error: float
    tracking_error: float
    led_beyond: float
    swing_share: float
    speed_up_way: float
    return_way: float
    curve: int


@record
class RobotFigures:
    """Stopping figures of a robot; see `StoppingFigures`.

    Attributes:
        mode: FIXED, SPEED or PATH.
        first_joint: First place of its joints in q.
        joint_count: Number of its joints.
        ramp: Time until the deceleration of a stop is full [s].
        settle_time: Greatest duration of its swing after a stop [s].
        brake_delay: Time until a brake takes effect [s].
        sensing: Greatest delay of a measurement [s].
        command: Greatest delay of a command [s].
        stale: Age from which a measurement is refused [s].
        model_error: Greatest error of the shapes of its links [m].
        base_error: Greatest error of its base's position [m].
        base_turn: Greatest error of its base's orientation [rad].
    """

    mode: int
    first_joint: int
    joint_count: int
    ramp: float
    settle_time: float
    brake_delay: float
    sensing: float
    command: float
    stale: float
    model_error: float
    base_error: float
    base_turn: float


# Modes of a robot's required separation.
FIXED = 0
SPEED = 1
PATH = 2

# Points of a curve of measured stops: speeds from 0 to the top one, evenly spaced.
CURVE_POINTS = 17
