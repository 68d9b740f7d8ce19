"""Cells of own links, before the depth of sampled points in the shapes."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.grid import unpacked
from cell_frames import counts, feed, occupy
from worlds import random_pose

SIDE, CELL = 64, 0.02
HALF = 0.5 * SIDE * CELL
GRID = np.stack(np.meshgrid(*(np.arange(SIDE),) * 3, indexing="ij"), axis=-1)
CORNERS = np.stack(np.meshgrid(*((0, 1),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def in_ball(shape, p):
    return np.linalg.norm(p, axis=-1) - shape.radius


def in_capsule(shape, p):
    along = np.clip(p[..., 2], shape.start[2], shape.end[2])
    apart = p - along[..., None] * (0, 0, 1)
    return np.linalg.norm(apart, axis=-1) - shape.radius


def in_box(shape, p):
    beyond = np.abs(p) - np.array(shape.size) / 2
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return outside + np.minimum(beyond.max(axis=-1), 0.0)


def in_cylinder(shape, p):
    radial = np.hypot(p[..., 0], p[..., 1]) - shape.radius
    beyond = np.stack([radial, np.abs(p[..., 2]) - shape.height / 2], axis=-1)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return outside + np.minimum(beyond.max(axis=-1), 0.0)


SHAPES = {
    "ball": (ag.Sphere(radius=0.2), in_ball),
    "capsule": (
        ag.Capsule(start=(0, 0, -0.2), end=(0, 0, 0.2), radius=0.12),
        in_capsule,
    ),
    "box": (ag.Box(size=(0.3, 0.2, 0.4)), in_box),
    "cylinder": (ag.Cylinder(radius=0.15, height=0.4), in_cylinder),
}


def masks_of(cells):
    return [unpacked(words, SIDE) for words in cells.own_cells()]


@pytest.mark.parametrize("name", SHAPES)
def test_inside_is_inside_and_what_the_shape_may_touch_is_masked(name):
    shape, depth = SHAPES[name]
    rng = np.random.default_rng(20)
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    for error, margin in ((0.0, 0.0), (0.01, 0.03)):
        T = random_pose(rng, 0.3)
        cells.own([(shape, T)], error=error, shell=margin)
        inside, shell = masks_of(cells)
        assert not (inside & shell).any()
        # A signed distance to a convex shape is greatest at a corner of a cell.
        near = np.linalg.norm(CELL * (GRID + 0.5) - HALF - T[:3, 3], axis=-1) < 0.45
        assert not ((inside | shell) & ~near).any()
        inside, shell, grid = inside[near], shell[near], GRID[near]
        corners = CELL * (grid[..., None, :] + CORNERS) - HALF
        at_corners = depth(shape, (corners - T[:3, 3]) @ T[:3, :3])
        surely = at_corners.max(axis=-1) < -error
        assert not (inside & ~surely).any()
        # Any point of a cell within reach of the surface.
        points = CELL * (grid[..., None, :] + rng.random((10, 3))) - HALF
        reached = depth(shape, (points - T[:3, 3]) @ T[:3, :3]).min(axis=-1) <= margin
        reached |= at_corners.min(axis=-1) <= margin
        assert not (reached & ~(inside | shell)).any()
        # Bounds by the middle of a cell lose less than half its diagonal.
        loss = np.sqrt(3.0) * CELL
        assert not (~inside & (at_corners.max(axis=-1) < -error - loss)).any()
        assert not (shell & (at_corners.min(axis=-1) > margin + loss)).any()
        assert inside.sum() > 1000


def test_frames_keep_the_shell_and_pass_the_inside():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    everywhere = np.ones((SIDE,) * 3, dtype=bool)
    nothing = ~everywhere
    ball = (ag.Sphere(radius=0.2), ag.Pose(xyz=(0.1, 0, 0)))
    cells.own([ball], error=0.005, shell=0.03)
    inside, shell = masks_of(cells)
    free = ~(inside | shell)
    feed(cells, everywhere, nothing)
    np.testing.assert_array_equal(cells.occupied(), free)
    np.testing.assert_array_equal(cells.known_free(), inside)
    feed(cells, nothing, everywhere, 1.0)
    np.testing.assert_array_equal(counts(cells)[free], 1)
    # A link that has come to what was seen does not erase it, but for its inside.
    cells.own([])
    feed(cells, everywhere, nothing, 2.0)
    cells.own([ball], error=0.005, shell=0.03)
    for stamp in range(3, 12):
        feed(cells, nothing, everywhere, float(stamp))
    np.testing.assert_array_equal(cells.occupied(), shell)
    np.testing.assert_array_equal(cells.known_free(), inside | free)


def test_links_are_masked_together():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    placed = [
        (ag.Sphere(radius=0.15), ag.Pose(xyz=(x, 0, 0))) for x in (-0.1, 0.1, 0.5)
    ]
    alone = []
    for one in placed:
        cells.own([one], error=0.005, shell=0.03)
        alone.append(masks_of(cells))
    cells.own(placed, error=0.005, shell=0.03)
    inside, shell = masks_of(cells)
    expected = np.logical_or.reduce([a for a, _ in alone])
    np.testing.assert_array_equal(inside, expected)
    expected_shell = np.logical_or.reduce([b for _, b in alone]) & ~expected
    np.testing.assert_array_equal(shell, expected_shell)
    cells.own([])
    assert not any(mask.any() for mask in masks_of(cells))


def test_a_frame_without_pixels_still_passes_the_inside():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    occupy(cells, [(32, 32, 32)])
    cells.own([(ag.Sphere(radius=0.2), ag.Pose())])
    cells.depth(np.zeros((4, 4)), np.eye(4), 4.0, (1.5, 1.5), 1.0)
    assert not cells.occupied().any()
    assert cells.known_free()[32, 32, 32]


def test_a_link_outside_the_cube_masks_nothing():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    cells.own([(ag.Sphere(radius=0.2), ag.Pose(xyz=(2, 0, 0)))], shell=0.1)
    assert not any(mask.any() for mask in masks_of(cells))


def test_kept_cells_are_left_out_beyond_the_reach_of_a_frame():
    rng = np.random.default_rng(21)
    cells = ag.CellMap((0, 0, 0), CELL, SIDE)
    wall = (ag.Box(size=(1.2, 1.2, 0.1)), random_pose(rng, 0.2))
    cells.own([wall], shell=0.02)
    kept = cells.masked()
    whole = np.logical_or(*masks_of(cells))
    none = np.zeros(0, dtype=np.int32), np.zeros((0, 16)), np.zeros((0, 2))
    middles, near = cells.middles(GRID.reshape(-1, 3)), 0
    for reach in (0.0, 0.2, 0.4):
        middle = rng.uniform(-0.4, 0.4, 3)
        cells.mask_near(*none, kept, middle, reach)
        _, shell = masks_of(cells)
        within = np.linalg.norm(middles - middle, axis=1).reshape(shell.shape) <= reach
        np.testing.assert_array_equal(shell[within], whole[within])
        assert not (shell & ~whole).any()
        near += shell.sum()
    assert 0 < near < 3 * whole.sum()
