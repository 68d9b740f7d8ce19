"""Evidence and claims, before counters and sets kept cell by cell."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.grid import packed, unpacked
from armguard.cells.state import SEVERAL, Motion
from cell_frames import counts, feed

SIDE = 64


def empty():
    return ag.CellMap((0, 0, 0), 0.01, SIDE)


def basis(cells):
    """Error and source of the claims of the first word."""
    return cells.claims.error[0], cells.claims.source[0]


def some(rng, share):
    return rng.random((SIDE,) * 3) < share


def test_words_and_grids_are_the_same_cells():
    rng = np.random.default_rng(0)
    for side in (64, 128):
        grid = rng.random((side,) * 3) < 0.3
        np.testing.assert_array_equal(unpacked(packed(grid), side), grid)
    # Bit x + 4 y + 16 z of a word; groups of 4³ words; blocks of 4³ groups.
    grid[:] = False
    grid[64 + 16 + 8 + 3, 32 + 4 + 2, 48 + 12 + 1] = True
    words = packed(grid)
    (word,) = np.flatnonzero(words)
    group, block = 1 + 4 * 2 + 16 * 3, 1
    assert word == 4096 * block + 64 * group + (2 + 4 * 1 + 16 * 3)
    assert words[word] == 1 << (3 + 4 * 2 + 16 * 1)


def test_evidence_is_a_counter_of_each_cell():
    rng = np.random.default_rng(1)
    cells, expected = empty(), np.zeros((SIDE,) * 3, dtype=int)
    for frame in range(40):
        hits = some(rng, 0.3 if frame % 3 else 0.02)
        passes = some(rng, 0.5) & ~hits
        feed(cells, hits, passes, float(frame))
        expected = np.clip(expected + 2 * hits - passes, 0, 7)
        np.testing.assert_array_equal(counts(cells), expected)
        np.testing.assert_array_equal(cells.occupied(), expected >= 2)
    assert set(np.unique(expected)) == set(range(8))


def test_known_free_is_passed_and_not_occupied():
    rng = np.random.default_rng(2)
    cells = empty()
    count, passed = np.zeros((SIDE,) * 3, dtype=int), np.zeros((SIDE,) * 3, dtype=bool)
    assert not cells.known_free().any()
    for frame in range(12):
        hits = some(rng, 0.05)
        passes = some(rng, 0.1)
        feed(cells, hits, passes, float(frame))
        # A cell with a measured point is not passed by the same frame.
        passes &= ~hits
        count = np.clip(count + 2 * hits - passes, 0, 7)
        passed |= passes
        np.testing.assert_array_equal(cells.known_free(), passed & (count < 2))
    assert 0.2 < cells.known_free().mean() < 0.9


def test_a_lone_pixel_neither_hits_nor_passes():
    rng = np.random.default_rng(3)
    cells = empty()
    hits = some(rng, 0.2)
    feed(cells, hits, hits, sure=np.zeros_like(hits))
    assert not cells.occupied().any()
    assert not cells.known_free().any()


def any_of_members(cells, edge):
    """Whether any cell of each cube of an edge is set, by x, y, z."""
    n = SIDE // edge
    return cells.reshape(n, edge, n, edge, n, edge).any(axis=(1, 3, 5))


@pytest.mark.parametrize("name", ["occupied", "unknown"])
def test_summaries_are_those_of_the_words(name):
    rng = np.random.default_rng(4)
    cells = empty()
    for frame in range(14):
        hits = np.zeros((SIDE,) * 3, dtype=bool)
        x, y, z = rng.integers(0, SIDE - 12, 3)
        hits[x : x + 10, y : y + 12, z : z + 7] = some(rng, 0.3)[:10, :12, :7]
        feed(cells, hits, some(rng, 0.9) & ~hits if frame > 3 else ~hits, float(frame))
        bits = getattr(cells.claims, name)
        members = unpacked(bits.words, SIDE)
        assert bits.words.any() or name == "unknown"
        groups = any_of_members(members, 4)
        blocks = any_of_members(members, 16)
        # A group is 4³ words, as a word is 4³ cells; so a group's bits are one word.
        expected = np.zeros(64, dtype=np.uint64)
        for i, j, k in np.argwhere(groups):
            group = i // 4 + 4 * (j // 4) + 16 * (k // 4)
            bit = i % 4 + 4 * (j % 4) + 16 * (k % 4)
            expected[group] |= np.uint64(1) << np.uint64(bit)
        np.testing.assert_array_equal(bits.groups, expected)
        top = sum(1 << int(i + 4 * j + 16 * k) for i, j, k in np.argwhere(blocks))
        assert bits.blocks.tolist() == [top]
        assert bits.roots.tolist() == [int(members.any())]


def test_a_word_has_the_stamp_at_which_all_its_claims_were_looked_at():
    cells = empty()
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    half, rest = nothing.copy(), nothing.copy()
    half[:2, :4, :4], rest[2:4, :4, :4] = True, True
    feed(cells, nothing, half, 1.0, 0.002)
    assert (cells.claims.stamp[0], cells.claims.stamp[1]) == (1.0, -np.inf)
    assert cells.claims.error[0] == np.float32(0.002)
    # The other half is new, the first one is as old as before.
    feed(cells, nothing, rest, 2.0, 0.001)
    assert (cells.claims.stamp[0], cells.claims.error[0]) == (1.0, np.float32(0.002))
    feed(cells, rest, half, 3.0, 0.001)
    assert (cells.claims.stamp[0], cells.claims.error[0]) == (3.0, np.float32(0.001))
    # Of an older frame only a part: the claims are as old as it is.
    feed(cells, nothing, half, 2.5, 0.001)
    assert cells.claims.stamp[0] == 2.5


def test_a_frame_that_only_confirms_does_not_worsen_what_is_known():
    cells = empty()
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    half, rest = nothing.copy(), nothing.copy()
    half[:2, :4, :4], rest[3, :4, :4] = True, True
    feed(cells, nothing, half, 1.0, 0.005, source=1)
    # All that is known, a part of it, and the space of a link.
    feed(cells, nothing, half, 2.0, 0.014, source=2)
    feed(cells, nothing, half & (np.arange(SIDE) < 2), 3.0, 0.014, source=2)
    link = ag.Pose(xyz=cells.middles([[0, 0, 0], [1, 3, 3]]).mean(axis=0).tolist())
    cells.own([(ag.Box(size=(0.06, 0.09, 0.09)), link)])
    feed(cells, nothing, nothing, 3.5, 0.014, source=2)
    assert basis(cells) == (np.float32(0.005), 1)
    known = cells.known_free()
    assert known[2, :4, :4].any()
    # A better pose counts, and so does the worse one of new space.
    cells.own(())
    feed(cells, nothing, known, 4.0, 0.003, source=3)
    assert basis(cells) == (np.float32(0.003), 3)
    feed(cells, nothing, rest, 5.0, 0.014, source=2)
    assert basis(cells) == (np.float32(0.014), SEVERAL)


def test_what_a_frame_hits_or_removes_is_known_by_its_pose():
    cells = empty()
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    word, one = nothing.copy(), nothing.copy()
    word[:4, :4, :4], one[1, 1, 1] = True, True
    feed(cells, nothing, word, 1.0, 0.005, source=1)
    for stamp in (2.0, 3.0, 4.0, 5.0):
        feed(cells, one, nothing, stamp, 0.014, source=2)
        assert basis(cells) == (np.float32(0.014), SEVERAL)
        feed(cells, one, word & ~one, stamp + 0.5, 0.005, source=1)
        assert basis(cells) == (np.float32(0.005), 1)
    while cells.occupied().any():
        assert basis(cells) == (np.float32(0.005), 1)
        feed(cells, nothing, one, 6.0, 0.014, source=2)
    assert basis(cells) == (np.float32(0.014), SEVERAL)


def test_what_is_forgotten_in_time_is_known_by_the_newest_frame():
    cells = ag.CellMap((0, 0, 0), 0.01, SIDE, intruder_speed=1.6)
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    word = nothing.copy()
    word[:4, :4, :4] = True
    feed(cells, nothing, word, 1.0, 0.005, source=1)
    feed(cells, nothing, word, 2.0, 0.014, source=2)
    assert basis(cells) == (np.float32(0.014), 2)


def test_what_appears_in_free_space_moves_until_it_has_settled():
    cells = empty()
    nothing = np.zeros((SIDE,) * 3, dtype=bool)
    first, second = nothing.copy(), nothing.copy()
    first[5, 5, 5], second[30, 30, 30] = True, True
    motion = cells.claims.motion
    feed(cells, first, ~(first | second), 0.0)
    assert not motion.any()
    # Where space was unknown it is still, where it was known free it moves.
    feed(cells, nothing, second, 0.1)
    feed(cells, first | second, nothing, 0.2)
    assert motion.sum() == Motion.MOVING
    feed(cells, second, nothing, 0.69)
    assert motion.sum() == Motion.MOVING
    feed(cells, second, nothing, 0.71)
    assert not motion.any()
