"""Free space by carving, before every pixel that a cell may cover."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import armguard as ag

SIDE, CELL = 64, 0.03

# Places in a cell, in its edges: corners, and points between them.
SAMPLES = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, 4),) * 3), axis=-1).reshape(
    -1, 3
)


def seen(cells, T, focal, centre):
    """Pixel and depth of sample points of cells: columns, rows, depths [m]."""
    low = -0.5 * SIDE * CELL
    points = low + CELL * (cells[:, None, :] + SAMPLES)
    x, y, z = np.moveaxis((points - T[:3, 3]) @ T[:3, :3], -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return focal[0] * x / z + centre[0], focal[1] * y / z + centre[1], z


def is_behind(image, u, v, far):
    """Whether the pixels of points are valid and lie behind a depth."""
    rows, columns = image.shape
    j, i = np.floor(u + 0.5).astype(int), np.floor(v + 0.5).astype(int)
    within = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
    depth = image[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
    return within & np.isfinite(depth) & (depth > far)


def borders_of(free):
    """Free cells beside cells that are not, and those on the border of the cube."""
    kept = np.zeros_like(free)
    inner = free[1:-1, 1:-1, 1:-1].copy()
    for k in range(3):
        for step in (-1, 1):
            inner &= np.roll(free, step, axis=k)[1:-1, 1:-1, 1:-1]
    kept[1:-1, 1:-1, 1:-1] = inner
    return np.argwhere(free & ~kept)


@st.composite
def scenes(draw):
    """An image with steps, slopes and holes, and a camera at any pose."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows, columns = draw(st.sampled_from([(8, 8), (4, 16), (31, 24), (60, 80), (1, 9)]))
    v, u = np.mgrid[:rows, :columns]
    image = rng.uniform(0.3, 1.8) + rng.uniform(-0.02, 0.02) * u
    image = image + rng.uniform(-0.02, 0.02) * v
    for _ in range(rng.integers(0, 5)):
        i, j = rng.integers(rows), rng.integers(columns)
        image[i : i + rng.integers(1, 9), j : j + rng.integers(1, 9)] = rng.choice(
            [np.nan, 0.0, -1.0, np.inf, 0.2, rng.uniform(0.2, 2.0)]
        )
    T = np.eye(4)
    if rng.random() > 0.2:
        T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-1.1, 1.1, 3)
    focal = tuple(rng.uniform(0.5, 1.5, 2) * max(rows, columns))
    centre = tuple(rng.uniform(0.3, 0.7, 2) * (columns, rows))
    return image.astype(np.float32), T, focal, centre


@settings(max_examples=40, deadline=None)
@given(scenes())
def test_a_free_cell_has_all_its_pixels_behind_it(scene):
    image, T, focal, centre = scene
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(image, T, focal, centre, 0.0)
    free = borders_of(cells.known_free())
    rng = np.random.default_rng(len(free))
    free = rng.permutation(free)[:2500]
    u, v, z = seen(free, T, focal, centre)
    assert (z > 0.0).all()
    assert is_behind(image, u, v, z.max(axis=1)[:, None]).all()


@settings(max_examples=30, deadline=None)
@given(scenes())
def test_a_measured_cell_is_not_free(scene):
    image, T, focal, centre = scene
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(image, T, focal, centre, 0.0)
    valid = np.isfinite(image) & (image > 0.0)
    v, u = np.nonzero(valid)
    depth = image[valid].astype(float)
    ways = np.stack(
        [(u - centre[0]) / focal[0], (v - centre[1]) / focal[1], np.ones(len(u))],
        axis=1,
    )
    points = (depth[:, None] * ways) @ T[:3, :3].T + T[:3, 3]
    places = np.floor(points / CELL + SIDE / 2).astype(int)
    places = places[((places >= 0) & (places < SIDE)).all(axis=1)]
    assert not cells.known_free()[tuple(places.T)].any()
    # Two pixels in a cell are a hit.
    found, count = np.unique(places, axis=0, return_counts=True)
    assert cells.occupied()[tuple(found[count > 1].T)].all()


def wall(depth=1.2, rows=60, columns=80):
    """An image of a wall, and its camera at the lower border of the cube."""
    T = np.eye(4)
    T[:3, 3] = (0.0, 0.0, -0.9)
    focal, centre = (70.0, 70.0), ((columns - 1) / 2, (rows - 1) / 2)
    return np.full((rows, columns), depth, dtype=np.float32), T, focal, centre


