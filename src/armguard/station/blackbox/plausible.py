"""Checks of a recording before it is used: it is untrusted input.

Sizes are checked before memory is allocated. A frame with impossible contents is left
out, as a damaged one is; any other error becomes one sentence.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.guard import layout
from armguard.station.errors import RecordingError
from armguard.station.frames import Form, Frame, Kind, frame_of

Floats = NDArray[np.float64]

# Bytes of an attachment; a larger one is none of ours.
MOST_ATTACHED = 64 << 20

# Latest time of a clock [s]: a few hundred years.
LATEST = 1e10

# Cycles are counted exactly up to here.
MOST_CYCLES = 1 << 53

# Joints and robots of a scene.
MOST_NAMES = 4096

# Places of an answer that hold whole numbers.
WHOLE_PLACES = (
    layout.REASON,
    layout.JOINT,
    layout.ROBOT,
    layout.NEAREST,
    layout.NEAR_COUNT,
)


@contextmanager
def reading(what: object) -> Iterator[None]:
    """Turn any error of reading a recording of that name into one sentence.

    Raises:
        RecordingError: Something in it is not what it should be.
    """
    try:
        yield
    except ArmguardError:
        raise
    except Exception as error:  # the bytes may be anything
        raise RecordingError(
            f"{what}: something in it is not what a recording holds "
            f"({type(error).__name__}: {error})"
        ) from error


def unpacked(data: bytes, size: int) -> bytes:
    """Compressed bytes, which are `size` bytes long.

    Raises:
        ValueError: They are damaged, or of another length.
    """
    try:
        # The library allocates the length that the data itself declares.
        said = zstandard.get_frame_parameters(data).content_size
        if said not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(
                f"{said} bytes are compressed where there should be {size}"
            )
        raw: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error
    if len(raw) != size:
        raise ValueError(f"{len(raw)} bytes were compressed and should be {size}")
    return raw


def about_of(text: bytes) -> dict[str, Any]:
    """The metadata of a recording.

    Raises:
        ValueError: They are not as a recorder writes them.
    """
    try:
        about = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is no JSON: {error}") from error
    if not isinstance(about, dict):
        raise ValueError("it is no mapping")
    for key in ("names", "robots"):
        names = about.get(key, [])
        if not are_names(names) or len(names) > MOST_NAMES:
            raise ValueError(f"'{key}' are no names")
    period, budget = about.get("period", 1.0), about.get("budget", 1)
    if type(period) not in (int, float) or not 0.0 <= period <= LATEST:
        raise ValueError(f"'period' is {period!r}")
    if type(budget) is not int or not 1 <= budget <= MOST_CYCLES:
        raise ValueError(f"'budget' is {budget!r}")
    return about


def are_names(found: object) -> bool:
    """Whether a value is a list of strings."""
    return isinstance(found, list) and all(isinstance(name, str) for name in found)


def plausible_frame(row: Floats, joints: int, robots: int) -> Frame:
    """The frame of a row; numbers of joints and robots are 0 if they are not known.

    Raises:
        ValueError: The row is none, or its contents are impossible.
    """
    try:
        frame = frame_of(row)
    except (OverflowError, RecursionError) as error:
        raise ValueError(str(error)) from error
    if not isinstance(frame.text, dict):
        raise ValueError("its text is no mapping")
    for name in ("monotonic", "wall"):
        if not abs(getattr(frame, name)) <= LATEST:
            raise ValueError(f"its {name} clock says {getattr(frame, name)} s")
    if not 0 <= frame.cycle <= MOST_CYCLES:
        raise ValueError(f"it is of cycle {frame.cycle}")
    if frame.kind is Kind.CYCLE:
        check_cycle(frame, joints or len(frame.q), robots or len(frame.stamps))
    return frame


def check_cycle(frame: Frame, joints: int, robots: int) -> None:
    """Check the frame of a cycle.

    Raises:
        ValueError: Its contents are impossible.
    """
    asked = joints
    if frame.form is Form.TWISTS:
        tools = frame.text.get("tools", [])
        if not are_names(tools):
            raise ValueError("its tools are no names")
        asked = 6 * len(tools)
    elif frame.form is Form.STOP:
        asked = 1
    counts = (len(frame.q), len(frame.stamps), len(frame.asked), len(frame.told))
    wanted = (joints, robots, asked, 4 * joints + 4 * robots)
    steps = frame.form is Form.STEP
    for k, (count, right) in enumerate(zip(counts, wanted, strict=True)):
        if count != right and not (steps and k >= 2 and not count):
            raise ValueError(f"it has {count} numbers where {right} belong")
    times = frame.received, frame.ended, frame.cycle_time
    if any(abs(time) > LATEST for time in times):
        raise ValueError(f"its times are {times} s")
    answer = frame.verdict
    if len(answer) < layout.HEADER:
        raise ValueError(f"its answer has {len(answer)} numbers")
    numbers = answer[list(WHOLE_PLACES)]
    if not (np.abs(numbers) <= MOST_CYCLES).all() or (numbers % 1.0).any():
        raise ValueError("its answer counts in parts")
