"""Joint positions and frames in a file, to be sensed again.

A file is a sequence of events. Each is a header and up to two arrays, all in the format
of NumPy's `.npy` files, one after the other.
"""

from collections.abc import Iterator
from io import BufferedIOBase
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import RecordingError

# A header: what the event is, the name of the sensor, its stamp and its arrays.
HEADER = np.dtype([("event", "u1"), ("name", "U64"), ("stamp", "f8"), ("arrays", "u1")])

# Events: joint positions; frames by their form; the pose of a sensor in the world.
JOINTS, ZONES, DEPTH, POINTS, RANGE, POSE, INFRARED, CAPACITIVE = range(8)

# Arrays of an event, and numbers of one of them at most.
MOST_ARRAYS, MOST_NUMBERS = 2, 1 << 24


class Event(NamedTuple):
    """An event of a file.

    Attributes:
        event: One of JOINTS to CAPACITIVE.
        name: Name of the sensor; "" for joint positions.
        stamp: Its stamp [s].
        arrays: Positions; distances and perhaps their status; depths; points; one
            distance or signal; or a transform.
    """

    event: int
    name: str
    stamp: float
    arrays: list[NDArray[Any]]


def write_event(
    file: BufferedIOBase, event: int, name: str, stamp: float, *arrays: ArrayLike | None
) -> None:
    """Append an event; arrays that are no numbers, or None, are left out."""
    found = [numbers for one in arrays if (numbers := numbers_of(one)) is not None]
    header = np.array((event, name[:64], stamp, len(found)), dtype=HEADER)
    for one in (header, *found):
        np.save(file, one, allow_pickle=False)


def numbers_of(values: ArrayLike | None) -> NDArray[Any] | None:
    """Values as an array of numbers, None if they are none."""
    try:
        found = np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        return None
    return found if found.dtype.kind in "biufc" else None


def read_events(path: Path) -> Iterator[Event]:
    """The events of a file, in their order; what was not written wholly is left out.

    Raises:
        RecordingError: It cannot be read, or is no such file.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            while file.tell() < size:
                try:
                    event = read_event(file)
                except EOFError:
                    return
                yield event
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise RecordingError(f"{path} is no file of frames: {error}") from None


def read_event(file: Any) -> Event:
    """The next event.

    Raises:
        ValueError: It is none.
        EOFError: The file ends in it.
    """
    header = read_array(file)
    if header.dtype != HEADER or header.shape != ():
        raise ValueError("an event has no header")
    event, name, stamp, count = header.tolist()
    if event > CAPACITIVE or count > MOST_ARRAYS:
        raise ValueError(f"event {event} with {count} arrays is unknown")
    return Event(event, name, stamp, [read_array(file) for _ in range(count)])


def read_array(file: Any) -> NDArray[Any]:
    """The next array, if it is not too large.

    Raises:
        ValueError: It is none.
        EOFError: The file ends in it.
    """
    start = file.tell()
    if not file.read(1):
        raise EOFError
    file.seek(start)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise ValueError(f"version {version} of an array is unknown")
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    count = int(np.prod(shape, dtype=np.int64))
    if not 0 <= count <= MOST_NUMBERS or dtype.hasobject:
        raise ValueError(f"an array of {count} numbers of {dtype} is not allowed")
    data = file.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise EOFError
    return np.frombuffer(data, dtype=dtype).reshape(shape)