def test_carving_reaches_the_wall_and_the_edges_of_the_image():
    image, T, focal, centre = wall()
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(image, T, focal, centre, 0.0)
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, SIDE, (20_000, 3))
    u, v, z = seen(chosen, T, focal, centre)
    near, far = z.min(axis=1), z.max(axis=1)
    in_front = (near > 0.1) & (far < 1.2 - 1e-6)
    # A rectangle about the projection of the middle is a little wider than the cell.
    grown = 0.1 * np.ptp(u, axis=1) + 0.01
    inside = (u.min(axis=1) > -0.5 + grown) & (u.max(axis=1) < 79.5 - grown)
    inside &= (v.min(axis=1) > -0.5 + grown) & (v.max(axis=1) < 59.5 - grown)
    expected = in_front & inside
    assert expected.sum() > 1_000
    free = cells.known_free()[tuple(chosen.T)]
    assert free[expected].mean() > 0.98
    assert not free[far > 1.2 + 1e-6].any()


@pytest.mark.parametrize("value", [np.nan, 0.0, -0.5, np.inf, -np.inf])
def test_an_invalid_pixel_frees_nothing_and_hits_nothing(value):
    image, T, focal, centre = wall()
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(np.full_like(image, value), T, focal, centre, 0.0)
    assert not cells.known_free().any()
    assert not cells.occupied().any()
    image[30, 40] = value
    cells.depth(image, T, focal, centre, 1.0)
    free = np.argwhere(cells.known_free())
    u, v, _ = seen(free, T, focal, centre)
    covers = (u.min(axis=1) < 40.5) & (u.max(axis=1) > 39.5)
    covers &= (v.min(axis=1) < 30.5) & (v.max(axis=1) > 29.5)
    assert not covers.any()


def test_space_is_freed_up_to_the_reach():
    image, T, focal, centre = wall()
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(image, T, focal, centre, 0.0, reach=0.61)
    free = np.argwhere(cells.known_free())
    _, _, z = seen(free, T, focal, centre)
    assert 0.61 - CELL < z.max() <= 0.61


def test_two_pixels_make_a_hit_where_a_cell_is_two_pixels_wide():
    image, T, focal, centre = wall()
    lone = np.zeros_like(image)
    # At 0.9 m a cell is 2.3 pixels wide, at 1.2 m 1.75.
    lone[30, 40] = 0.9
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(lone, T, focal, centre, 0.0)
    assert cells.occupied().sum() == 0
    lone[30, 41] = 0.9
    cells.depth(lone, T, focal, centre, 1.0)
    assert cells.occupied().sum() == 1
    lone[:] = 0.0
    lone[30, 40] = 1.2
    cells.depth(lone, T, focal, centre, 2.0)
    assert cells.occupied().sum() == 2


def test_one_pixel_makes_a_hit_where_it_is_enough():
    image, T, focal, centre = wall()
    lone = np.zeros_like(image)
    lone[30, 40] = 0.9
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.depth(lone, T, focal, centre, 0.0, single=True)
    assert cells.occupied().sum() == 1


def test_a_zone_hits_all_cells_that_its_area_meets():
    cells = ag.CellMap((0, 0, 0.5), 0.01, SIDE)
    zones = np.full((8, 8), np.nan)
    zones[2, 5] = 0.405
    cells.zones(zones, np.eye(4), np.deg2rad(45.0), 0.0)
    places = np.argwhere(cells.occupied())
    middles = cells.middles(places)
    np.testing.assert_allclose(middles[:, 2], 0.405)
    # The sixth column and the third row of an 8 × 8 view of 45 degrees.
    pixel = 0.405 * np.tan(np.deg2rad(22.5)) / 4.0
    for k, first in enumerate((1.0, -2.0)):
        met = np.floor(np.array([first * pixel, (first + 1.0) * pixel]) / 0.01 + 32)
        assert [places[:, k].min(), places[:, k].max()] == met.tolist()
    assert len(places) == np.prod(np.ptp(places, axis=0) + 1)


def test_zones_free_up_to_their_distance():
    cells = ag.CellMap((0, 0, 0.3), 0.01, SIDE)
    cells.zones(np.full((8, 8), 397), np.eye(4), np.deg2rad(45.0), 0.0)
    free = cells.middles(np.argwhere(cells.known_free()))
    assert 0.38 < free[:, 2].max() < 0.39
    # A pyramid of 45 degrees by 0.4 m, cut off near the sensor and at its edges.
    pyramid = (2 * np.tan(np.deg2rad(22.5))) ** 2 * 0.397**3 / 3.0 / 0.01**3
    assert 0.7 * pyramid < len(free) < pyramid
