"""Bounds over boxes hold at every configuration in them."""

import numpy as np
import pytest

from armguard.geometry import Box, Capsule, Cylinder, Hull, PlacedShape, Pose, Sphere
from armguard.prove.pair_tables import SideShapes, pair_tables
from armguard.robot.kinematics import kinematic_table
from armguard.robot.model import Joint, JointKind, Link, Mimic, RobotModel
from worlds import random_pose


def random_robot(rng):
    """Two chains of three joints on one link: turning, sliding and following ones."""
    kinds = [JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.REVOLUTE]
    links, joints = {"root": Link(name="root")}, {}
    for side in "ab":
        above = "root"
        for k in range(3):
            name = f"{side}{k}"
            axis = rng.normal(size=3)
            links[name] = Link(name=name)
            joints[name] = Joint(
                name=name,
                kind=kinds[rng.integers(3)],
                parent=above,
                child=name,
                T_parent_joint=0.5 * random_pose(rng) + 0.5 * np.diag([0, 0, 0, 1.0]),
                axis=axis / np.linalg.norm(axis),
                lower=-1.0,
                upper=1.0,
                mimic=Mimic("a0", -0.7, 0.1) if name == "b1" else None,
            )
            T = joints[name].T_parent_joint
            T[:3, :3] *= 2.0
            above = name
    return RobotModel(name="r", path=None, links=links, joints=joints, root="root")


def random_shapes(rng):
    """One or two shapes, of any kind that links have."""
    corners = rng.uniform(-0.15, 0.15, (12, 3))
    kinds = [
        Sphere(radius=0.1),
        Capsule(start=(-0.1, 0, 0), end=(0.2, 0, 0), radius=0.05),
        Box(size=(0.2, 0.1, 0.04), rounding=0.01),
        Cylinder(radius=0.05, height=0.3),
        Hull(points=corners),
    ]
    return tuple(
        PlacedShape(kinds[k], Pose(xyz=tuple(rng.uniform(-0.1, 0.1, 3))))
        for k in rng.integers(len(kinds), size=rng.integers(1, 3))
    )


@pytest.mark.parametrize("seed", range(12))
def test_no_configuration_in_a_box_breaks_its_bounds(seed):
    rng = np.random.default_rng(seed)
    model = random_robot(rng)
    table = kinematic_table(model)
    sides = [SideShapes(name, (random_shapes(rng),)) for name in ("a2", "b2")]
    tables = pair_tables(model, table, *sides)
    assert tables.joints == ("a0", "a1", "a2", "b0", "b2")
    for width in (0.02, 0.1, 0.4, 1.5):
        centres = rng.uniform(-1.0, 1.0, (20, 5))
        halves = width * rng.random((20, 5))
        bounds = tables.bounds(centres, halves, full=True)
        assert (bounds["lower"] <= bounds["exact_distance"]).all()
        for centre, half, found in zip(centres, halves, bounds, strict=True):
            q = centre + half * rng.uniform(-1.0, 1.0, (100, 5))
            q[::2] = centre + half * rng.choice([-1.0, 1.0], (50, 5))
            gaps = tables.bounds(q, np.zeros_like(q), full=True)["exact_distance"]
            assert (gaps >= found["lower"] - 1e-9).all()
            assert (gaps <= found["upper"] + 1e-9).all()


def test_the_bound_closes_in_by_the_square_of_the_width():
    rng = np.random.default_rng(5)
    model = random_robot(rng)
    sides = [
        SideShapes(name, ((PlacedShape(Sphere(radius=0.01)),),))
        for name in ("a2", "b2")
    ]
    tables = pair_tables(model, kinematic_table(model), *sides)
    centre = np.zeros((1, 5))
    near = tables.bounds(centre, np.full((1, 5), 1e-9), full=True)[0]
    assert near["exact_distance"] > 0.01
    assert abs(near["lower"] - near["exact_distance"]) < 1e-7
