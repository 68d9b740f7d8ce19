"""Rays and points beside primitives, each alone, and derivatives by differences."""

import numpy as np
import pytest

from armguard.geometry.shapes import shape_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.sense.alignment import rotation
from armguard.sense.ranging import cast, linearise, nearest
from armguard.sense.world import balls_about
from worlds import random_pose, random_shape

KINDS = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.BOX, ShapeKind.CYLINDER)


def primitives(rng, kinds=KINDS, count=24):
    """Kinds, rows and balls of shapes about the origin."""
    some = [kinds[k % len(kinds)] for k in range(count)]
    shapes = [random_shape(rng, kind, 0.6) for kind in some]
    rows = np.array([shape_row(s, random_pose(rng, 1.0)) for s in shapes])
    numbers = np.array(some, dtype=np.int32)
    balls = balls_about(numbers, rows)
    # Balls about bounding boxes are larger than spheres.
    spheres = numbers == ShapeKind.SPHERE
    balls[spheres, 3] = rows[spheres, 0]
    return numbers, rows, balls


def rim(rng, axis, half, count):
    """Unit vectors at an angle from an axis."""
    side = np.cross(axis, rng.normal(size=3))
    side /= np.linalg.norm(side)
    turns = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
    around = np.cos(turns) * side + np.sin(turns) * np.cross(axis, side)
    return np.cos(half) * axis + np.sin(half) * around


@pytest.mark.parametrize("kinds", [KINDS, KINDS[:1]])
@pytest.mark.parametrize("half", [0.05, 0.4, 1.2])
def test_rays_of_a_cone_meet_what_each_meets_in_all_space(half, kinds):
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(20):
        some, rows, balls = primitives(rng, kinds)
        origin = rng.uniform(-1.0, 1.0, 3)
        ways = rim(rng, -origin / np.linalg.norm(origin), half, 200)
        found, wide = np.zeros((200, 2)), np.zeros((400, 2))
        cast(origin, ways, some, rows, balls, 3.0, found)
        # Rays to all sides: no primitive is beside them.
        cast(origin, np.vstack([ways, -ways]), some, rows, balls, 3.0, wide)
        np.testing.assert_array_equal(found, wide[:200])
        met += (found[:, 1] >= 0).sum()
    assert met > 200


def test_distances_and_derivatives_of_points_are_those_of_moved_points():
    rng = np.random.default_rng(6)
    kinds, rows, balls = primitives(rng)
    R, origin = random_pose(rng)[:3, :3], rng.uniform(-0.3, 0.3, 3)
    points, step = rng.uniform(-0.5, 0.5, (200, 3)), 1e-6

    def gaps(turn, shift):
        local = points @ rotation(turn).T + shift
        out = np.zeros((len(points), 4))
        nearest(local @ R.T + origin, kinds, rows, balls, 1.0, out)
        return out[:, 0]

    turn, shift = np.array([0.02, -0.03, 0.01]), np.array([0.01, 0.02, -0.02])
    out = np.full((len(points), 8), -1.0)
    offset = np.vstack([rotation(turn), shift])
    linearise(points, offset, R, origin, kinds, rows, balls, out)
    np.testing.assert_array_equal(np.isfinite(gaps(turn, shift)), out[:, 7] >= 0)
    np.testing.assert_allclose(out[:, 0], gaps(turn, shift), atol=1e-12)
    outside = out[:, 0] > 0.01
    assert outside.sum() > 100
    for k in range(3):
        way = step * np.eye(3)[k]
        slope = (gaps(turn, shift + way) - gaps(turn, shift - way)) / (2.0 * step)
        worst = np.abs(slope - out[:, 1 + k])[outside]
        assert np.quantile(worst, 0.95) < 1e-4
        # A turn about the origin of the sensor, after the present one.
        turned = points @ rotation(turn).T
        ahead, behind = (
            turned @ rotation(sign * way).T + shift for sign in (1.0, -1.0)
        )
        ends = []
        for local in (ahead, behind):
            found = np.zeros((len(points), 4))
            nearest(local @ R.T + origin, kinds, rows, balls, 1.0, found)
            ends.append(found[:, 0])
        worst = np.abs((ends[0] - ends[1]) / (2.0 * step) - out[:, 4 + k])[outside]
        assert np.quantile(worst, 0.95) < 1e-4
    # What was found first is looked at first, and gives the same.
    again = out.copy()
    linearise(points, offset, R, origin, kinds, rows, balls, again)
    np.testing.assert_array_equal(again[:, :7], out[:, :7])
