"""Three axes with a hand that looks down, and two fingers that slide along y."""

import numpy as np

from armguard.geometry import Box, Pose
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel

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


def slider(name, parent, child, axis, lower, upper, xyz=(0.0, 0.0, 0.0)):
    """A joint that slides."""
    return Joint(
        name=name,
        kind=JointKind.PRISMATIC,
        parent=parent,
        child=child,
        T_parent_joint=Pose(xyz=xyz).matrix(),
        axis=np.array(axis, dtype=float),
        lower=lower,
        upper=upper,
    )


def boxed(name, half):
    """A link that is a box."""
    element = CollisionElement(
        geometry=Box(half_extents=half), T_link_geometry=np.eye(4)
    )
    return Link(name=name, collisions=(element,))


def gantry():
    """The robot."""
    links = {
        "base": Link(name="base"),
        "bridge": Link(name="bridge"),
        "trolley": Link(name="trolley"),
        "hand": boxed("hand", HAND),
        "left": boxed("left", FINGER),
        "right": boxed("right", FINGER),
    }
    left, right = (0, CLOSED, -BELOW), (0, -CLOSED, -BELOW)
    joints = {
        "x": slider("x", "base", "bridge", (1, 0, 0), -1.0, 1.0),
        "y": slider("y", "bridge", "trolley", (0, 1, 0), -1.0, 1.0),
        "z": slider("z", "trolley", "hand", (0, 0, 1), 0.0, 1.0),
        "open_left": slider("open_left", "hand", "left", (0, 1, 0), 0.0, WIDEST, left),
        "open_right": slider(
            "open_right", "hand", "right", (0, -1, 0), 0.0, WIDEST, right
        ),
    }
    return RobotModel(name="gantry", path=None, links=links, joints=joints, root="base")
