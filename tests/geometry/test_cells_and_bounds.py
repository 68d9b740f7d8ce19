"""Cell gaps, bounding boxes and displacements: the basis of the index."""

import coal
import numpy as np
import pytest

from armguard.geometry import Box, HalfSpace, Pose, ShapeKind, distance
from armguard.geometry.bounds import row_bounds
from armguard.geometry.cell_gap import cell_gap, is_farther
from armguard.geometry.place import displacement, place_row
from armguard.geometry.shapes import shape_row
from coal_shapes import coal_request, coal_shape
from oracle import surface
from worlds import random_pose, random_shape

# A half-space has no bounds and no corners; it has tests of its own.
KINDS = [kind for kind in ShapeKind if kind != ShapeKind.HALF_SPACE]

# The kinds whose cores are points, segments and boxes: formulas, not the solver.
SIMPLE = KINDS[:3]


@pytest.mark.parametrize("kind", SIMPLE)
def test_the_gap_to_a_cell_agrees_with_coal(kind):
    rng = np.random.default_rng(int(kind))
    request = coal_request()
    for _ in range(2000):
        shape, T = random_shape(rng, kind, 0.5), random_pose(rng)
        row = shape_row(shape, T)
        low = rng.uniform(-0.8, 0.5, 3)
        size = 10.0 ** rng.uniform(-2, 0, 3)
        gap = cell_gap(int(kind), row, *low, *(low + size))
        cell = coal.Transform3s(np.eye(3), low + size / 2)
        theirs = coal.distance(
            coal_shape(shape),
            coal.Transform3s(T[:3, :3], T[:3, 3]),
            coal.Box(*size),
            cell,
            request,
            coal.DistanceResult(),
        )
        radius = shape.core_radius
        assert max(gap, 0.0) - radius == pytest.approx(
            max(theirs + radius, 0.0) - radius, abs=1e-9
        )


@pytest.mark.parametrize("kind", KINDS[3:])
def test_the_gap_to_a_cell_is_a_sharp_lower_bound(kind):
    rng = np.random.default_rng(int(kind))
    met = 0
    for _ in range(500):
        shape, T = random_shape(rng, kind, 0.5), random_pose(rng, 0.3)
        low = rng.uniform(-0.5, 0.3, 3)
        half = 10.0 ** rng.uniform(-1, 0, 3) / 2
        gap = cell_gap(int(kind), shape_row(shape, T), *low, *(low + 2 * half))
        cell = Box(size=tuple(2.0 * half))
        core = distance(shape, T, cell, Pose(xyz=tuple(low + half))).distance
        core += shape.core_radius
        met += core <= 0.0
        assert gap == pytest.approx(max(core, 0.0), abs=1e-9)
        assert gap <= max(core, 0.0) + 1e-12
    assert 50 < met < 450


def test_a_box_is_farther_than_a_distance_only_if_it_is():
    rng = np.random.default_rng(7)
    box, found = int(ShapeKind.BOX), 0
    for _ in range(2000):
        shape, T = random_shape(rng, ShapeKind.BOX, 0.5), random_pose(rng)
        row = shape_row(shape, T)
        low = rng.uniform(-0.8, 0.5, 3)
        high = low + 10.0 ** rng.uniform(-2, 0, 3)
        gap = cell_gap(box, row, *low, *high)
        assert not is_farther(box, row, tuple(low), tuple(high), gap + 1e-12)
        found += is_farther(box, row, tuple(low), tuple(high), 0.9 * gap - 1e-12)
    assert found > 1800
    row[4] = np.nan
    assert not is_farther(box, row, tuple(low), tuple(high), -1.0)


def test_the_gap_of_a_half_space_is_that_of_the_nearest_corner():
    rng = np.random.default_rng(4)
    kind = int(ShapeKind.HALF_SPACE)
    for _ in range(500):
        T = random_pose(rng)
        low = rng.uniform(-0.8, 0.5, 3)
        high = low + 10.0 ** rng.uniform(-2, 0, 3)
        gap = cell_gap(kind, shape_row(HalfSpace(), T), *low, *high)
        grid = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
        heights = (grid - T[:3, 3]) @ T[:3, 2]
        assert gap == pytest.approx(max(heights.min(), 0.0), abs=1e-12)


