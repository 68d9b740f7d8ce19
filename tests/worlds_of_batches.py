"""Rows, motions and a scene for batches."""

import numpy as np

import armguard as ag
from arms import simple_arm


def random_rows(scene, count, seed=0):
    tables = ag.Guard(scene).tables
    rng = np.random.default_rng(seed)
    return rng.uniform(tables.lower, tables.upper, (count, len(tables.lower)))


def motion_rows(scene, count, length, seed=0):
    """Motions of 40 rows one after another: most spans lie within one."""
    ends = random_rows(scene, 2 * count, seed).reshape(count, 2, 1, -1)
    share = np.linspace(0.0, length, 40)[:, None]
    rows = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    return rows.reshape(-1, ends.shape[-1])


def mixed_scene():
    """An arm between objects of every other kind."""
    scene = ag.Scene(mode="fixed", margin=1.0)
    scene.add_robot(simple_arm(), name="arm")
    shapes = {
        "cylinder": ag.Cylinder(radius=0.1, height=0.3),
        "cone": ag.Cone(radius=0.1, height=0.3),
        "egg": ag.Ellipsoid(semi_axes=(0.1, 0.2, 0.15)),
        "block": ag.Box(size=(0.2, 0.1, 0.3), rounding=0.02),
        "ball": ag.Sphere(radius=0.1),
    }
    for k, (name, shape) in enumerate(shapes.items()):
        angle = 1.2 * k - 1.8
        place = (0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.2 * k)
        scene.add(shape, name=name, pose=ag.Pose(xyz=place))
    scene.add(ag.HalfSpace(), name="floor", pose=ag.Pose(xyz=(0, 0, -0.1)))
    return scene


def motions_of(scene, count, length, seed=0):
    """Starts and ends of motions towards other places, a share of the way there."""
    ends = random_rows(scene, 2 * count, seed).reshape(count, 2, -1)
    return ends[:, 0], ends[:, 0] + length * (ends[:, 1] - ends[:, 0])
