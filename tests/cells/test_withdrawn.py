"""Claims of a sensor at fault are taken back, and no others."""

import numpy as np
import pytest

import armguard as ag
from cell_frames import show

SIDE = 64


def block(*ends):
    """Cells between two places along x, y and z."""
    found = np.zeros((SIDE,) * 3, dtype=bool)
    found[tuple(slice(a, b) for a, b in ends)] = True
    return found


NOTHING = block((0, 0), (0, 0), (0, 0))
FIRST = block((8, 40), (8, 40), (8, 40))
SECOND = block((24, 56), (8, 40), (8, 40))
PART = block((10, 14), (8, 40), (8, 40))


def feed(cells, hits, passes, stamp, source):
    """A frame of a sensor with a number."""
    show(cells, hits, passes)
    cells._settle(stamp, 0.0, source)


@pytest.fixture
def cells():
    """Space that a first sensor has freed, and then partly a second one."""
    made = ag.CellMap((0, 0, 0), 0.02, SIDE)
    feed(made, NOTHING, FIRST, 0.0, source=1)
    feed(made, NOTHING, SECOND, 0.1, source=2)
    return made


def test_what_another_sensor_has_seen_since_stays(cells):
    cells.withdraw(1)
    assert np.array_equal(cells.known_free(), SECOND)
    cells.withdraw(1)
    assert np.array_equal(cells.known_free(), SECOND)


def test_what_a_worse_pose_has_confirmed_goes_with_the_better_one():
    cells = ag.CellMap((0, 0, 0), 0.02, SIDE)
    show(cells, NOTHING, FIRST)
    cells._settle(0.0, 0.005, 1)
    # The second sensor confirms, and frees that space by its own pose once it is gone.
    for stamp, error, free in ((0.1, 0.005, False), (0.2, 0.014, True)):
        show(cells, NOTHING, FIRST)
        cells._settle(stamp, 0.014, 2)
        assert np.array_equal(cells.known_free(), FIRST)
        errors = cells.claims.error[cells.claims.source > 0]
        assert errors == pytest.approx(np.full(512, error), abs=1e-6)
        cells.withdraw(1)
        assert cells.known_free().any() == free


def test_words_of_several_sensors_are_withdrawn_by_cells_and_forgotten_whole(cells):
    # A part of words that it shares with the first one.
    feed(cells, NOTHING, PART, 0.2, source=3)
    cells.withdraw(3)
    assert np.array_equal(cells.known_free(), (FIRST | SECOND) & ~PART)
    cells.withdraw(3, all_frames=True)
    shared = block((8, 16), (8, 40), (8, 40))
    assert np.array_equal(cells.known_free(), (FIRST | SECOND) & ~shared)


def test_occupied_cells_and_own_links_keep_what_they_have(cells):
    ball = ag.Sphere(radius=0.1)
    cells.own([(ball, ag.Pose(xyz=(-0.34, -0.2, -0.2)))], shell=0.02)
    inside, shell = cells.own_cells()
    taken = ag.CellMap((0, 0, 0), 0.02, SIDE)
    taken.claims.occupied.words[:] = inside | shell
    own = taken.occupied()
    taken.claims.occupied.words[:] = inside
    passed = taken.occupied()
    assert 200 < own.sum() < 2000
    hits = block((12, 13), (30, 31), (30, 31))
    feed(cells, hits, NOTHING, 0.3, source=1)
    cells.withdraw(1)
    assert np.array_equal(cells.occupied(), hits)
    # The insides of links were passed by the frame with the hit.
    kept = (passed | (own & FIRST)) & ~hits
    assert np.array_equal(cells.known_free(), (SECOND | kept) & ~hits)
    cells.withdraw(1, all_frames=True)
    assert np.array_equal(cells.occupied(), hits)
    assert cells.known_free()[kept].all()


def test_withdrawn_cells_are_sent(cells):
    view = ag.CellView((0, 0, 0), 0.02, SIDE)
    view.apply(cells.take_deltas(10**6))
    cells.withdraw(1)
    view.apply(cells.take_deltas(10**6))
    assert np.array_equal(view.known_free(), SECOND)


def test_the_last_frames_are_withdrawn_and_no_older_ones():
    made = ag.CellMap((0, 0, 0), 0.02, SIDE)
    places = [block((8 * k, 8 * k + 8), (8, 40), (8, 40)) for k in range(6)]
    for k, place in enumerate(places):
        feed(made, NOTHING, place, 0.1 * k, source=1)
    made.withdraw(1)
    assert np.array_equal(made.known_free(), places[0] | places[1])


@pytest.mark.parametrize("source", [0, 255, -1])
def test_no_number_of_a_sensor_is_refused(source):
    made = ag.CellMap((0, 0, 0), 0.02, SIDE)
    with pytest.raises(ag.CellMapError, match="must be 1 to 254"):
        made.withdraw(source)
