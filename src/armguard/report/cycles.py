"""Cycles of a recording as columns: in blocks, as a series, in buckets of time."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.answer import Names
from armguard.guard.layout import IN_HEADER, IN_NEAR, IN_ROBOT
from armguard.guard.levels import Level, Reason
from armguard.recording.frames import Frame
from armguard.recording.palette import State
from armguard.report.formatting import duration

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
# A record array of `row_type`; its columns are attributes.
Rows: TypeAlias = Any

# Level of each reason, by its number.
LEVEL_OF = np.full(max(Reason) + 1, -1, dtype=np.int64)
LEVEL_OF[list(Reason)] = [reason.level for reason in Reason]

# A gap is longer than this many periods, and than this time [s].
GAP_PERIODS, LEAST_GAP = 10.0, 0.05

# Times of a frame on the monotonic clock.
CLOCKS = ("monotonic", "ended", "received")

# Buckets of a time line: about the pixels of a screen.
BUCKETS = 1500

# Time between two runs of a machine if the wall clock does not give it [s].
LEAST_BREAK = 1.0


@dataclass(frozen=True, slots=True)
class Distribution:
    """Median, tails and greatest of the finite values of a column."""

    count: int
    p50: float
    p99: float
    p999: float
    most: float


def distribution(values: NDArray[np.floating]) -> Distribution | None:
    """Quantiles, each a value that occurs; None if no value is finite."""
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    found = np.quantile(known, [0.5, 0.99, 0.999, 1.0], method="inverted_cdf")
    return Distribution(len(known), *found.tolist())


def row_type(robot_count: int, real: str = "f4") -> np.dtype[np.void]:
    """Values of a cycle: about fifty bytes, so that hours fit into memory.

    `t` is the time since the first verdict [s]; `cycle` its number; `cycle_time` [s];
    `answer` the time from the message's receipt to the verdict, NaN if unknown [s];
    `levels`, `states` and `ages` [s] of each robot, `state` is that of all together;
    `whole` whether all near pairs are recorded.
    Of type `real` are `time_left`, the time until a stop is ordered, infinite if no
    pair is near [s]; `headroom` and `distance` of the pair with the least headroom [m],
    infinite if no pair is near, NaN if it is not recorded.
    """
    robots = (robot_count,)
    return np.dtype(
        [
            *[("t", "f8"), ("cycle", "i8"), ("cycle_time", "f4"), ("answer", "f4")],
            *[("reason", "i1"), ("level", "i1"), ("levels", "i1", robots)],
            *[("state", "i1"), ("states", "i1", robots)],
            *[("ages", "f4", robots), ("whole", "?")],
            *[("time_left", real), ("headroom", real), ("distance", real)],
        ]
    )


@dataclass(frozen=True, slots=True)
class Block:
    """Successive cycles."""

    frames: list[Frame]
    rows: Rows  # their values, `row_type(..., "f8")`, shape (k,)
    near: Floats  # recorded rows of near pairs, shape (m, NEAR_WIDTH)
    owner: Longs  # index of the cycle of each of these, shape (m,)


def block_of(frames: list[Frame], names: Names, begin: float) -> Block:
    """Columns of some cycles; their frames fit the scene of the names.

    A recording holds all near pairs of a cycle, the nearest one alone, or none. Times
    count from `begin`, on the monotonic clock [s].
    """
    robots, first, count = len(names.robots), names.first_row, len(frames)
    head = np.array([frame.verdict[:first] for frame in frames])
    end = layout.HEADER + robots * layout.ROBOT_WIDTH
    own = head[:, layout.HEADER : end].reshape(count, robots, layout.ROBOT_WIDTH)
    ended, received = np.array([(frame.ended, frame.received) for frame in frames]).T
    rows: Rows = np.recarray(count, row_type(robots, "f8"))
    rows.t = [frame.monotonic - begin for frame in frames]
    rows.cycle = [frame.cycle for frame in frames]
    rows.cycle_time = [frame.cycle_time for frame in frames]
    rows.answer = ended - received
    rows.reason = head[:, IN_HEADER.reason]
    rows.levels = own[:, :, IN_ROBOT.level]
    rows.level = np.maximum(LEVEL_OF[rows.reason], rows.levels.max(axis=1, initial=0))
    waits: Any = held_in(frames, robots)
    rows.states = state_of_each(rows.levels, waits)
    rows.state = state_of_each(rows.level, waits.any(axis=1))
    rows.ages = own[:, :, IN_ROBOT.age]
    rows.time_left = head[:, IN_HEADER.least_time_left] if robots else np.inf
    rows.headroom = rows.distance = np.inf
    rows.whole = [len(frame.poses) > 0 for frame in frames]
    near, sizes = [np.zeros((0, layout.NEAR_WIDTH))], np.zeros(count, dtype=np.int64)
    for k in np.flatnonzero(head[:, IN_HEADER.near_count] >= 1.0).tolist():
        wanted, nearest = (
            int(head[k, IN_HEADER.near_count]),
            int(head[k, IN_HEADER.nearest]),
        )
        tail = frames[k].verdict[first:]
        held = sizes[k] = min(len(tail) // layout.NEAR_WIDTH, wanted)
        near.append(tail[: held * layout.NEAR_WIDTH].reshape(held, layout.NEAR_WIDTH))
        rows.whole[k] &= held == wanted
        if nearest >= 0:
            pair = near[-1][nearest if nearest < held else 0] if held else None
            rows.headroom[k] = np.nan if pair is None else pair[IN_NEAR.headroom]
            rows.distance[k] = np.nan if pair is None else pair[IN_NEAR.distance]
    return Block(frames, rows, np.concatenate(near), np.repeat(np.arange(count), sizes))


def held_in(frames: list[Frame], robots: int) -> NDArray[np.bool_]:
    """Which robots are held in each cycle, shape (k, robots).

    None is held where no motion was requested.
    """
    held = np.zeros((len(frames), robots), dtype=np.bool_)
    for k, frame in enumerate(frames):
        if len(frame.told):
            held[k] = np.isfinite(frame.told[-2 * robots : -robots])
    return held


def state_of_each(levels: NDArray[Any], held: NDArray[np.bool_]) -> NDArray[Any]:
    """State of each level, see `palette.state_of`, in the shape of the arrays."""
    return np.where(held & (levels < Level.BRAKE), State.HELD, levels)


def joined(blocks: list[Rows]) -> Rows:
    """Rows of all blocks; empties the list, so that an hour is in memory only once."""
    rows = np.empty(sum(len(block) for block in blocks), blocks[0].dtype)
    end = len(rows)
    while blocks:
        block = blocks.pop()
        rows[end - len(block) : end] = block
        end -= len(block)
    return rows


class Series:
    """All cycles of a recording in their order; its columns are attributes.

    Attributes:
        held: Time for which its verdict was the newest one; one period before a gap and
            at the end, shape (k,) [s].
        gaps: Indices of the cycles that a gap follows, shape (g,).
        missing: Number of cycles whose numbers do not occur.
        period: Declared time from one cycle to the next [s].

    The other columns are those of `row_type`.
    """

    def __init__(self, rows: NDArray[np.void], period: float) -> None:
        self._rows, self.period = rows, period
        steps, skipped = np.diff(rows["t"]), np.diff(rows["cycle"]) - 1
        self.gaps: Longs = np.flatnonzero(steps > max(GAP_PERIODS * period, LEAST_GAP))
        self.held = np.append(np.maximum(steps, 0.0), period)[: len(rows)]
        self.held[self.gaps] = period
        self.missing = int(skipped[skipped > 0].sum())

    def __getattr__(self, name: str) -> NDArray[Any]:
        """A column."""
        try:
            return self._rows[name]
        except ValueError as error:
            raise AttributeError(name) from error

    @property
    def judged(self) -> float:
        """Time for which there was a verdict [s]."""
        return float(self.held.sum())

    @property
    def duration(self) -> float:
        """From the first cycle to the end of the last one [s]."""
        return float(self.t[-1] + self.held[-1]) if len(self.t) else 0.0

    def time_in(self, states: NDArray[np.int8]) -> dict[State, float]:
        """Duration of each state in a column of states, or of levels [s]."""
        return {state: float(self.held[states == state].sum()) for state in State}


def on_one_clock(frames: Iterable[Frame], notes: list[str]) -> Iterator[Frame]:
    """Frames with a monotonic clock that never goes back.

    Where it goes back, another run of the machine begins. Its frames follow as much
    later as the wall clock says, at least `LEAST_BREAK`.

    Args:
        frames: Frames in their order.
        notes: Receives one sentence for each such run.
    """
    shift, last, wall, before = 0.0, -float("inf"), 0.0, 0
    for frame in frames:
        if frame.monotonic + shift < last:
            later = max(frame.wall - wall, LEAST_BREAK)
            shift = last + later - frame.monotonic
            notes.append(
                f"another run of the machine begins {duration(later)} after cycle "
                f"{before}; its monotonic clock began anew"
            )
        last, wall, before = frame.monotonic + shift, frame.wall, frame.cycle
        times = {name: getattr(frame, name) + shift for name in CLOCKS}
        yield replace(frame, **times) if shift else frame


@dataclass(frozen=True, slots=True)
class Timeline:
    """The worst value of each bucket; NaN in empty ones."""

    edges: Floats  # of the buckets, shape (b + 1,) [s]
    states: Floats  # highest one of each robot, or of all, shape (r, b)
    headroom: Floats  # least one, shape (b,) [m]
    time_left: Floats  # least time until a stop is ordered, shape (b,) [s]
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

    states = series.states if series.states.shape[1] else series.state[:, None]
    return Timeline(
        edges=np.linspace(0.0, length, size + 1),
        states=np.array([worst(np.maximum, own, -np.inf) for own in states.T]),
        headroom=worst(np.fmin, series.headroom, np.inf),
        time_left=worst(np.fmin, series.time_left, np.inf),
        cycle_time=worst(np.fmax, series.cycle_time, -np.inf),
    )


def least_in_each(values: Floats, bucket: Longs) -> Longs:
    """Index of the least value of each bucket that has one, in the order of buckets."""
    order = np.lexsort((values, bucket))
    _, first = np.unique(bucket[order], return_index=True)
    return order[first]


def state_shares(series: Series, spans: int) -> tuple[Floats, Floats]:
    """Share of each state in spans of equal time.

    Returns:
        Edges of the spans, shape (spans + 1,) [s], and shares of the judged time of
        each, shape (states, spans); zero in a span within a gap.
    """
    edges = np.linspace(0.0, max(series.duration, 1e-9), spans + 1)
    held = np.array(
        [
            np.histogram(series.t[own], edges, weights=series.held[own])[0]
            for own in (series.state == state for state in State)
        ]
    )
    whole = held.sum(axis=0)
    return edges, np.divide(held, whole, out=np.zeros_like(held), where=whole > 0.0)
