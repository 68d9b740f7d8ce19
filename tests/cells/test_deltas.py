"""Changes that are sent a few at a time, and checkpoints."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.view import arrays_of
from cell_frames import feed

SIDE = 64


def frame(rng, cells, stamp):
    """A frame of a block that moves in free space, and of noise."""
    hits = rng.random((SIDE,) * 3) < 0.002
    x = int(40 * (0.5 + 0.5 * np.sin(3.0 * stamp)))
    hits[x : x + 8, 20:30, 10:40] |= rng.random((8, 10, 30)) < 0.5
    passes = (rng.random((SIDE,) * 3) < 0.6) & ~hits
    feed(cells, hits, passes, stamp, rng.uniform(0.0, 0.01))


def assert_same(view, cells):
    """Cells equal to the bit; stamps and errors where a reader needs them."""
    mine, theirs = view.claims, cells.claims
    for one in ("occupied", "unknown"):
        pairs = zip(
            arrays_of(getattr(mine, one)), arrays_of(getattr(theirs, one)), strict=True
        )
        assert all(a.tobytes() == b.tobytes() for a, b in pairs)
    assert mine.motion.tobytes() == theirs.motion.tobytes()
    taken = theirs.occupied.words != 0
    assert 0 < taken.sum() < len(taken)
    assert mine.stamp[taken].tobytes() == theirs.stamp[taken].tobytes()
    taken |= theirs.unknown.words != 0
    assert mine.error[taken].tobytes() == theirs.error[taken].tobytes()


def test_applied_deltas_are_the_map_bit_for_bit():
    rng = np.random.default_rng(5)
    cells = ag.CellMap((0.1, 0, 0), 0.02, SIDE)
    view = ag.CellView((0.1, 0, 0), 0.02, SIDE)
    for k in range(20):
        frame(rng, cells, 0.1 * k)
        for _ in range(rng.integers(0, 6)):
            deltas = cells.take_deltas(300)
            assert len(deltas) <= 300
            view.apply(deltas)
    while len(deltas := cells.take_deltas(300)):
        view.apply(deltas)
    assert_same(view, cells)
    assert view.occupied().sum() > 1000
    assert len(cells.take_deltas()) == 0


def test_each_changed_word_is_sent_once():
    rng = np.random.default_rng(6)
    cells = ag.CellMap((0, 0, 0), 0.02, SIDE)
    for k in range(5):
        frame(rng, cells, 0.1 * k)
    sent = [int(delta.word) for delta in cells.take_deltas(10**6)]
    assert len(sent) == len(set(sent)) == 4096


def test_new_occupied_cells_go_first():
    rng = np.random.default_rng(7)
    cells = ag.CellMap((0, 0, 0), 0.02, SIDE)
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    hits = nothing.copy()
    feed(cells, nothing, ~nothing, 0.0)
    hits[rng.integers(0, SIDE, 50), 60, 60] = True
    feed(cells, hits, nothing, 1.0)
    words = len(np.unique(np.flatnonzero(hits) // (4 * SIDE * SIDE)))
    first = cells.take_deltas(words)
    assert (first["bits"][:, 0] != 0).all()
    later = cells.take_deltas(10**6)
    assert not later["bits"][:, 0].any()
    assert len(first) + len(later) == 4096


def test_free_space_that_is_seen_again_is_not_sent_again():
    cells = ag.CellMap((0, 0, 0), 0.02, SIDE)
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    hits = nothing.copy()
    hits[40:44, 20:24, 8:12] = True
    for k in range(3):
        feed(cells, hits, ~hits, 0.1 * k, 0.001 * k)
        deltas = cells.take_deltas(10**6)
        assert len(deltas) == (4096 if k == 0 else 1)
    assert deltas["stamp"][0] == 0.2
    assert deltas["error"][0] >= 0.002


def test_deltas_of_another_kind_or_map_are_refused():
    view = ag.CellView((0, 0, 0), 0.02, SIDE)
    larger = ag.CellMap((0, 0, 0), 0.02, 128)
    larger.points([(1.0, 1.0, 1.0)], (0.2, 0.9, 0.9), 0.0)
    deltas = larger.take_deltas()
    with pytest.raises(ag.CellMapError, match="beyond 4096"):
        view.apply(deltas)
    with pytest.raises(ag.CellMapError, match="records of deltas"):
        view.apply(np.zeros(3))
    with pytest.raises(ag.CellMapError, match="contiguous"):
        view.apply(deltas[::2])


def test_a_restored_map_goes_on_with_the_same_bits():
    rng = np.random.default_rng(8)
    one, two = (ag.CellMap((0, 0, 0), 0.02, SIDE, intruder_speed=1.0) for _ in range(2))
    for k in range(4):
        frame(rng, one, 0.1 * k)
    one.take_deltas(100)
    two.restore(one.checkpoint())
    for cells in (one, two):
        again = np.random.default_rng(9)
        for k in range(4, 8):
            frame(again, cells, 0.1 * k)
    assert one.checkpoint() == two.checkpoint()
    np.testing.assert_array_equal(one.take_deltas(10**6), two.take_deltas(10**6))


def test_a_checkpoint_of_another_map_is_refused():
    cells = ag.CellMap((0, 0, 0), 0.02, SIDE)
    before = cells.checkpoint()
    for other in (
        ag.CellMap((0, 0, 1e-9), 0.02, SIDE),
        ag.CellMap((0, 0, 0), 0.02, SIDE, intruder_speed=1.0),
    ):
        with pytest.raises(ag.CellMapError, match="another map"):
            cells.restore(other.checkpoint())
    with pytest.raises(ag.CellMapError, match="another map"):
        cells.restore(before[:-1])
    assert cells.checkpoint() == before
