"""A cycle of the service as the ring keeps it, see `armguard.recording.frames`."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, pointer
from armguard.kernel import kernel
from armguard.record import dtype_of
from armguard.recording.frames import HEADER, Header, Kind
from armguard.service.desk.desk import Longs, open_desk

Floats = NDArray[np.float64]

OF_CYCLE, FRAME = int(Kind.CYCLE), dtype_of(Header)


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
    head = array_at(pointer(row.ctypes.data), (1,), FRAME)[0]
    head["kind"], head["cycle"] = OF_CYCLE, cycle.number
    head["monotonic"], head["wall"] = monotonic, wall
    head["form"], head["now"] = cycle.asked_form, cycle.start * 1e-9
    head["has_velocity"] = d.arrival.measured
    head["received"] = cycle.began_at * 1e-9 if cycle.began_at != 0 else np.nan
    head["ended"] = cycle.ended * 1e-9
    head["cycle_time"] = (cycle.ended - cycle.start) * 1e-9
    head["joints"], head["robots"], head["asked"] = n, robots, cycle.asked_count
    head["told"], head["verdict"] = d.command.shape[0], cycle.used
    head["poses"], head["text"], head["data"] = poses.shape[0], text, 0.0
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
