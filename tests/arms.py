"""Small robots and scenes for tests, built in memory."""

import numpy as np

from armguard.geometry import Box, Capsule, Pose
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene

# A file of an arm that turns and lifts.
TURN_AND_LIFT = """<robot name="r">
 <link name="base"><collision><origin xyz="0 1.5 0"/>
  <geometry><sphere radius="0.3"/></geometry></collision></link>
 <link name="rod"><collision><origin xyz="0.5 0 0"/>
  <geometry><sphere radius="0.1"/></geometry></collision></link>
 <link name="tip"><collision><origin xyz="0.8 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="0.1" upper="2" effort="1" velocity="1"/></joint>
 <joint name="lift" type="prismatic"><parent link="rod"/><child link="tip"/>
  <origin xyz="1 0 0"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="0.4" effort="1" velocity="0.3"/></joint>
</robot>"""


def simple_arm(joints=3, length=0.4, radius=0.04):
    """A planar arm: capsules that turn about z, stacked 0.2 m apart so none overlap."""
    links, chain = {"base": Link(name="base")}, {}
    above = "base"
    for k in range(joints):
        name = f"link{k + 1}"
        shape = Capsule(start=(0.1, 0, 0), end=(length, 0, 0), radius=radius)
        links[name] = Link(
            name=name,
            collisions=(CollisionElement(geometry=shape, T_link_geometry=np.eye(4)),),
        )
        chain[f"joint{k + 1}"] = Joint(
            name=f"joint{k + 1}",
            kind=JointKind.REVOLUTE,
            parent=above,
            child=name,
            T_parent_joint=Pose(xyz=(0.0 if k == 0 else length, 0, 0.2)).matrix(),
            axis=np.array([0.0, 0.0, 1.0]),
            lower=-2.0,
            upper=2.0,
        )
        above = name
    return RobotModel(name="arm", path=None, links=links, joints=chain, root="base")


def wall_scene(**settings):
    """One arm, and a wall whose face is at y = 0.5; the mode is "fixed"."""
    scene = Scene(**{"mode": "fixed", **settings})
    scene.add_robot(simple_arm(), name="arm")
    scene.add(Box(size=(4.0, 0.2, 2.0)), name="wall", pose=Pose(xyz=(0, 0.6, 0.5)))
    return scene


def link_pose(model, positions, link):
    """Pose of a link in the robot's frame: the chain, joint by joint."""
    by_child = {joint.child: joint for joint in model.joints.values()}
    T = np.eye(4)
    while link in by_child:
        joint = by_child[link]
        turn = np.eye(4)
        if joint.name in positions:
            x, y, z = joint.axis
            angle = positions[joint.name]
            K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            turn[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
        T = joint.T_parent_joint @ turn @ T
        link = joint.parent
    return T
