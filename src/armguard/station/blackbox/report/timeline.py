"""Cycles in buckets of time: an hour in one plot without the loss of a peak."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level
from armguard.station.blackbox.report.cycles import Floats, Longs, Series

# Buckets of a time line: about the pixels of a screen.
BUCKETS = 1500


@dataclass(frozen=True, slots=True)
class Timeline:
    """The worst value of each bucket; NaN in empty ones."""

    edges: Floats  # of the buckets, shape (b + 1,) [s]
    levels: Floats  # highest one of each robot, or of all, shape (r, b)
    clearance: Floats  # least one, shape (b,) [m]
    distance: Floats  # of the pair that has it, shape (b,) [m]
    slack: Floats  # least time until a stop is ordered, shape (b,) [s]
    cycle_time: Floats  # longest one, shape (b,) [s]

    @property
    def t(self) -> Floats:
        """Middle of each bucket, shape (b,) [s]."""
        return (self.edges[1:] + self.edges[:-1]) / 2.0


def timeline(series: Series, buckets: int = BUCKETS) -> Timeline:
    """A recording in at most so many buckets of equal time."""
    # A level lasts until the next cycle: a bucket has at least two cycles.
    step = max(float(np.median(series.held)) if len(series.t) else 0.0, 1e-9)
    length = max(series.duration, step)
    size = max(min(buckets, int(length / step / 2.0)), 1)
    place = np.minimum((series.t / length * size).astype(np.int64), size - 1)

    def worst(pick: np.ufunc, values: NDArray[Any], none: float) -> Floats:
        found = np.full(size, none)
        pick.at(found, place, values.astype(np.float64))
        return np.where(np.isfinite(found), found, np.nan)

    least = least_in_each(series.clearance, place)
    distance = np.full(size, np.nan)
    distance[place[least]] = series.distance[least]
    levels = series.levels if series.levels.shape[1] else series.level[:, None]
    return Timeline(
        edges=np.linspace(0.0, length, size + 1),
        levels=np.array([worst(np.maximum, own, -np.inf) for own in levels.T]),
        clearance=worst(np.fmin, series.clearance, np.inf),
        distance=np.where(np.isfinite(distance), distance, np.nan),
        slack=worst(np.fmin, series.slack, np.inf),
        cycle_time=worst(np.fmax, series.cycle_time, -np.inf),
    )


def least_in_each(values: Floats, bucket: Longs) -> Longs:
    """Index of the least value of each bucket that has one, in the order of buckets."""
    order = np.lexsort((values, bucket))
    _, first = np.unique(bucket[order], return_index=True)
    return order[first]


def level_shares(series: Series, spans: int) -> tuple[Floats, Floats]:
    """Share of each level in spans of equal time.

    Returns:
        Edges of the spans, shape (spans + 1,) [s], and shares of the judged time of
        each, shape (levels, spans); zero in a span within a gap.
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
