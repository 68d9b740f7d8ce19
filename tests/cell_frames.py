"""Frames for tests of maps of cells, and their numbers cell by cell."""

import numpy as np

from armguard.cells.evidence import settle
from armguard.cells.grid import packed, unpacked
from armguard.cells.state import NO_SENSOR


def show(cells, hits, passes, sure=None):
    """Let a map look at given cells, grids by x, y, z."""
    look = cells._look
    look.hits[:], look.passes[:] = packed(hits), packed(passes)
    look.sure[:] = look.hits if sure is None else packed(sure)
    touched = np.flatnonzero(look.hits | look.passes)
    look.touched[: len(touched)] = touched
    look.notes["touched"] = len(touched)


def feed(cells, hits, passes, stamp=0.0, error=0.0, sure=None, source=NO_SENSOR):
    """Let a map take a frame of given cells, grids by x, y, z."""
    show(cells, hits, passes, sure)
    settle(
        stamp, error, cells.settles, source,
        cells._frame.lines, cells._evidence.lines, cells._claims.lines,
    )  # fmt: skip


def occupy(cells, chosen):
    """Let a map take a frame that hits chosen cells, places of shape (n, 3)."""
    hits = np.zeros((cells.size,) * 3, dtype=bool)
    hits[tuple(np.asarray(chosen).T)] = True
    feed(cells, hits, np.zeros_like(hits))


def counts(cells):
    """Evidence of each cell, by x, y, z."""
    planes = cells.evidence[:3]
    return sum(unpacked(p, cells.size).astype(int) << k for k, p in enumerate(planes))


def random_cells(rng, size, count):
    """Places of cells in clumps and alone, shape (n, 3)."""
    middles = rng.uniform(0, size, (max(count // 30, 1), 3))
    places = middles[rng.integers(len(middles), size=count)] + rng.normal(
        0, 3, (count, 3)
    )
    alone = rng.uniform(0, size, (count // 10 + 1, 3))
    places = np.concatenate([places, alone]).astype(int)
    return np.unique(np.clip(places, 0, size - 1), axis=0)
