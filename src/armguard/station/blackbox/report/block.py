"""Frames in blocks: what is told of each cycle as arrays, a few thousand at a time."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import (
    CLEARANCE,
    HEADER,
    NEAR_COUNT,
    NEAR_WIDTH,
    NEAREST,
    REASON,
    ROBOT_AGE,
    ROBOT_LEVEL,
    ROBOT_WIDTH,
    SLACK_TIME,
    WITNESS,
)
from armguard.guard.levels import Reason, level_of
from armguard.guard.verdict import Names
from armguard.station.frames import Frame, Kind

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Cycles of a block.
BLOCK = 2048

# Level of each reason, by its number.
LEVEL_OF = np.full(max(Reason) + 1, -1, dtype=np.int64)
for _reason in Reason:
    LEVEL_OF[_reason] = level_of(_reason)

# Reasons as verdicts hold them.
KNOWN = frozenset(float(reason) for reason in Reason)


@dataclass(slots=True)
class Block:
    """Some cycles in their order, and what happened between them.

    Attributes:
        frames: The cycles.
        events: Frames that are none.
        foreign: Cycles that do not fit the scene, and are left out.
        unknown: Cycles with a reason this version does not know, likewise.
        cycle: Numbers of the cycles, shape (k,).
        t: When each was judged, on the monotonic clock, shape (k,) [s].
        cycle_time: What judging took, shape (k,) [s].
        answer: From its message's receipt to its end; NaN if not known, (k,) [s].
        reason: Reason of each verdict, shape (k,).
        level: Level of each verdict, shape (k,).
        levels: Level of each robot, shape (k, r).
        ages: Age of each robot's measurement, shape (k, r) [s].
        slack: Time until a stop must be ordered; infinite if none is near, (k,) [s].
        clearance: What the nearest pair has left; infinite where none is near, NaN
            where the recording leaves it out, shape (k,) [m].
        distance: Distance of that pair, likewise, shape (k,) [m].
        whole: Whether all near pairs are in the recording, shape (k,); poses are left
            out of cycles of which only the nearest one is.
        near: Rows of near pairs, see `armguard.guard.layout`, shape (m, NEAR_WIDTH).
        owner: Place of the cycle each row is of, shape (m,).
    """

    frames: list[Frame]
    events: list[Frame]
    foreign: int
    unknown: int
    cycle: Longs
    t: Floats
    cycle_time: Floats
    answer: Floats
    reason: Longs
    level: Longs
    levels: Longs
    ages: Floats
    slack: Floats
    clearance: Floats
    distance: Floats
    whole: Bools
    near: Floats
    owner: Longs


@dataclass(slots=True)
class Gathering:
    """Frames on their way into a block."""

    frames: list[Frame] = field(default_factory=list)
    events: list[Frame] = field(default_factory=list)
    foreign: int = 0
    unknown: int = 0


def blocks(frames: Iterable[Frame], names: Names) -> Iterator[Block]:
    """Frames of a recording in blocks.

    Args:
        frames: Frames in their order.
        names: Names of the scene they were judged in.
    """
    joints, least = len(names.joints), names.first_row
    held = Gathering()
    for frame in frames:
        if frame.kind is not Kind.CYCLE:
            held.events.append(frame)
            continue
        if len(frame.q) != joints or len(frame.verdict) < least:
            held.foreign += 1
            continue
        if frame.verdict[REASON] not in KNOWN:
            held.unknown += 1
            continue
        held.frames.append(frame)
        if len(held.frames) == BLOCK:
            yield block_of(held, names)
            held = Gathering()
    if held.frames or held.events or held.foreign or held.unknown:
        yield block_of(held, names)


def block_of(held: Gathering, names: Names) -> Block:
    """What is told of each of these cycles."""
    frames, robots, first = held.frames, len(names.robots), names.first_row
    count = len(frames)
    head = np.empty((count, first))
    for k, frame in enumerate(frames):
        head[k] = frame.verdict[:first]
    own = head[:, HEADER : HEADER + robots * ROBOT_WIDTH]
    own = own.reshape(count, robots, ROBOT_WIDTH)
    reason = head[:, REASON].astype(np.int64)
    levels = own[:, :, ROBOT_LEVEL].astype(np.int64)
    level = np.maximum(LEVEL_OF[reason], levels.max(axis=1, initial=0))
    rows, owner, clearance, distance, whole = near_rows(frames, head, first)
    ended = column(frames, "ended")
    return Block(
        frames=frames,
        events=held.events,
        foreign=held.foreign,
        unknown=held.unknown,
        cycle=column(frames, "cycle").astype(np.int64),
        t=column(frames, "monotonic"),
        cycle_time=column(frames, "cycle_time"),
        answer=ended - column(frames, "received"),
        reason=reason,
        level=level,
        levels=levels,
        ages=own[:, :, ROBOT_AGE],
        slack=head[:, SLACK_TIME] if robots else np.full(count, np.inf),
        clearance=clearance,
        distance=distance,
        whole=whole,
        near=rows,
        owner=owner,
    )


def near_rows(
    frames: list[Frame], head: Floats, first: int
) -> tuple[Floats, Longs, Floats, Floats, Bools]:
    """Rows of near pairs, whose they are, and what is told of the nearest ones.

    A recording may hold all rows of a cycle, the nearest one alone, or none.
    """
    count = len(frames)
    clearance, distance = np.full(count, np.inf), np.full(count, np.inf)
    whole = np.array([len(frame.poses) > 0 for frame in frames], dtype=np.bool_)
    pieces: list[Floats] = []
    sizes = np.zeros(count, dtype=np.int64)
    wanted = head[:, NEAR_COUNT].astype(np.int64)
    nearest = head[:, NEAREST].astype(np.int64)
    for k in np.flatnonzero(wanted > 0).tolist():
        tail = frames[k].verdict[first:]
        held = min(len(tail) // NEAR_WIDTH, int(wanted[k]))
        rows = tail[: held * NEAR_WIDTH].reshape(held, NEAR_WIDTH)
        whole[k] &= held == wanted[k]
        pieces.append(rows)
        sizes[k] = held
        if nearest[k] < 0:
            continue
        place = int(nearest[k]) if nearest[k] < held else 0
        clearance[k] = rows[place, CLEARANCE] if held else np.nan
        distance[k] = rows[place, WITNESS] if held else np.nan
    near = np.concatenate(pieces) if pieces else np.zeros((0, NEAR_WIDTH))
    owner = np.repeat(np.arange(count), sizes)
    return near, owner, clearance, distance, whole


def column(frames: list[Frame], name: str) -> Floats:
    """A number of each frame."""
    values: list[Any] = [getattr(frame, name) for frame in frames]
    return np.array(values, dtype=np.float64)
