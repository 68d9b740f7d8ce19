"""Planar arms whose answer is known, hollow meshes, budgets and what is kept."""

from dataclasses import replace
from math import cos, inf, pi, sin

import numpy as np
import pytest
import trimesh

from armguard.errors import UnknownNameError
from armguard.geometry import Capsule, Pose, Sphere
from armguard.prove import Budget, audit_srdf, prove_pairs
from armguard.prove.audit import judge
from armguard.robot.model import (
    CollisionElement,
    DisabledPair,
    Joint,
    JointKind,
    Link,
    MeshFile,
    RobotModel,
)
from armguard.scene import Scene
from arms import simple_arm


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr("armguard.prove.store.cache_home", lambda: tmp_path)


def part(name, geometry, xyz=(0.0, 0.0, 0.0)):
    """A link with one shape."""
    T = Pose(xyz=xyz).matrix()
    return Link(
        name=name, collisions=(CollisionElement(geometry=geometry, T_link_geometry=T),)
    )


def turning(name, parent, child, xyz, limit, kind=JointKind.REVOLUTE):
    """A joint about z."""
    return Joint(
        name=name,
        kind=kind,
        parent=parent,
        child=child,
        T_parent_joint=Pose(xyz=xyz).matrix(),
        axis=np.array([0.0, 0.0, 1.0]),
        lower=-limit,
        upper=limit,
    )


def tip_and_post(post, limit=1.0, kind=JointKind.REVOLUTE):
    """Two rods of 1 m in a plane; a ball of 5 cm at the tip, one that is fixed."""
    links = [
        part("base", Sphere(radius=0.05), post),
        part("rod", Capsule(start=(0.3, 0, 0), end=(0.7, 0, 0), radius=0.01)),
        part("tip", Sphere(radius=0.05), (1.0, 0.0, 0.0)),
    ]
    joints = [
        turning("shoulder", "base", "rod", (0, 0, 0), limit, kind),
        turning("elbow", "rod", "tip", (1.0, 0, 0), limit, kind),
    ]
    return RobotModel(
        name="planar",
        path=None,
        links={link.name: link for link in links},
        joints={joint.name: joint for joint in joints},
        root="base",
    )


def robot_of(model, **settings):
    return Scene(mode="fixed").add_robot(model, name="arm", **settings)


# Where the tip is with both joints at their limit, and where it would go beyond.
CORNER = np.array([cos(1.0) + cos(2.0), sin(1.0) + sin(2.0), 0.0])
BEYOND = np.array([-sin(2.0), cos(2.0), 0.0])


def test_a_pair_that_meets_only_in_a_corner_of_the_joint_box_is_found():
    robot = robot_of(tip_and_post(tuple(CORNER + 0.095 * BEYOND)))
    (proof,) = prove_pairs(robot, [("tip", "base")])
    assert proof.verdict == "sometimes"
    assert -0.006 < proof.least < 0.0
    assert proof.touching == pytest.approx({"shoulder": 1.0, "elbow": 1.0}, abs=0.1)


def test_a_pair_kept_apart_by_a_limit_is_proven_apart():
    robot = robot_of(tip_and_post(tuple(CORNER + 0.103 * BEYOND)))
    (proof,) = prove_pairs(robot, [("tip", "base")])
    assert proof.verdict == "never"
    assert proof.least == pytest.approx(0.003, abs=1e-4)
    assert 0.0 < proof.bound <= proof.least
    assert proof.share_left == 0.0
    assert proof.touching is None


def test_stacked_planes_never_meet_and_a_ball_on_its_hub_always_does():
    robot = robot_of(simple_arm())
    assert {p.verdict for p in prove_pairs(robot)} == {"never"}
    hub = tip_and_post((0.0, 0.0, 0.0))
    links = dict(hub.links)
    links["rod"] = part("rod", Sphere(radius=0.03), (0.06, 0.0, 0.0))
    (proof,) = prove_pairs(robot_of(replace(hub, links=links)), [("base", "rod")])
    assert proof.verdict == "always"
    assert proof.least == pytest.approx(-0.02)