def test_a_half_space_has_a_bound_only_where_it_faces_along_an_axis():
    box = np.zeros(6)
    kind = int(ShapeKind.HALF_SPACE)
    floor = Pose(xyz=(1.0, 2.0, 3.0)).matrix()
    row_bounds(kind, shape_row(HalfSpace(rounding=0.5), floor), 0.25, box)
    assert box.tolist() == [-np.inf, -np.inf, -np.inf, np.inf, np.inf, 3.75]
    tilted = Pose(xyz=(1.0, 2.0, 3.0), rpy=(0.1, 0, 0)).matrix()
    row_bounds(kind, shape_row(HalfSpace(), tilted), 0.0, box)
    assert np.isinf(box).all()
    # It may not turn without being looked after; moving along is counted.
    assert (
        displacement(kind, shape_row(HalfSpace(), floor), half_space_row(tilted))
        == np.inf
    )
    lifted = Pose(xyz=(1.0, 2.0, 3.5)).matrix()
    assert (
        displacement(kind, shape_row(HalfSpace(), floor), half_space_row(lifted)) == 0.5
    )


def half_space_row(T):
    """Row of a half-space at T."""
    return shape_row(HalfSpace(), T)


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_are_the_support_along_the_axes(kind):
    rng = np.random.default_rng(int(kind))
    box = np.zeros(6)
    # A sampled curve falls short of its bound by the sagitta of a step.
    short = 1e-12 if kind in (*SIMPLE, ShapeKind.TRIANGLE, ShapeKind.HULL) else 2e-3
    for _ in range(100):
        shape, T = random_shape(rng, kind, 0.5), random_pose(rng)
        row_bounds(int(kind), shape_row(shape, T), 0.02, box)
        points, reach = surface(shape, T), shape.core_radius + 0.02
        low, high = points.min(0) - reach, points.max(0) + reach
        assert (box[:3] <= low + 1e-12).all()
        assert (box[3:] >= high - 1e-12).all()
        assert box[:3] == pytest.approx(low, abs=short)
        assert box[3:] == pytest.approx(high, abs=short)


@pytest.mark.parametrize("kind", KINDS)
def test_no_point_moves_farther_than_the_displacement_says(kind):
    rng = np.random.default_rng(int(kind))
    for _ in range(100):
        shape, A, B = random_shape(rng, kind, 0.5), random_pose(rng), random_pose(rng)
        moved = np.linalg.norm(surface(shape, A) - surface(shape, B), axis=1)
        bound = displacement(int(kind), shape_row(shape, A), shape_row(shape, B))
        assert bound >= moved.max() - 1e-12


@pytest.mark.parametrize("kind", list(ShapeKind))
def test_placing_a_row_is_placing_the_shape(kind):
    rng = np.random.default_rng(int(kind))
    for _ in range(100):
        shape, A, B = random_shape(rng, kind, 0.5), random_pose(rng), random_pose(rng)
        T = np.ascontiguousarray(B[:3].reshape(12))
        # Every place is written: on a stack there is anything before.
        out = np.full(16, np.nan)
        place_row(int(kind), shape_row(shape, A), T, out)
        assert out == pytest.approx(shape_row(shape, B @ A), abs=1e-12)


def test_a_hair_of_rotation_is_not_taken_for_none():
    """The short cut for aligned boxes must not swallow a tiny turn, nor a NaN."""
    T = np.eye(4)
    T[0, 1], T[1, 0] = -1e-9, 1e-9
    row = shape_row(Box(size=(2.0, 2.0, 0.2)), T)
    assert row[7] == 1.0
    gap = cell_gap(int(ShapeKind.BOX), row, 1.5, -2.0, -1.0, 3.0, 2.0, 1.0)
    assert gap == pytest.approx(0.5 - 1e-9, abs=1e-13)
    row[8] = np.nan
    assert np.isnan(cell_gap(int(ShapeKind.BOX), row, 1.5, -2.0, -1.0, 3.0, 2.0, 1.0))
