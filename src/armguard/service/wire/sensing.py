"""Messages of sensors and of the map, byte for byte, see `layout`.

Frames go from sensors to the process of the map, changes from there to the service,
and health from there over the service to all clients.
"""

from typing import Annotated, NamedTuple

from armguard.service.wire.layout import (
    F64,
    HEADER,
    MOST,
    SEAL,
    U8,
    U16,
    U32,
    U64,
    Layout,
)

TwoWords = Annotated[bytes, "(2,)<u8"]
I32 = Annotated[int, "<i4"]
Words = Annotated[bytes, "(160,)u1"]


class FramePart(NamedTuple):
    """Then bytes of the frame, 8000 in each part but the last."""

    sensor: U16  # sensor: its place in `sensors` of the WELCOME
    part: U16  # part, from 0
    distances: U8  # its values: 1 for f32 (distances and points [m]), 2 for u16 [mm]
    has_status: U8  # 1 if a u8 for the status of each follows all values
    reserved: U16  # 0
    number: U32  # number: rises from frame to frame of a sensor
    size: U32  # length of the whole frame [bytes]
    stamp: F64  # its stamp, on the service's monotonic clock [s]


class Health(NamedTuple):
    """Then a row for each of some sensors, in the order of the scene."""

    stamp: F64  # newest measurement in the map; minus infinity without any [s]
    taken: U64  # frames that were taken
    dropped: U64  # frames, and messages of senders, that were dropped
    port: U16  # port on loopback that takes FRAMEs
    first: U16  # place of the first sensor that follows
    rows: U16  # sensors that follow
    sensors: U16  # sensors of the scene


class SensorRow(NamedTuple):
    """A sensor in a HEALTH."""

    faults: U32  # its faults: bit k for fault k of [sense.md](sense.md#faults), from 0
    frees: U32  # 1 if it frees space
    taken: U64  # frames that were taken
    dropped: U64  # frames that were dropped
    stamp: F64  # stamp of its last usable frame; minus infinity without any [s]
    words: Words  # its state in words, UTF-8, zeros behind them


class Cells(NamedTuple):
    """Then changes of the map."""

    stream: U64  # random for each map, not 0
    number: U64  # number: 1 for the first CELLS of a map, then one more each time
    stamp: F64  # when all claims of the map hold, with these changes [s]


class Change(NamedTuple):
    """A change in a CELLS: the claims about a word of 4³ cells."""

    bits: TwoWords  # its occupied cells, its unknown cells
    stamp: F64  # since when all of its claims hold at least [s]
    error: F64  # greatest error of the poses they were seen from [m]
    word: I32  # number of the word, see [cells.md](cells.md)
    motion: I32  # motion of its occupied cells: 0 still, 1 moving
    source: I32  # the sensor that looked last, from 1 on; 0 none, 255 several
    zero: I32  # 0


class CellsTaken(NamedTuple):
    """The answer to a CELLS."""

    stream: U64  # stream of the CELLS
    number: U64  # number of the last CELLS of it that was taken; 0 for none


FRAME, HEALTH, SENSOR = Layout(FramePart), Layout(Health), Layout(SensorRow)
CELLS, CHANGE, CELLS_TAKEN = Layout(Cells), Layout(Change), Layout(CellsTaken)

# Bytes of a frame in one part, and parts of a frame at most.
FRAME_PART, MOST_PARTS = 8000, 8192

# Kinds of distances: metres, millimetres.
METRES, MILLIMETRES = 1, 2

# Changes in a CELLS, and those that the guard takes in a cycle, at most.
MOST_CHANGES = (MOST - HEADER.size - SEAL - CELLS.size) // CHANGE.size
MOST_IN_A_CYCLE = 512

# Rows of sensors in a HEALTH at most.
MOST_ROWS = (MOST - HEADER.size - SEAL - HEALTH.size) // SENSOR.size
