"""Rays to points, before the part of each ray in each cell."""

import numpy as np
import pytest

import armguard as ag
from armguard.errors import CellMapError

SIDE, CELL = 64, 0.05
HALF = 0.5 * SIDE * CELL


def parts_in_cells(origin, point, places):
    """Share of a segment's way at which it enters and leaves cells."""
    low = CELL * places - HALF
    way = point - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - origin) / way, (low + CELL - origin) / way
    enter, leave = np.minimum(a, b), np.maximum(a, b)
    flat = way == 0.0
    within = (low <= origin) & (origin < low + CELL)
    enter[:, flat] = np.where(within[:, flat], -np.inf, np.inf)
    leave[:, flat] = np.where(within[:, flat], np.inf, -np.inf)
    return np.maximum(enter.max(axis=1), 0.0), leave.min(axis=1)


PLACES = np.argwhere(np.ones((SIDE,) * 3, dtype=bool))


def crossed(origin, point, reach=np.inf):
    """Cells that a ray crosses wholly up to its point or the reach."""
    enter, leave = parts_in_cells(origin, point, PLACES)
    end = min(1.0, reach / np.linalg.norm(point - origin))
    return {tuple(p) for p in PLACES[(leave - enter > 1e-9) & (leave < end - 1e-9)]}


def rays(rng):
    """Origins and points within the cube and outside it, some along an axis."""
    for _ in range(12):
        origin, point = rng.uniform(-1.5 * HALF, 1.5 * HALF, (2, 3))
        if rng.random() < 0.3:
            keep = rng.integers(3)
            point[np.arange(3) != keep] = origin[np.arange(3) != keep]
        yield origin, point


def test_a_ray_passes_the_cells_that_it_crosses_and_hits_that_of_its_point():
    rng = np.random.default_rng(40)
    total = 0
    for origin, point in rays(rng):
        cells = ag.CellMap((0, 0, 0), CELL, SIDE)
        cells.points([point], origin, 0.0)
        free = {tuple(p) for p in np.argwhere(cells.known_free())}
        assert free == crossed(origin, point)
        place = np.floor((point + HALF) / CELL).astype(int)
        inside = ((place >= 0) & (place < SIDE)).all()
        expected = [tuple(place)] if inside else []
        assert [tuple(p) for p in np.argwhere(cells.occupied())] == expected
        total += len(free)
    assert total > 100


def test_a_ray_frees_up_to_the_reach():
    rng = np.random.default_rng(41)
    for origin, point in rays(rng):
        cells = ag.CellMap((0, 0, 0), CELL, SIDE)
        cells.points([point], origin, 0.0, reach=0.8)
        free = {tuple(p) for p in np.argwhere(cells.known_free())}
        assert free == crossed(origin, point, 0.8)


def test_points_without_reach_free_nothing():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.points([(0.5, 0.5, 0.5)], (0, 0, 0), 0.0, reach=0.0)
    assert not cells.known_free().any()
    assert cells.occupied().sum() == 1


def test_a_cell_with_a_point_is_not_passed_by_other_rays():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    points = [(0.0, 0.0, 0.5), (0.0, 0.0, 1.0)]
    cells.points(points, (0.0, 0.0, -1.0), 0.0)
    cells.points(points, (0.0, 0.0, -1.0), 1.0)
    assert cells.occupied().sum() == 2
    assert not cells.known_free()[32, 32, 42]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_point_that_is_not_finite_is_left_out(value):
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.points([(0.1, value, 0.2)], (0, 0, 0), 0.0)
    assert not cells.known_free().any()
    assert not cells.occupied().any()


def test_each_ray_has_its_reach_and_none_of_nan():
    cells, far = ag.CellMap((0, 0, 0), CELL, SIDE), 1.01
    points = np.array([(far, 0.01, 0.01), (0.01, far, 0.01), (0.01, 0.01, far)])
    cells.points(points, (0.01, 0.01, 0.01), 0.0, reach=[0.8, np.nan, 0.4])
    expected = crossed(np.full(3, 0.01), points[0], 0.8)
    expected |= crossed(np.full(3, 0.01), points[2], 0.4)
    assert {tuple(p) for p in np.argwhere(cells.known_free())} == expected
    assert cells.occupied().sum() == 3


def test_a_ray_clears_occupied_cells_beyond_its_reach_and_frees_no_others():
    cells, start = ag.CellMap((0, 0, 0), CELL, SIDE), np.array((-1.0, 0.01, 0.01))
    cells.points([(0.01, 0.01, 0.01)], start, 0.0, reach=0.0)
    points = [(1.01, 0.01, 0.01)]
    cells.points(points, start, 1.0, reach=0.32, clearing=[0.9])
    assert cells.occupied().sum() == 2
    cells.points(points, start, 2.0, reach=0.32, clearing=[1.2])
    assert np.argwhere(cells.occupied()).tolist() == [[52, 32, 32]]
    free = {tuple(p) for p in np.argwhere(cells.known_free())}
    assert free == crossed(start, np.array(points[0]), 0.32) | {(32, 32, 32)}


@pytest.mark.parametrize("reach", [-0.1, [0.1, 0.2]])
def test_reaches_that_are_negative_or_too_many_are_refused(reach):
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    with pytest.raises(CellMapError, match="reach has shape"):
        cells.points([(0.1, 0.1, 0.1)], (0, 0, 0), 0.0, reach=reach)
