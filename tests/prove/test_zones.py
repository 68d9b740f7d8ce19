"""Zones that no posture trips, before plain geometry on sampled postures."""

from math import cos, pi, sin, tan

import numpy as np
import pytest

from armguard.geometry import Pose, Sphere
from armguard.prove import Budget, prove_zones
from armguard.prove.zones import Block, zone_hull
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene

RADIUS, REACH = 0.05, 0.3
SENSOR = {"on": "arm/base", "range": (0.02, 1.0), "error": 0.0}


def ball_on_a_rod(limit):
    """A ball of 5 cm that a joint about z leads round the base, 0.3 m away."""
    ball = CollisionElement(
        geometry=Sphere(radius=RADIUS),
        T_link_geometry=Pose(xyz=(REACH, 0, 0)).matrix(),
    )
    joint = Joint(
        name="turn",
        kind=JointKind.REVOLUTE,
        parent="base",
        child="rod",
        T_parent_joint=Pose().matrix(),
        axis=np.array([0.0, 0.0, 1.0]),
        lower=-limit,
        upper=limit,
    )
    return RobotModel(
        name="ball",
        path=None,
        links={
            "base": Link(name="base"),
            "rod": Link(name="rod", collisions=(ball,)),
        },
        joints={"turn": joint},
        root="base",
    )


def looking_along_x(limit, **settings):
    """A robot whose base has a sensor in its middle, which looks along x."""
    scene = Scene(mode="fixed")
    robot = scene.add_robot(ball_on_a_rod(limit), name="arm")
    # z of the sensor is x of the base, its columns run along -y, its rows along -z.
    R = Pose(rpy=(-pi / 2, 0, -pi / 2))
    return robot, *scene.add_sensor("eye", pose=R, **{**SENSOR, **settings})


def visible(q, zones, view, distance, least=0.02):
    """Zones in which rays of a grid hit the ball nearer than the threshold."""
    columns, rows = zones
    found = set()
    centre = np.array([REACH * cos(q), REACH * sin(q), 0.0])
    for k in range(columns * rows):
        row, column = divmod(k, columns)
        a = view[0] * ((column + np.linspace(0.02, 0.98, 9)) / columns - 0.5)
        b = view[1] * ((row + np.linspace(0.02, 0.98, 9)) / rows - 0.5)
        x, y = np.meshgrid(np.tan(a), np.tan(b))
        ray = np.stack([np.ones_like(x), -x, -y], axis=-1).reshape(-1, 3)
        length = np.linalg.norm(ray, axis=1)
        ray = ray / length[:, None]
        along = ray @ centre
        miss = along**2 - centre @ centre + RADIUS**2
        hit = along - np.sqrt(np.maximum(miss, 0.0))
        # Along the axis of the sensor, as most sensors of this kind report it.
        depth = hit / length
        if ((miss > 0.0) & (depth > least) & (depth < distance)).any():
            found.add(k)
    return found


@pytest.mark.parametrize("limit", [0.3, 1.2])
def test_zones_that_are_not_masked_are_tripped_by_no_posture(limit):
    zones, view = (8, 4), (1.4, 0.7)
    robot, sensor = looking_along_x(limit, zones=zones, view=view)
    proof = prove_zones(robot, sensor, 0.29, budget=Budget(seconds=60.0))
    tripped = set()
    for q in np.linspace(-limit, limit, 601):
        tripped |= visible(q, zones, view, 0.29)
    assert tripped <= set(proof.masked)
    assert {why.why for why in proof.masked.values()} == {"trips"}
    # No more than the zones beside them, which a ray of no width may miss.
    assert len(proof.masked) <= len(tripped) + 4
    for zone in tripped:
        q = proof.masked[zone].posture["turn"]
        assert -limit <= q <= limit and proof.masked[zone].link == "rod"


def test_a_threshold_before_the_arm_leaves_every_zone_proven():
    robot, sensor = looking_along_x(1.0)
    # The ball begins at 0.25 m from the base; along the axis of the view that is less.
    distance = 0.25 * cos(0.5 * 0.785) ** 2 - 0.001
    proof = prove_zones(robot, sensor, distance)
    assert not proof.masked and proof.count == 64
    # All zones at once.
    assert proof.searches == 1
    assert prove_zones(robot, sensor, 0.26).masked


def test_the_declared_error_is_kept():
    distance = 0.25 * cos(0.5 * 0.785) ** 2 - 0.001
    robot, sensor = looking_along_x(1.0, error=0.05)
    assert prove_zones(robot, sensor, distance).masked


def test_a_spent_budget_masks_all_that_is_left():
    robot, sensor = looking_along_x(1.0)
    proof = prove_zones(robot, sensor, 0.1, budget=Budget(seconds=0.0))
    assert len(proof.masked) == 64
    assert {why.why for why in proof.masked.values()} == {"open"}


def test_the_frustum_holds_what_a_ray_or_the_axis_measures():
    _, sensor = looking_along_x(1.0, view=(1.5, 1.0), zones=(3, 2), error=0.03)
    assert zone_hull(sensor, 0.17, Block(0, 2, 0, 3)).shape.rounding == 0.03
    _, sensor = looking_along_x(1.0, view=(1.5, 1.0), zones=(3, 2))
    hull = zone_hull(sensor, 0.2, Block(0, 2, 0, 3)).shape
    points = np.asarray(hull.points)
    half = 0.2 * tan(0.75), 0.2 * tan(0.5)
    assert np.abs(points[:, 0]).max() == pytest.approx(half[0])
    assert np.abs(points[:, 1]).max() == pytest.approx(half[1])
    assert points[:, 2].max() == pytest.approx(0.2)
    # Of a point at the least distance along the outermost ray.
    assert points[:, 2].min() <= 0.02 * cos(0.75) * cos(0.5) + 1e-12
