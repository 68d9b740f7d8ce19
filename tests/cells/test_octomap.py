"""Trees of OctoMap as a start of a map."""

import numpy as np
import pytest

import armguard as ag
from cell_frames import random_cells
from sensing.octomap_files import write_octomap

SIDE = 64


def grids(seed, side):
    """Occupied and free cells, some of them in large blocks."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((side,) * 3, dtype=bool)
    occupied[tuple(random_cells(rng, side, 300).T)] = True
    free = np.zeros_like(occupied)
    free[8:24, 4:20, 16:30] = True
    free[:, : side // 8] = True
    return occupied, free & ~occupied


def test_a_tree_of_the_same_cells_is_taken_as_it_is(tmp_path):
    occupied, free = grids(0, SIDE)
    path = tmp_path / "map.bt"
    write_octomap(path, 0.05, occupied, free)
    cells = ag.CellMap((0, 0, 0), 0.05, SIDE)
    cells.read_octomap(path, 3.0)
    np.testing.assert_array_equal(cells.occupied(), occupied)
    np.testing.assert_array_equal(cells.known_free(), free)
    assert cells.claims.stamp.max() == 3.0


def test_cells_of_a_coarser_map_hold_what_is_in_them(tmp_path):
    occupied, free = grids(1, 2 * SIDE)
    path = tmp_path / "map.bt"
    write_octomap(path, 0.05, occupied, free)
    cells = ag.CellMap((0, 0, 0), 0.1, SIDE)
    cells.read_octomap(path, 0.0)
    parts = (SIDE, 2) * 3
    np.testing.assert_array_equal(
        cells.occupied(), occupied.reshape(parts).any(axis=(1, 3, 5))
    )
    np.testing.assert_array_equal(
        cells.known_free(), free.reshape(parts).all(axis=(1, 3, 5))
    )
    assert cells.known_free().any()


def test_a_map_beside_the_lattice_of_the_tree_is_safe(tmp_path):
    occupied, free = grids(2, SIDE)
    path = tmp_path / "map.bt"
    write_octomap(path, 0.05, occupied, free)
    centre = np.array([0.031, -0.321, 0.001])
    cells = ag.CellMap(centre, 0.03, SIDE)
    cells.read_octomap(path, 0.0)
    rng = np.random.default_rng(3)
    points = centre + rng.uniform(-0.95, 0.95, (20_000, 3))
    own = tuple(np.floor((points - centre) / 0.03 + SIDE / 2).astype(int).T)
    theirs = tuple(np.floor(points / 0.05 + SIDE / 2).astype(int).T)
    assert cells.occupied()[own][occupied[theirs]].all()
    assert free[theirs][cells.known_free()[own]].all()
    assert cells.known_free()[own].sum() > 500


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "no binary tree"),
        (b"# Octomap OcTree binary file\nid ColorOcTree\nres 1\ndata\n", "no binary"),
        (b"# Octomap OcTree binary file\nid OcTree\nres nan\ndata\n", "no binary"),
        (b"# Octomap OcTree binary file\nid OcTree\nres x\ndata\n", "no binary"),
        (b"id OcTree\nres 0.1\ndata\n\x03\x00", "ends before"),
        (b"id OcTree\nres 0.1\ndata\n" + b"\x03\x00" * 16, "below level 16"),
    ],
)
def test_a_file_that_is_no_tree_is_refused(tmp_path, content, match):
    path = tmp_path / "map.bt"
    path.write_bytes(content)
    cells = ag.CellMap((0, 0, 0), 0.1, SIDE)
    with pytest.raises(ag.CellMapError, match=match):
        cells.read_octomap(path, 0.0)
    assert not cells.occupied().any()


def test_a_missing_file_is_named(tmp_path):
    cells = ag.CellMap((0, 0, 0), 0.1, SIDE)
    with pytest.raises(ag.CellMapError, match=r"absent\.bt"):
        cells.read_octomap(tmp_path / "absent.bt", 0.0)
