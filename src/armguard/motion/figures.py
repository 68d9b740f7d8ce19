"""Places of the declared figures in the flat rows a cycle reads."""

# A row for each joint.
VELOCITY = 0  # top speed [rad/s or m/s]
ACCELERATION = 1  # greatest a command can cause [rad/s² or m/s²]
DECELERATION = 2  # least of a stop [rad/s² or m/s²]
DECELERATION_MOST = 3  # greatest of a stop; may be infinite
SETTLE = 4  # swing after a stop from top speed [rad or m]
BRAKE_DECELERATION = 5  # least of a brake
POSITION_ERROR = 6  # [rad or m]
VELOCITY_ERROR = 7  # [rad/s or m/s]
CURVE = 8  # 1 where a table of measured stops takes the place of the formula
TRACKING = 9  # how far a velocity may miss the commanded ones [rad/s or m/s]
LED_BEYOND = 10  # how far beyond a limit it may be where the guard leads it [rad or m]
JOINT_FIGURES = 11

# A row for each robot.
MODE = 0  # FIXED, SPEED or PATH
RAMP = 1  # time until a stop's deceleration is full [s]
SETTLE_TIME = 2  # [s]
BRAKE_DELAY = 3  # [s]
SENSING = 4  # greatest delay of a measurement [s]
COMMAND = 5  # greatest delay of an order [s]
STALE = 6  # age from which on a measurement is refused [s]
MODEL_ERROR = 7  # [m]
BASE_ERROR = 8  # [m]
BASE_TURN = 9  # [rad]
FIRST_JOINT = 10  # its first place in q
JOINT_COUNT = 11
ROBOT_FIGURES = 12

# Modes of a robot's buffer.
FIXED = 0
SPEED = 1
PATH = 2

# Measured stops as a curve: this many speeds from 0 to the top one, evenly spaced.
CURVE_POINTS = 17
