"""Depths that free, that clear and that hit, apart from each other; cells that keep."""

import numpy as np

import armguard as ag
from armguard.geometry.shapes import shape_row
from cell_frames import counts, occupy

VIEW = {"focal": 8.0, "centre": (3.5, 3.5)}
NOTHING = np.full((8, 8), np.nan)


def empty():
    """64 cells of 20 mm in front of a camera at the origin, x along the columns."""
    return ag.CellMap((0, 0, 0.64), 0.02, 64)


def look(cells, image, **settings):
    cells.depth(image, np.eye(4), **VIEW, stamp=1.0, single=True, **settings)


def test_depths_that_free_hit_nothing_and_the_others_free_nothing():
    cells = empty()
    look(cells, np.full((8, 8), 0.8), freeing=NOTHING)
    assert not cells.known_free().any()
    assert cells.occupied().any()
    cells = empty()
    look(cells, NOTHING, freeing=np.full((8, 8), 0.8))
    assert not cells.occupied().any()
    free = cells.middles(np.argwhere(cells.known_free()))
    assert 0.74 < free[:, 2].max() < 0.8


def test_finer_depths_of_the_same_view_free_the_same_space():
    plain, fine = empty(), empty()
    image = np.full((8, 8), 0.9)
    image[:, 4:] = 0.5
    look(plain, image)
    look(fine, image, freeing=image.repeat(4, axis=0).repeat(4, axis=1))
    middles = fine.middles(np.argwhere(fine.known_free()))
    assert len(middles) > 0.9 * plain.known_free().sum() > 1000
    assert brute_force(fine, middles, image, np.inf).all()


def brute_force(cells, middles, image, reach):
    """Which cells an image looks past, corner by corner."""
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T * cells.cell
    found = []
    for middle in middles:
        points = np.concatenate([middle + corners, middle[None]])
        depth = points[:, 2].max()
        verdict = points[:, 2].min() > 0 and depth <= reach
        for k, (x, y, z) in enumerate(points if verdict else ()):
            column, row = round(8 * x / z + 3.5), round(8 * y / z + 3.5)
            if 0 <= column < 8 and 0 <= row < 8:
                verdict = verdict and image[row, column] > depth
            elif k == len(points) - 1:
                verdict = False
        found.append(verdict)
    return np.array(found)


def test_occupied_cells_are_cleared_where_every_pixel_of_them_sees_farther():
    rng = np.random.default_rng(2)
    cells = empty()
    chosen = np.argwhere(rng.random((64, 64, 64)) < 0.004)
    occupy(cells, chosen)
    image = rng.uniform(0.5, 1.2, (8, 8))
    image[rng.random((8, 8)) < 0.1] = np.nan
    image = np.float32(image).astype(float)
    look(cells, NOTHING, freeing=NOTHING, clearing=image, reach=1.0)
    left = counts(cells)[tuple(chosen.T)]
    expected = brute_force(cells, cells.middles(chosen), image, 1.0)
    assert 50 < expected.sum() < len(chosen) - 50
    assert np.array_equal(left == 1, expected)
    assert np.array_equal(left == 2, ~expected)


def test_clearing_makes_no_unseen_cell_free():
    cells = empty()
    look(cells, NOTHING, freeing=NOTHING, clearing=np.full((8, 8), 1.1))
    assert not cells.known_free().any()


def test_kept_cells_are_neither_hit_nor_passed_and_links_still_are():
    wall = ag.Box(size=(0.2, 0.2, 0.2))
    link = ag.Sphere(radius=0.12)
    rows = [
        (int(one.kind), shape_row(one, ag.Pose(xyz=(x, 0, 0.6)).matrix()))
        for one, x in ((wall, -0.2), (link, 0.2))
    ]
    cells = empty()
    cells.mask([(*rows[0], np.inf, 0.0)])
    kept = cells.masked()
    cells.mask([(*rows[1], 0.0, 0.0)], kept)
    inside, shell = cells.own_cells()
    assert inside.any()
    look(cells, np.full((8, 8), 0.6), freeing=np.full((8, 8), 2.0))
    middles = cells.middles(np.argwhere(cells.occupied()))
    in_wall = (np.abs(middles - [-0.2, 0, 0.6]) < 0.1).all(axis=1)
    assert len(middles) and not in_wall.any()
    free = cells.middles(np.argwhere(cells.known_free()))
    assert not (np.abs(free - [-0.2, 0, 0.6]) < 0.1).all(axis=1).any()
    assert (np.linalg.norm(free - [0.2, 0, 0.6], axis=1) < 0.08).any()
    # Another mask without it lets them go.
    cells.mask([])
    look(cells, np.full((8, 8), 0.6))
    middles = cells.middles(np.argwhere(cells.occupied()))
    assert (np.abs(middles - [-0.2, 0, 0.6]) < 0.1).all(axis=1).any()
    assert shell.any()
