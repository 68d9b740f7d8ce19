"""Three axes with a hand that looks down, and two fingers that slide along y."""

from armguard.geometry import Box
from armguard.robot.model import RobotModel
from robots import robot_of, slider

# How it stops, how late it is, and by how much it misses commands [SI].
FIGURES = {
    "deceleration": 4.0,
    "acceleration": 8.0,
    "deceleration_most": 8.0,
    "velocity": 1.0,
    "sensing": 0.002,
    "command": 0.003,
    "stale": 0.05,
    "tracking_error": 0.002,
    "position_error": 1e-5,
}

# Half of the sizes of hand and finger [m].
HAND = (0.03, 0.08, 0.03)
FINGER = (0.01, 0.006, 0.03)

# The fingers' frames are this far below the hand's [m].
BELOW = 0.06

# Where a finger's frame is off the middle at joint position 0 [m].
CLOSED = 0.006

# Fingers open this far [m].
WIDEST = 0.05


def gantry() -> RobotModel:
    """The robot."""
    far = {"lower": -1.0, "upper": 1.0}
    opens = {"lower": 0.0, "upper": WIDEST}
    left, right = (0.0, CLOSED, -BELOW), (0.0, -CLOSED, -BELOW)
    joints = [
        slider("x", "base", "bridge", (1, 0, 0), **far),
        slider("y", "bridge", "trolley", (0, 1, 0), **far),
        slider("z", "trolley", "hand", (0, 0, 1), lower=0.0, upper=1.0),
        slider("open_left", "hand", "left", (0, 1, 0), **opens, xyz=left),
        slider("open_right", "hand", "right", (0, -1, 0), **opens, xyz=right),
    ]
    halves = {"hand": HAND, "left": FINGER, "right": FINGER}
    boxes = {
        link: Box(size=tuple(2 * h for h in half)) for link, half in halves.items()
    }
    return robot_of("gantry", joints, boxes)
