"""Edges of bodies that stand still, whose cells come and go, and bodies that move."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.state import Motion
from cell_frames import feed

SIDE, FRAME, SECONDS = 64, 0.1, 1.5

# Cells of one word: three of a body that is seen in every frame, one at its edge, and
# others.
BODY, EDGE, FREE = [(8, 8, 8), (9, 8, 8), (8, 9, 8)], (10, 8, 8), (11, 11, 11)
WAY = [(8 + k % 4, 8 + k // 4, 11) for k in range(16)]


def grid(*chosen):
    found = np.zeros((SIDE,) * 3, dtype=bool)
    for cell in chosen:
        found[cell] = True
    return found


@pytest.fixture
def cells():
    """Free space with a body that was there when it was looked at first."""
    made = ag.CellMap((0, 0, 0), 0.02, SIDE)
    feed(made, grid(*BODY), ~grid(*BODY), 0.0)
    return made


def motion(cells):
    return Motion(cells.claims.motion.max())


def flicker(cells, first, last):
    """Frames in which the edge is hit, and is passed in the two that follow."""
    for k in range(round(first / FRAME), round(last / FRAME)):
        hit = [*BODY, EDGE] if k % 3 == 0 else BODY
        feed(cells, grid(*hit), ~grid(*hit), k * FRAME)


def test_an_edge_that_comes_and_goes_is_still_after_a_while(cells):
    flicker(cells, 0.3, 0.6)
    assert motion(cells) == Motion.MOVING
    flicker(cells, 0.6, 0.6 + SECONDS)
    assert motion(cells) == Motion.STILL


def test_what_goes_from_cell_to_cell_moves_all_the_time(cells):
    for k, cell in enumerate(WAY, 1):
        hit = [*BODY, cell]
        feed(cells, grid(*hit), ~grid(*hit), k * FRAME)
        feed(cells, grid(*BODY), ~grid(*BODY), (k + 0.5) * FRAME)
        feed(cells, grid(*hit), ~grid(*hit), (k + 0.7) * FRAME)
        assert motion(cells) == Motion.MOVING


def test_what_comes_back_after_its_word_was_empty_moves(cells):
    nothing = grid()
    for start in (0.3, 0.3 + SECONDS):
        feed(cells, grid(FREE), ~grid(FREE), start)
        assert motion(cells) == Motion.MOVING
        for k in range(1, 9):
            feed(cells, nothing, ~nothing, start + 0.02 * k)
        assert not cells.occupied().any()


def test_the_stamp_of_a_word_is_that_of_its_occupied_cells(cells):
    (word,) = np.flatnonzero(cells.claims.occupied.words)
    feed(cells, grid(*BODY), grid(EDGE), 0.5)
    assert cells.claims.stamp[word] == 0.5
    feed(cells, grid(*BODY[:2]), grid(EDGE), 0.6)
    assert cells.claims.stamp[word] == 0.5


def test_what_appears_is_as_old_as_its_own_last_look_beside_a_hidden_body(cells):
    # The body is hidden from here on.
    (word,) = np.flatnonzero(cells.claims.occupied.words)
    feed(cells, grid(FREE), grid(EDGE), 0.5)
    assert (motion(cells), cells.claims.stamp[word]) == (Motion.MOVING, 0.5)
    feed(cells, grid(FREE), grid(EDGE), 0.6)
    assert (motion(cells), cells.claims.stamp[word]) == (Motion.MOVING, 0.6)
    feed(cells, grid(), grid(EDGE), 0.7)
    assert (motion(cells), cells.claims.stamp[word]) == (Motion.MOVING, 0.6)
