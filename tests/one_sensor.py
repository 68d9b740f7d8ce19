"""A scene of one sensor, and of a ball on a slide beside it."""

import numpy as np

import armguard as ag
from armguard.geometry import Sphere
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene
from sliding import EXACT

CELL, SIZE = 0.02, 64
CENTRE = (0.5, 0.0, 0.0)

# The sensor looks along x.
POSE = ag.Pose(rpy=(0.0, np.pi / 2, 0.0))


def slide(travel=0.01):
    """A ball that slides along x."""
    ball = CollisionElement(
        geometry=Sphere(radius=0.02), T_link_geometry=ag.Pose().matrix()
    )
    joint = Joint(
        name="joint", kind=JointKind.PRISMATIC, parent="base", child="tip",
        T_parent_joint=ag.Pose().matrix(), axis=np.array([1.0, 0.0, 0.0]),
        lower=0.0, upper=travel,
    )  # fmt: skip
    links = {"base": Link(name="base"), "tip": Link(name="tip", collisions=(ball,))}
    return RobotModel(
        name="slide", path=None, links=links, joints={"joint": joint}, root="base"
    )


def one_sensor(kind, unknown="still", least=0.05, **settings):
    """A scene of a sensor at the origin; the ball is aside."""
    scene = Scene(mode="path", period=0.01)
    scene.add_robot(slide(), "arm", base=ag.Pose(xyz=(-0.1, 0.5, 0.5)), stopping=EXACT)
    scene.set_sensing(
        region={"centre": CENTRE, "size": SIZE}, cell=CELL, unknown=unknown,
        intruder={"speed": 1.6, "size": least},
    )  # fmt: skip
    scene.add_sensor("eye", kind=kind, **{"pose": POSE, **settings})
    return scene


def at_rest(scene):
    """Its sensors after two seconds at rest."""
    sense = ag.Sense(scene)
    for k in range(200):
        sense.joints(scene.home, 0.01 * k)
    return sense