def test_a_joint_without_limits_is_looked_at_for_a_whole_turn():
    behind = tip_and_post((-1.99, 0.0, 0.0), limit=inf, kind=JointKind.CONTINUOUS)
    (proof,) = prove_pairs(robot_of(behind), [("base", "tip")])
    assert proof.verdict == "sometimes"
    assert abs(abs(proof.nearest["shoulder"]) - pi) < 0.2


def hook_arm(tmp_path):
    """A turning half ring, and a pin that enters its hollow without touching it."""
    ring = trimesh.creation.annulus(r_min=0.3, r_max=0.32, height=0.1)
    half = ring.submesh([ring.triangles_center[:, 0] > 0.0], append=True)
    path = tmp_path / "hook.stl"
    half.export(path)
    links = [
        part("base", Sphere(radius=0.03), (0.2, 0.0, 0.0)),
        part("hook", MeshFile(path)),
    ]
    return RobotModel(
        name="hook",
        path=None,
        links={link.name: link for link in links},
        joints={"turn": turning("turn", "base", "hook", (0.0, 0.0, 0.0), 3.0)},
        root="base",
    )


def test_a_pin_in_the_hollow_of_a_mesh_is_proven_apart(tmp_path):
    robot = robot_of(hook_arm(tmp_path), fit_target=0.5, max_primitives=1)
    (proof,) = prove_pairs(robot, [("base", "hook")])
    assert proof.verdict == "never"
    # The mesh is a polygon: its flats come nearer than its corners.
    assert 0.0 < proof.least <= 0.07


def test_a_second_proof_is_read_and_a_greater_budget_searches_again(monkeypatch):
    robot = robot_of(simple_arm())
    first = prove_pairs(robot)
    monkeypatch.setattr("armguard.prove.pairs.PairSearch", None)
    assert prove_pairs(robot) == first
    assert prove_pairs(robot, budget=Budget(seconds=600.0)) == first
    other = replace(simple_arm(), name="other")
    assert prove_pairs(robot_of(other)) == first
    joints = dict(other.joints)
    joints["joint2"] = replace(joints["joint2"], upper=2.5)
    with pytest.raises(TypeError):
        prove_pairs(robot_of(replace(other, joints=joints)))


def test_what_the_budget_does_not_pay_for_stays_open_and_is_tried_again():
    robot = robot_of(tip_and_post((1.0, 1.0, 0.1001), limit=3.0))
    small = Budget(seconds=10.0, boxes=1)
    (proof,) = prove_pairs(robot, [("base", "tip")], budget=small)
    assert proof.verdict == "open"
    assert 0.0 < proof.share_left <= 1.0
    assert proof.bound < proof.least
    (proof,) = prove_pairs(robot, [("base", "tip")])
    assert proof.verdict == "never"
    (proof,) = prove_pairs(robot, [("base", "rod")], budget=Budget(seconds=0.0))
    assert proof.verdict in ("open", "never")


def test_progress_is_reported_and_an_unknown_link_is_an_error():
    robot = robot_of(simple_arm())
    reported = []
    prove_pairs(robot, progress=lambda *words: reported.append(words))
    assert reported[-1][1:] == (3, 3)
    with pytest.raises(UnknownNameError, match="did you mean 'link1'"):
        prove_pairs(robot, [("link1", "lnk1")])


def test_rows_are_judged_by_what_the_file_says():
    model = tip_and_post(tuple(CORNER))
    rows = [
        DisabledPair("base", "tip", "x.srdf: Never"),
        DisabledPair("tip", "base", "x.srdf: Always"),
        DisabledPair("base", "tip", "x.srdf: User"),
        DisabledPair("base", "rod", "x.srdf: Never"),
    ]
    robot = robot_of(replace(model, disabled_pairs=tuple(rows)))
    audits = audit_srdf(robot)
    assert [a.status for a in audits] == [
        "contradicted",
        "contradicted",
        "sometimes",
        "proved",
    ]
    assert audits[0].contradiction == audits[0].proof.nearest
    assert audits[1].contradiction == audits[1].proof.farthest
    assert audits[3].contradiction is None
    always = replace(audits[0].proof, verdict="always", greatest=-0.1)
    assert judge("never", always) == "contradicted"
    assert judge("adjacent", always) == "proved"
    assert judge("always", always) == "proved"
    assert judge("never", replace(audits[3].proof, verdict="open")) == "open"
