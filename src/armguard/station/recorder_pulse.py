"""Whether a ring is being recorded: when the recorder last said so, beside the ring."""

import os
import struct
import time
from contextlib import suppress
from pathlib import Path

# The monotonic clock, which on one machine is the same for all processes [s].
TIME = struct.Struct("<d")


def pulse_path(ring: Path) -> Path:
    """Where the recorder of a ring says that it records."""
    return ring.with_name(ring.name + ".recorder")


def beat(ring: Path) -> None:
    """Say that all that was in the ring is recorded; for the recorder."""
    # Where there is no room for it, its age says so.
    with suppress(OSError):
        flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW
        handle = os.open(pulse_path(ring), flags, 0o600)
        try:
            os.pwrite(handle, TIME.pack(time.monotonic()), 0)
        finally:
            os.close(handle)


def end_pulse(ring: Path) -> None:
    """Say that nothing is recorded any more, and that this is as it should be."""
    with suppress(OSError):
        pulse_path(ring).unlink()


def recorder_age(ring: Path) -> float | None:
    """How long ago the recorder of a ring last wrote all there was [s].

    It says so twice a second while its disk takes what it writes. None if no recorder
    has begun, or the last one ended when it was told to.
    """
    try:
        data = pulse_path(ring).read_bytes()
    except OSError:
        return None
    if len(data) != TIME.size:
        return None
    age: float = time.monotonic() - TIME.unpack(data)[0]
    return max(age, 0.0)
