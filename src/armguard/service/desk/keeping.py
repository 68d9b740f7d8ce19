"""A cycle of the service as the ring keeps it, see `armguard.recording.frames`."""

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.recording.frames import (
    ASKED,
    CYCLE,
    CYCLE_TIME,
    DATA,
    ENDED,
    FORM,
    HAS_VELOCITY,
    HEADER,
    JOINTS,
    KIND,
    MONOTONIC,
    NOW,
    POSES,
    RECEIVED,
    ROBOTS,
    TEXT,
    TOLD,
    VERDICT,
    WALL,
    Kind,
)
from armguard.service.desk.desk import (
    Longs,
    open_desk,
)

Floats = NDArray[np.float64]

OF_CYCLE = int(Kind.CYCLE)


@kernel(inline=False, entry=True)
def write_frame(
    desk: Longs, row: Floats, poses: Floats, monotonic: float, wall: float, text: int
) -> None:
    """Fill in a cycle's frame, all but its text.

    Args:
        desk: Ledger of a desk, after `judge`.
        row: The frame.
        poses: Poses of all bodies one after another, shape (12 b,).
        monotonic: Time on the monotonic clock [s].
        wall: Time on the wall clock [s].
        text: Length of the text that follows [bytes].
    """
    d = open_desk(desk)
    cycle = d.cycle
    n, robots = d.q.shape[0], d.stamps.shape[0]
    for k in range(HEADER):
        row[k] = 0.0
    row[KIND], row[CYCLE] = OF_CYCLE, cycle.number
    row[MONOTONIC], row[WALL] = monotonic, wall
    row[FORM], row[NOW] = cycle.asked_form, cycle.start * 1e-9
    row[HAS_VELOCITY] = d.arrival.measured
    began = cycle.began_at
    row[RECEIVED] = began * 1e-9 if began != 0 else np.nan
    row[ENDED] = cycle.ended * 1e-9
    row[CYCLE_TIME] = (cycle.ended - cycle.start) * 1e-9
    row[JOINTS], row[ROBOTS], row[ASKED] = n, robots, cycle.asked_count
    row[TOLD], row[VERDICT] = d.command.shape[0], cycle.used
    row[POSES], row[TEXT], row[DATA] = poses.shape[0], text, 0.0
    at = HEADER
    at = put(d.q, n, row, at)
    if d.arrival.measured != 0:
        at = put(d.velocity, n, row, at)
    else:
        for j in range(n):
            row[at + j] = 0.0
        at += n
    at = put(d.stamps, robots, row, at)
    at = put(d.asked, cycle.asked_count, row, at)
    at = put(d.command, d.command.shape[0], row, at)
    at = put(d.out, cycle.used, row, at)
    put(poses, poses.shape[0], row, at)


@kernel
def put(numbers: Floats, count: int, row: Floats, at: int) -> int:
    """Copy numbers into a row; the place behind them."""
    for k in range(count):
        row[at + k] = numbers[k]
    return at + count
