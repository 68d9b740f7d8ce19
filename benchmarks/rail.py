"""A robot of one joint, which slides along a rail."""

import numpy as np

from armguard.geometry import Shape
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel


def carriage(shape: Shape | None, limit: float) -> RobotModel:
    """A shape that slides along x, by up to a limit to either side [m].

    Args:
        shape: The shape, its origin on the rail; nothing that can be hit if None.
        limit: How far it goes [m].
    """
    own = (
        ()
        if shape is None
        else (CollisionElement(geometry=shape, T_link_geometry=np.eye(4)),)
    )
    joint = Joint(
        name="tool",
        kind=JointKind.PRISMATIC,
        parent="base",
        child="hand",
        T_parent_joint=np.eye(4),
        axis=np.array([1.0, 0.0, 0.0]),
        lower=-limit,
        upper=limit,
    )
    links = {"base": Link(name="base"), "hand": Link(name="hand", collisions=own)}
    return RobotModel(
        name="carriage", path=None, links=links, joints={"tool": joint}, root="base"
    )
