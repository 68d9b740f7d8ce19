"""Robots of a few joints, made without a file."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armguard.geometry import Pose, Shape
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel


def slider(
    name: str, parent: str, child: str, axis: Sequence[float], **own: Any
) -> Joint:
    """A joint that slides, see `joint`."""
    return joint(name, JointKind.PRISMATIC, parent, child, axis, **own)


def joint(
    name: str,
    kind: JointKind,
    parent: str,
    child: str,
    axis: Sequence[float],
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0),
    **limits: Any,
) -> Joint:
    """A joint whose frame is at a place of its parent's, and not turned [m]."""
    return Joint(
        name=name,
        kind=kind,
        parent=parent,
        child=child,
        T_parent_joint=Pose(xyz=xyz).matrix(),
        axis=np.array(axis, dtype=float),
        **limits,
    )


def robot_of(
    name: str,
    joints: Sequence[Joint],
    shapes: Mapping[str, Shape],
    at: Pose | None = None,
) -> RobotModel:
    """A robot whose base is the parent of its first joint.

    Args:
        name: Its name.
        joints: Its joints, from the base on.
        shapes: Shapes of links, by the link's name.
        at: Where they are in the frames of their links, at the origin if None.
    """
    frame = (at or Pose()).matrix()
    links = {
        link: Link(
            name=link,
            collisions=tuple(
                CollisionElement(geometry=shape, T_link_geometry=frame)
                for owner, shape in shapes.items()
                if owner == link
            ),
        )
        for link in (joints[0].parent, *(j.child for j in joints))
    }
    by_name = {j.name: j for j in joints}
    root = joints[0].parent
    return RobotModel(name=name, path=None, links=links, joints=by_name, root=root)


def carriage(shape: Shape | None, limit: float) -> RobotModel:
    """A shape that slides along x, by up to a limit to either side [m].

    Args:
        shape: The shape, its origin on the rail; nothing that can be hit if None.
        limit: How far it goes [m].
    """
    tool = slider("tool", "base", "hand", (1, 0, 0), lower=-limit, upper=limit)
    return robot_of("carriage", [tool], {} if shape is None else {"hand": shape})
