"""The declared figures of joints and robots, as a cycle reads them."""

from armguard.record import record


@record
class JointFigures:
    """Figures of a joint, in its own unit; see `StoppingFigures`.

    Attributes:
        velocity: Top speed [rad/s or m/s].
        acceleration: Greatest a command can cause [rad/s² or m/s²].
        deceleration: Least of a stop [rad/s² or m/s²].
        deceleration_most: Greatest of a stop; may be infinite [rad/s² or m/s²].
        settle: Swing after a stop from top speed [rad or m].
        brake_deceleration: Least of a brake [rad/s² or m/s²].
        position_error: Of its measurement [rad or m].
        velocity_error: Of its measurement [rad/s or m/s].
        tracking_error: How far a velocity may miss the commanded ones [rad/s or m/s].
        led_beyond: How far beyond a limit the guard may lead it [rad or m].
        curve: 1 where a table of measured stops takes the place of the formula.
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
    curve: int


@record
class RobotFigures:
    """Figures of a robot; see `StoppingFigures`.

    Attributes:
        mode: FIXED, SPEED or PATH.
        first_joint: Its first place in q.
        joint_count: How many joints it has.
        ramp: Time until a stop's deceleration is full [s].
        settle_time: Longest time it swings about its rest [s].
        brake_delay: Time until a brake takes effect [s].
        sensing: Greatest delay of a measurement [s].
        command: Greatest delay of an order [s].
        stale: Age from which on a measurement is refused [s].
        model_error: Of its links' shapes [m].
        base_error: Of its base's position [m].
        base_turn: Of its base's orientation [rad].
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


# Modes of a robot's buffer.
FIXED = 0
SPEED = 1
PATH = 2

# Measured stops as a curve: this many speeds from 0 to the top one, evenly spaced.
CURVE_POINTS = 17
