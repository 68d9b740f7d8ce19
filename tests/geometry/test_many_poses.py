"""`distance` and `distances`: many poses at once, and poses that are none."""

import numpy as np
import pytest

from armguard.errors import PoseError
from armguard.geometry import Pose, ShapeKind, Sphere, distance, distances
from worlds import random_pose, random_shape

KINDS = [k for k in ShapeKind if k != ShapeKind.SUPPORT]


def poses(rng, count):
    return np.stack([random_pose(rng) for _ in range(count)])


@pytest.mark.parametrize("kind_a", KINDS)
@pytest.mark.parametrize("kind_b", KINDS)
def test_many_answers_have_the_bits_of_single_ones(kind_a, kind_b):
    rng = np.random.default_rng((int(kind_a), int(kind_b)))
    a, b = random_shape(rng, kind_a, 0.4), random_shape(rng, kind_b, 0.4)
    T_a, T_b = poses(rng, 5), poses(rng, 5)
    both = distances(a, T_a, b, T_b)
    one = distances(a, T_a[0], b, T_b)
    assert len(both) == len(one) == 5
    for k in range(5):
        for many, first in ((both, T_a[k]), (one, T_a[0])):
            alone = distance(a, first, b, T_b[k])
            for name in ("distance", "point_a", "point_b", "normal"):
                theirs = np.asarray(getattr(alone, name))
                assert np.asarray(getattr(many[k], name)).tobytes() == theirs.tobytes()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_no_number_has_no_distance(kind, bad):
    rng = np.random.default_rng(int(kind))
    shape, ball = random_shape(rng, kind, 0.4), Sphere(radius=0.1)
    for row in range(3):
        for column in range(4):
            T = poses(rng, 3)
            T[1, row, column] = bad
            found = distances(shape, T, ball, Pose())
            assert np.isnan(found.distance).tolist() == [False, True, False]
            assert np.isnan(distance(ball, Pose(), shape, T[1]).distance)


def test_what_is_no_pose_is_refused():
    ball = Sphere(radius=0.1)
    skewed = np.stack([np.eye(4), np.diag([1.0, 1.0, 2.0, 1.0])])
    with pytest.raises(PoseError, match=r"poses_b\[1\] is no rigid transform"):
        distances(ball, Pose(), ball, skewed)
    with pytest.raises(PoseError, match=r"shape \(3,\)"):
        distances(ball, Pose(), ball, np.zeros(3))
    eyes = np.stack([np.eye(4)] * 3)
    with pytest.raises(PoseError, match="3 poses of A and 2 of B"):
        distances(ball, eyes, ball, eyes[:2])
    with pytest.raises(PoseError, match="there are 3 poses"):
        distance(ball, eyes, ball, Pose())


def test_no_poses_have_no_answers():
    ball = Sphere(radius=0.1)
    found = distances(ball, np.zeros((0, 4, 4)), ball, Pose())
    assert len(found) == 0
    assert found.normal.shape == (0, 3)
