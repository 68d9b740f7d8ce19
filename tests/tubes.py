"""Tubes for tests, and a scene for them."""

import numpy as np

import armguard as ag
from armguard.prove.tube import Tube
from arms import simple_arm


def arm_among_objects(buffer=0.01, apart=0.9):
    """Two arms of capsules beside each other, with a wall, a ball and a wire."""
    scene = ag.Scene(mode="fixed", buffer=buffer)
    scene.add_robot(simple_arm(), name="left")
    scene.add_robot(simple_arm(), name="right", base=ag.Pose(xyz=(apart, 0, 0.02)))
    rod = ag.Capsule(start=(0, 0, -1), end=(0, 0, 1), radius=0.001)
    for name, shape, place in (
        ("wall", ag.Box(size=(4.0, 0.2, 2.0)), (0, 0.75, 0.5)),
        ("ball", ag.Sphere(radius=0.1), (0.4, -0.5, 0.4)),
        ("wire", rod, (0.5, 0.4, 0)),
    ):
        scene.add(shape, name=name, pose=ag.Pose(xyz=place))
    return scene


def random_tube(joints, degree, segments, seed, size=0.8):
    """Continuous curves of some degree through random control points."""
    rng = np.random.default_rng(seed)
    knots = rng.uniform(-size, size, (segments + 1, 1, joints))
    share = np.linspace(0.0, 1.0, degree + 1)[None, :, None]
    control = knots[:-1] + share * (knots[1:] - knots[:-1])
    control[:, 1:-1] += rng.uniform(-0.3, 0.3, control[:, 1:-1].shape)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.2, 0.6, segments))))
    return Tube(times, np.ascontiguousarray(control), np.zeros((segments, joints)))
