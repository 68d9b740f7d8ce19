"""Cycles in buckets of time: an hour of them drawn without losing a single peak."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level
from armguard.station.blackbox.report.series import Series

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Buckets of a time line: about what a screen has pixels for.
BUCKETS = 1500


@dataclass(frozen=True, slots=True)
class Timeline:
    """The worst of each bucket; NaN where there is nothing.

    Attributes:
        t: Middle of each bucket, shape (b,) [s].
        width: How long each is [s].
        levels: Highest level of each robot, or of all, shape (r, b); NaN in gaps.
        clearance: Least clearance, shape (b,) [m].
        distance: Distance of the pair that has it, shape (b,) [m].
        slack: Least time until a stop must be ordered, shape (b,) [s].
        cycle_time: Longest time judging took, shape (b,) [s].
    """

    t: Floats
    width: float
    levels: Floats
    clearance: Floats
    distance: Floats
    slack: Floats
    cycle_time: Floats


def timeline(series: Series, buckets: int = BUCKETS) -> Timeline:
    """A recording in buckets of equal time."""
    t = series.t
    # A level lasts until the next cycle: no bucket may be shorter than a cycle.
    step = max(float(np.median(series.held)) if len(t) else 0.0, 1e-9)
    length = max(series.duration, step)
    size = max(min(buckets, int(length / step / 2.0)), 1)
    place = np.minimum((t / length * size).astype(np.int64), size - 1)
    levels = series.levels if series.levels.shape[1] else series.level[:, None]
    order = np.lexsort((series.clearance, place))
    first = order[np.searchsorted(place[order], np.arange(size))] if len(t) else order
    known = np.isin(np.arange(size), place)
    distance = np.full(size, np.nan)
    distance[known] = series.distance[first[known]] if len(t) else np.nan
    return Timeline(
        t=(np.arange(size) + 0.5) * length / size,
        width=length / size,
        levels=np.array(
            [worst(np.maximum, own, place, size, -np.inf) for own in levels.T]
        ),
        clearance=worst(np.fmin, series.clearance, place, size, np.inf),
        distance=np.where(np.isfinite(distance), distance, np.nan),
        slack=worst(np.fmin, series.slack, place, size, np.inf),
        cycle_time=worst(np.fmax, series.cycle_time, place, size, -np.inf),
    )


def level_shares(series: Series, spans: int) -> tuple[Floats, Floats]:
    """Share of each level in spans of equal time.

    Returns:
        Edges of the spans, shape (spans + 1,) [s], and shares of the time that was
        judged in each, shape (levels, spans); nothing in a span within a gap.
    """
    edges = np.linspace(0.0, max(series.duration, 1e-9), spans + 1)
    held = np.array(
        [
            np.histogram(series.t[own], edges, weights=series.held[own])[0]
            for own in (series.level == level for level in Level)
        ]
    )
    whole = held.sum(axis=0)
    return edges, np.divide(held, whole, out=np.zeros_like(held), where=whole > 0.0)


def worst(
    pick: np.ufunc, values: NDArray[Any], place: Longs, size: int, none: float
) -> Floats:
    """The worst value of each bucket, NaN where there is none."""
    found = np.full(size, none)
    pick.at(found, place, values.astype(np.float64))
    found[~np.isfinite(found)] = np.nan
    return found


def around(series: Series, t: float, before: float, after: float) -> slice:
    """Places of the cycles around a time."""
    first, last = np.searchsorted(series.t, [t - before, t + after])
    return slice(int(first), int(last))
