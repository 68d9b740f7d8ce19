"""The oracle itself, on distances anyone can work out."""

import numpy as np
import pytest

from armguard.geometry import Box, Capsule, Pose, Sphere
from oracle import signed_distance

HALF = Box(size=(1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("a", "pose_a", "b", "pose_b", "expected"),
    [
        (Sphere(radius=1.0), Pose(), Sphere(radius=1.0), Pose(xyz=(3, 0, 0)), 1.0),
        (HALF, Pose(), HALF, Pose(xyz=(1.5, 0, 0)), 0.5),
        (HALF, Pose(), HALF, Pose(xyz=(0.8, 0.1, 0)), -0.2),
        (HALF, Pose(), HALF, Pose(xyz=(2, 2, 2)), np.sqrt(3.0)),
        (
            Capsule(start=(0, 0, -1), end=(0, 0, 1), radius=0.1),
            Pose(),
            Capsule(start=(-1, 0, 0), end=(1, 0, 0), radius=0.1),
            Pose(),
            -0.2,
        ),
        (Sphere(radius=0.1), Pose(), HALF, Pose(xyz=(0.4, 0, 0)), -0.2),
    ],
)
def test_the_oracle_knows_closed_forms(a, pose_a, b, pose_b, expected):
    found = signed_distance(a, pose_a.matrix(), b, pose_b.matrix())
    assert found == pytest.approx(expected, abs=1e-8)
