"""Arrival times, before the straight line of an intruder."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.arrival import raise_arrivals
from armguard.errors import CellMapError
from cell_frames import feed

SIDE, CELL = 64, 0.02
BLOCKS, EDGE = SIDE // 8, 8 * CELL


def see(cells, seen, stamp):
    """Let a map see blocks free, a grid of them by x, y, z."""
    passes = seen.repeat(8, axis=0).repeat(8, axis=1).repeat(8, axis=2)
    cells._look.seen[:] = 0
    feed(cells, np.zeros_like(passes), passes, stamp)
    speed = cells.intruder_speed
    raise_arrivals(
        stamp, EDGE / speed if speed else np.inf,
        cells._frame.lines, cells._evidence.lines,
    )  # fmt: skip


def sources_beyond(seen):
    """Places of blocks that were not seen, those around the cube among them."""
    padded = np.pad(seen, 1)
    return np.argwhere(~padded) - 1, padded


def straight_times(seen, stamp, arrivals, speed):
    """Earliest time at which an intruder can be in each seen block, face to face."""
    sources, _ = sources_beyond(seen)
    known = ((sources >= 0) & (sources < BLOCKS)).all(axis=1)
    begin = np.full(len(sources), stamp)
    begin[known] = np.maximum(stamp, arrivals[tuple(sources[known].T)])
    blocks = np.argwhere(seen)
    gaps = np.maximum(np.abs(blocks[:, None] - sources) - 1, 0)
    ways = EDGE * np.linalg.norm(gaps, axis=2) / speed
    return blocks, begin, ways


def blobs(rng):
    """Blocks about random middles, as a sensor sees them."""
    places = np.stack(np.meshgrid(*(np.arange(BLOCKS),) * 3, indexing="ij"), axis=-1)
    seen = np.zeros((BLOCKS,) * 3, dtype=bool)
    for _ in range(rng.integers(1, 4)):
        middle, radius = rng.uniform(0, BLOCKS, 3), rng.uniform(1, 5)
        seen |= np.linalg.norm(places - middle, axis=-1) < radius
    return seen


def test_no_arrival_is_later_than_the_straight_line():
    rng = np.random.default_rng(30)
    speed, tight = 1.6, []
    for _ in range(6):
        cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=speed)
        stamp = 0.0
        for _ in range(6):
            # Also frames that are older than the last one.
            stamp += rng.uniform(-0.05, 0.15)
            before, seen = cells.arrivals(), blobs(rng)
            blocks, begin, ways = straight_times(seen, stamp, before, speed)
            see(cells, seen, stamp)
            after = cells.arrivals()
            found, old = after[tuple(blocks.T)], before[tuple(blocks.T)]
            exact = np.maximum((begin + ways).min(axis=1), old)
            assert (found <= exact + 1e-12).all()
            # Each way is shortened by less than 1 / 1.1281.
            least = np.maximum((begin + 0.8864 * ways).min(axis=1), old)
            assert (found >= least - 1e-12).all()
            np.testing.assert_array_equal(after[~seen], before[~seen])
            tight.append((exact - found).mean())
    assert np.mean(tight) < 0.3 * EDGE / speed


def test_a_walker_is_in_no_block_before_its_arrival():
    rng = np.random.default_rng(31)
    speed, period = 1.0, 0.05
    met = 0
    for _ in range(5):
        cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=speed)
        place, way = np.array([-1.0, 0.3, 4.0]), np.array([1.0, 0.0, 0.0])
        for k in range(120):
            block = np.floor(place).astype(int)
            inside = ((block >= 0) & (block < BLOCKS)).all()
            if inside:
                assert cells.arrivals()[tuple(block)] <= k * period
                met += 1
            seen = blobs(rng)
            if inside:
                seen[tuple(block)] = False
            see(cells, seen, k * period)
            target = rng.uniform(0, BLOCKS, 3) - place
            way = 0.7 * way + 0.3 * target / np.linalg.norm(target)
            place = place + speed * period / EDGE * way / np.linalg.norm(way)
    assert met > 200


def test_a_block_counts_only_if_all_of_it_was_seen():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=1.0)
    passes = np.ones((SIDE,) * 3, dtype=bool)
    passes[31, 31, 31] = False
    nothing = np.zeros_like(passes)
    feed(cells, nothing, passes, 0.0)
    raise_arrivals(0.0, EDGE, cells._frame.lines, cells._evidence.lines)
    arrivals = cells.arrivals()
    assert arrivals[3, 3, 3] == -np.inf
    assert np.isfinite(arrivals).sum() == BLOCKS**3 - 1
    # Blocks beside it, and those on the border, are reached at once.
    assert (arrivals[2:5, 2:5, 2:5].max(), arrivals[0].max()) == (0.0, 0.0)
    assert arrivals[5, 3, 3] == EDGE / np.sqrt(
        1 + (np.sqrt(2) - 1) ** 2 + (np.sqrt(3) - np.sqrt(2)) ** 2
    )


def test_an_intruder_that_does_not_move_never_arrives():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=0.0)
    seen = np.zeros((BLOCKS,) * 3, dtype=bool)
    seen[2:5, 2:5, 2:5] = True
    see(cells, seen, 3.0)
    arrivals = cells.arrivals()
    assert (arrivals[seen] == np.inf).all()
    assert (arrivals[~seen] == -np.inf).all()


def test_a_depth_image_raises_the_arrivals_of_the_space_before_it():
    cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=1.6)
    T = np.eye(4)
    T[:3, 3] = (0, 0, -0.64)
    cells.depth(np.full((60, 80), 1.2), T, 50.0, (39.5, 29.5), 5.0)
    arrivals = cells.arrivals()
    known = np.isfinite(arrivals)
    assert known[3:5, 3:5, 4:7].all()
    assert arrivals[known].min() == 5.0
    free = cells.known_free().reshape(BLOCKS, 8, BLOCKS, 8, BLOCKS, 8)
    np.testing.assert_array_equal(known, free.all(axis=(1, 3, 5)))


def test_no_intruder_is_where_space_is_known_free_after_it_expired():
    rng = np.random.default_rng(33)
    speed, beside, freed = 1.6, 0, 0
    for _ in range(6):
        cells = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=speed)
        view = ag.CellView((0, 0, 0), CELL, SIDE)
        half, stamp = 0.5 * SIDE * CELL, 0.0
        points = rng.uniform(-1.5 * half, 1.5 * half, (60_000, 3))
        for _ in range(12):
            step = rng.uniform(0.01, 0.1)
            stamp += step
            way = rng.normal(size=points.shape)
            way *= speed * step / np.linalg.norm(way, axis=1, keepdims=True)
            points = points + way
            seen = blobs(rng)
            place = np.floor((points + half) / EDGE).astype(int)
            inside = ((place >= 0) & (place < BLOCKS)).all(axis=1)
            # What is in a block that is seen free would have been seen.
            met = np.zeros(len(points), dtype=bool)
            met[inside] = seen[tuple(place[inside].T)]
            points = points[~met]
            see(cells, seen, stamp)
            before = cells.known_free()
            cells.expire(stamp)
            free = cells.known_free()
            assert not (free & ~before).any()
            place = np.floor((points + half) / CELL).astype(int)
            place = place[((place >= 0) & (place < SIDE)).all(axis=1)]
            assert not free[tuple(place.T)].any()
            beside += before[tuple(place.T)].sum()
            freed += free.sum()
            while len(changes := cells.take_deltas()):
                view.apply(changes)
            np.testing.assert_array_equal(view.known_free(), free)
    # Without it some would be, and it does not forget everything.
    assert beside > 10
    assert freed > 1e5


def test_only_a_map_with_an_intruder_forgets():
    with pytest.raises(CellMapError, match="forgets nothing"):
        ag.CellMap((0, 0, 0), CELL, SIDE).expire(0.0)
    with pytest.raises(CellMapError, match="stamp is nan"):
        ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=1.0).expire(np.nan)


@pytest.mark.parametrize("way", ["restore", "apply"])
def test_free_space_of_another_map_is_forgotten_as_well(way):
    first = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=1.6)
    second = ag.CellMap((0, 0, 0), CELL, SIDE, intruder_speed=1.6)
    see(first, np.ones((BLOCKS,) * 3, dtype=bool), 0.0)
    # The other map is unknown, and has nothing to forget.
    second.expire(0.0)
    if way == "restore":
        second.restore(first.checkpoint())
    else:
        second.apply(first.take_deltas(1 << 20))
    assert second.known_free().all()
    second.expire(10.0)
    assert not second.known_free().any()
