"""Cell gaps, bounding boxes and displacements: what the index stands on."""

import coal
import numpy as np
import pytest

from armguard.geometry import Box, ShapeKind
from armguard.geometry.bounds import row_bounds
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.place import displacement, place_row
from armguard.geometry.shapes import shape_row
from coal_shapes import coal_request, coal_shape
from oracle import corners
from worlds import random_pose, random_shape

KINDS = list(ShapeKind)


@pytest.mark.parametrize("kind", KINDS)
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


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_are_the_support_along_the_axes(kind):
    rng = np.random.default_rng(int(kind))
    box = np.zeros(6)
    for _ in range(300):
        shape, T = random_shape(rng, kind, 0.5), random_pose(rng)
        row_bounds(int(kind), shape_row(shape, T), 0.02, box)
        points, radius = corners(shape, T)
        assert box[:3] == pytest.approx(points.min(0) - radius - 0.02, abs=1e-12)
        assert box[3:] == pytest.approx(points.max(0) + radius + 0.02, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_no_point_moves_farther_than_the_displacement_says(kind):
    rng = np.random.default_rng(int(kind))
    for _ in range(500):
        shape, A, B = random_shape(rng, kind, 0.5), random_pose(rng), random_pose(rng)
        moved = np.linalg.norm(corners(shape, A)[0] - corners(shape, B)[0], axis=1)
        bound = displacement(int(kind), shape_row(shape, A), shape_row(shape, B))
        assert bound >= moved.max() - 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_placing_a_row_is_placing_the_shape(kind):
    rng = np.random.default_rng(int(kind))
    out = np.zeros(16)
    for _ in range(100):
        shape, A, B = random_shape(rng, kind, 0.5), random_pose(rng), random_pose(rng)
        T = np.ascontiguousarray(B[:3].reshape(12))
        place_row(int(kind), shape_row(shape, A), T, out)
        assert out == pytest.approx(shape_row(shape, B @ A), abs=1e-12)


def test_a_hair_of_rotation_is_not_taken_for_none():
    """The short cut for aligned boxes must not swallow a tiny turn, nor a NaN."""
    T = np.eye(4)
    T[0, 1], T[1, 0] = -1e-9, 1e-9
    row = shape_row(Box(half_extents=(1.0, 1.0, 0.1)), T)
    assert row[7] == 1.0
    gap = cell_gap(int(ShapeKind.BOX), row, 1.5, -2.0, -1.0, 3.0, 2.0, 1.0)
    assert gap == pytest.approx(0.5 - 1e-9, abs=1e-13)
    row[8] = np.nan
    assert np.isnan(cell_gap(int(ShapeKind.BOX), row, 1.5, -2.0, -1.0, 3.0, 2.0, 1.0))
