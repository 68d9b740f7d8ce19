"""A ball in which something is: its cells are not known free, and no others change."""

import numpy as np
import pytest

import armguard as ag
from armguard.errors import CellMapError

CELL = 0.02


def seen(speed=None, stamp=0.0):
    """A map of which a camera has seen the middle free, and a wall."""
    cells = ag.CellMap((0, 0, 1), CELL, 64, intruder_speed=speed)
    wall = np.full((120, 160), 1.2)
    cells.depth(wall, np.eye(4), focal=130, centre=(79.5, 59.5), stamp=stamp)
    return cells


@pytest.mark.parametrize("speed", [None, 1.6])
@pytest.mark.parametrize(
    "middle", [(0.03, 0.11, 0.9), (0, 0, 1.19), (0.6, 0, 1), (5, 5, 5)]
)
def test_exactly_the_cells_of_a_ball_are_forgotten(speed, middle):
    cells, radius = seen(speed), 0.15
    free, occupied = cells.known_free(), cells.occupied()
    places = np.argwhere(np.ones_like(free))
    low = cells.centre - 32 * CELL + CELL * places
    nearest = np.clip(middle, low, low + CELL)
    apart = np.linalg.norm(nearest - middle, axis=1).reshape(free.shape)
    corner = np.linalg.norm(low + CELL / 2 - middle, axis=1).reshape(free.shape)
    cells.forget(middle, radius, 1.0)
    after = cells.known_free()
    assert not after[apart <= radius].any()
    kept = corner > radius + CELL * np.sqrt(3) / 2
    assert np.array_equal(after[kept], free[kept])
    assert np.array_equal(cells.occupied(), occupied)


def test_what_was_seen_later_stays_and_a_later_frame_frees_again():
    cells = seen(stamp=2.0)
    free = cells.known_free()
    cells.forget((0, 0, 0.9), 0.1, 1.0)
    assert np.array_equal(cells.known_free(), free)
    cells.forget((0, 0, 0.9), 0.1, 2.5)
    assert cells.known_free().sum() < free.sum()
    wall = np.full((120, 160), 1.2)
    cells.depth(wall, np.eye(4), focal=130, centre=(79.5, 59.5), stamp=3.0)
    assert np.array_equal(cells.known_free(), free)


def test_a_view_gets_the_change_and_moving_intruders_spread_from_it():
    cells = seen(1.6)
    view = ag.CellView(cells.centre, CELL, 64)
    view.apply(cells.take_deltas(1 << 16))
    cells.forget((0, 0, 0.9), 0.1, 0.5)
    changes = cells.take_deltas(1 << 16)
    assert 0 < len(changes) < 100
    view.apply(changes)
    assert np.array_equal(view.known_free(), cells.known_free())
    assert (cells.arrivals() <= 0.5).any()


@pytest.mark.parametrize(("radius", "stamp"), [(-1, 0), (np.inf, 0), (0.1, np.nan)])
def test_wrong_numbers_are_refused(radius, stamp):
    with pytest.raises(CellMapError):
        seen().forget((0, 0, 1), radius, stamp)
