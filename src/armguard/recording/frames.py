"""What the loop writes into its ring: every cycle, and everything else that happens.

A frame is a row of float64, so that a recording gives back the very bits of what went
in and of what came out:

    header (HEADER) | q (n) | velocity (n) | stamps (r) | asked (k) | told (t) |
    verdict (v) | poses (12 b) | text (UTF-8) | data

Text and data are bytes, padded to whole words.

A frame that is no cycle has only a header, a text and data.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import indices

Floats = NDArray[np.float64]


class Header(NamedTuple):
    """Header of a frame; whole numbers are float64 too, as recordings hold them."""

    kind: float  # see `Kind`
    cycle: float  # number of the cycle; of what is no cycle, of the next one
    monotonic: float  # when it was written, on the machine's monotonic clock [s]
    wall: float  # the same on its wall clock [s]
    form: float  # see `Form`
    now: float  # time of the cycle that the guard was given, NaN if none [s]
    has_velocity: float  # 1 if velocities were measured
    received: float  # when the cycle's request came in, monotonic, NaN if unknown [s]
    ended: float  # when the cycle had been judged, monotonic [s]
    cycle_time: float  # what judging it took [s]
    # Lengths of the sections that follow, in words; of text and data in bytes.
    joints: float
    robots: float
    asked: float
    told: float
    verdict: float
    poses: float
    text: float
    data: float


# Words of the header, and the index of each field.
HEADER, IN_FRAME = len(Header._fields), indices(Header)


class Kind(IntEnum):
    """What a frame is about."""

    CYCLE = 1
    """A cycle: what went in, what came out."""

    EVENT = 2
    """Something done to the guard between two cycles, as a call with arguments."""

    CHECKPOINT = 3
    """All that the guard remembers, see `armguard.guard.checkpoint`."""

    NOTE = 4
    """A remark, which changes nothing."""


class Form(IntEnum):
    """Form of the request to a cycle."""

    STEP = 0
    """Nothing: `step`."""

    VELOCITIES = 1
    POSITIONS = 2
    TWISTS = 3
    """Rows of six; the text names the tools."""

    STOP = 4
    """The number of the `Reason` for which robots are to stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """A frame that was read."""

    kind: Kind
    cycle: int
    monotonic: float  # when it was written, on the monotonic clock [s]
    wall: float  # the same on the wall clock [s]
    form: Form  # what was asked of the cycle
    now: float | None  # time of the cycle; None if it was not given [s]
    received: float  # when what was asked came in, monotonic; else NaN [s]
    ended: float  # when the cycle had been judged, monotonic [s]
    cycle_time: float  # what judging it took [s]
    q: Floats  # measured joint positions, shape (n,) [rad or m]
    velocity: Floats | None  # measured; None if there were none, shape (n,)
    stamps: Floats  # of each robot; NaN where there was none, shape (r,) [s]
    asked: Floats  # shape (n,), or (6 k,) of k twists, or (1,) of a stop
    told: Floats  # the command, as `Command` cuts it
    verdict: Floats  # numbers of the verdict, see `armguard.guard.layout`
    # Poses of all bodies that were judged, see `Monitor.poses`, shape (b, 12).
    poses: Floats
    # Words: of a cycle what was wrong with its input and the tools that its request
    # named, of an event its name and arguments.
    text: Mapping[str, Any]
    # Bytes: of a checkpoint what `Guard.checkpoint` gave, of a scene's note the scene,
    # of a recorded cycle its digest.
    data: bytes


def frame_of(row: Floats) -> Frame:
    """The frame a row holds; its arrays are views of the row.

    Raises:
        ValueError: The row is no frame.
    """
    if len(row) < HEADER:
        raise ValueError(f"a frame of {len(row)} numbers has no header")
    head = Header(*row[:HEADER].tolist())
    kind = Kind(int(head.kind))
    size, more = int(head.text), int(head.data)
    ends = sections(row)
    whole = ends[-1] + words(size) + words(more)
    if sorted(ends) != ends or min(size, more) < 0 or whole != len(row):
        raise ValueError(f"a frame of {len(row)} numbers declares another length")
    q, velocity, stamps, asked, told, verdict, poses = (
        row[start:end] for start, end in pairwise(ends)
    )
    text = row[ends[-1] :].tobytes()[:size]
    return Frame(
        kind=kind,
        cycle=int(head.cycle),
        monotonic=head.monotonic,
        wall=head.wall,
        form=Form(int(head.form)),
        now=None if np.isnan(head.now) else head.now,
        received=head.received,
        ended=head.ended,
        cycle_time=head.cycle_time,
        q=q,
        velocity=velocity if head.has_velocity else None,
        stamps=stamps,
        asked=asked,
        told=told,
        verdict=verdict,
        poses=poses.reshape(-1, 12),
        text=json.loads(text) if size else {},
        data=row[ends[-1] + words(size) :].tobytes()[:more],
    )


def sections(row: Floats) -> list[int]:
    """Where q, velocity, stamps, asked, told, verdict, poses and the text begin."""
    n, *lengths = map(int, row[IN_FRAME.joints : IN_FRAME.text].tolist())
    return [*accumulate((n, n, *lengths), initial=HEADER)]


def words(size: int) -> int:
    """Words that hold a number of bytes."""
    return (size + 7) // 8


def text_frame(
    kind: Kind,
    cycle: int,
    monotonic: float,
    wall: float,
    text: Mapping[str, Any],
    data: bytes = b"",
    room: Callable[[int], Floats] = np.zeros,
) -> Floats:
    """The row of a frame that is no cycle.

    Args:
        kind: What it is about.
        cycle: Number of the next cycle.
        monotonic: Time on the monotonic clock [s].
        wall: Time on the wall clock [s].
        text: Words.
        data: Bytes.
        room: Gives the row to write to, by its length.
    """
    encoded = text_of(text)
    ends = HEADER + words(len(encoded))
    row = room(ends + words(len(data)))
    row[:HEADER] = 0.0
    row[:4] = kind, cycle, monotonic, wall
    row[[IN_FRAME.now, IN_FRAME.received, IN_FRAME.ended]] = np.nan
    row[[IN_FRAME.text, IN_FRAME.data]] = len(encoded), len(data)
    put_text(encoded, row[HEADER:ends])
    put_text(data, row[ends:])
    return row


def text_of(text: Mapping[str, Any]) -> bytes:
    """The bytes of a text."""
    return json.dumps(text, default=as_json).encode()


def as_json(value: Any) -> Any:
    """A value of NumPy as JSON has it; of anything else how it is written."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value)


def put_text(data: bytes, room: Floats) -> None:
    """Write bytes into the words of a row, and zeros behind them."""
    places = room.view(np.uint8)
    places[: len(data)] = np.frombuffer(data, np.uint8)
    places[len(data) : 8 * words(len(data))] = 0
