"""Forward kinematics against Pinocchio, on real robots and on odd ones."""

import numpy as np
import pinocchio as pin
import pytest

from armguard.robot import find_named_robot, load_urdf
from armguard.robot.kinematics import (
    concatenate,
    forward_kinematics,
    kinematic_table,
    reach_bounds,
)
from armguard.robot.limits import joint_limits

ODD = """<robot name="odd">
<link name="a"/><link name="b"><collision><geometry><sphere radius="0.1"/></geometry>
</collision></link><link name="c"/><link name="d"/><link name="e"/>
<joint name="j1" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/><axis xyz="1 2 -1"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="j2" type="prismatic"><parent link="b"/><child link="c"/>
<origin xyz="0 0.1 0" rpy="0 1 0"/><axis xyz="0 1 1"/>
<limit lower="-0.3" upper="0.5" effort="1" velocity="1"/></joint>
<joint name="f" type="fixed"><parent link="c"/><child link="d"/>
<origin xyz="0 0 0.2" rpy="0.1 0 0"/></joint>
<joint name="j3" type="revolute"><parent link="d"/><child link="e"/>
<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="1"/>
<mimic joint="j1" multiplier="-2" offset="0.3"/></joint>
</robot>"""


def bodies(table, q):
    T = np.zeros((len(table.parent), 12))
    forward_kinematics(
        q,
        table.parent,
        table.joint_kind,
        table.q_index,
        table.gain,
        table.T_parent_joint,
        table.axis,
        T,
    )
    return T


def link_pose(table, T, link):
    pose = np.eye(4)
    pose[:3] = T[table.body_of_link[link]].reshape(3, 4)
    return pose @ table.T_body_link[link]


def pinocchio_q(model, names, q):
    """Pinocchio writes a continuous joint as cosine and sine."""
    out = pin.neutral(model)
    for name, value in zip(names, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            out[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            out[joint.idx_q] = value
    return out


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7", "kinova", "baxter", "odd"])
def test_link_poses_are_pinocchios(name, tmp_path):
    if name == "odd":
        urdf = tmp_path / "odd.urdf"
        urdf.write_text(ODD)
    else:
        urdf = find_named_robot(name).urdf
    model = load_urdf(urdf)
    table = kinematic_table(model)
    theirs = pin.buildModelFromUrdf(str(urdf), True)
    data = theirs.createData()
    low, high = (np.clip(v, -4, 4) for v in joint_limits(model))
    rng = np.random.default_rng(0)
    for _ in range(100):
        q = rng.uniform(low, high)
        T = bodies(table, q)
        pin.framesForwardKinematics(theirs, data, pinocchio_q(theirs, model.q_names, q))
        for link in model.links:
            frame = data.oMf[theirs.getFrameId(link, pin.BODY)].homogeneous
            assert link_pose(table, T, link) == pytest.approx(frame, abs=1e-12)


def test_robots_side_by_side_stand_on_their_bases():
    model = load_urdf(find_named_robot("panda").urdf)
    table = kinematic_table(model)
    base = np.eye(4)
    base[:3, 3] = (0.0, 2.0, 0.5)
    both = concatenate([table, table], [np.eye(4), base])
    q = np.random.default_rng(1).uniform(-1, 1, 16)
    T = bodies(both, q)
    count = len(table.parent)
    assert T[:count] == pytest.approx(bodies(table, q[:8]), abs=1e-15)
    alone = bodies(table, q[8:]).reshape(-1, 3, 4)
    assert T[count:].reshape(-1, 3, 4)[:, :, :3] == pytest.approx(alone[:, :, :3])
    moved = alone[:, :, 3] + base[:3, 3]
    assert T[count:].reshape(-1, 3, 4)[:, :, 3] == pytest.approx(moved)


def test_the_same_angles_give_the_same_bits():
    table = kinematic_table(load_urdf(find_named_robot("panda").urdf))
    rng = np.random.default_rng(2)
    q = rng.uniform(-2, 2, 8)
    first = bodies(table, q).tobytes()
    for _ in range(100):
        bodies(table, rng.uniform(-2, 2, 8))
    assert bodies(table, q).tobytes() == first


@pytest.mark.parametrize("name", ["panda", "baxter", "kinova"])
def test_no_body_leaves_its_reach(name):
    model = load_urdf(find_named_robot(name).urdf)
    table = kinematic_table(model)
    limits = joint_limits(model)
    reach = reach_bounds(table, *limits)
    low, high = (np.clip(v, -7, 7) for v in limits)
    for q in np.random.default_rng(3).uniform(low, high, (500, len(low))):
        away = np.linalg.norm(bodies(table, q)[:, [3, 7, 11]], axis=1)
        assert (away <= reach + 1e-12).all()
