"""Rings by name: where a new one goes, and what killed services left behind."""

import os
import re
import time
from contextlib import suppress
from pathlib import Path

from armguard.recording.ring import in_memory

# A ring named by port and process, or what is beside it of its counters and recorder.
NAME = re.compile(r"armguard-(\d+)-(\d+)(\.counters|\.recorder)?")

# For that long what a killed service left behind may be looked at [s].
KEPT = 3600.0


def new_ring(port: int) -> Path:
    """Where the ring of this process goes; rings that are not needed are removed.

    A service that was killed could not remove its ring. It stays until one is started
    on the same port, or for an hour.

    Args:
        port: Port of the service.
    """
    folder = in_memory()
    for path in folder.glob("armguard-*"):
        found = NAME.fullmatch(path.name)
        if found is None or lives(int(found[2])):
            continue
        with suppress(OSError):
            old = time.time() - path.stat().st_mtime > KEPT
            if old or int(found[1]) == port:
                path.unlink()
    return folder / f"armguard-{port}-{os.getpid()}"


def was_killed(port: int, ring: Path | None = None) -> bool:
    """Whether the last service on a port was killed.

    Such a service leaves its ring behind.

    Args:
        port: The port.
        ring: File of its ring, if that is not named after port and process.
    """
    if ring is not None:
        return ring.exists()
    left = map(NAME.fullmatch, (path.name for path in in_memory().glob("armguard-*")))
    return any(
        int(found[1]) == port and not lives(int(found[2])) for found in left if found
    )


def lives(process: int) -> bool:
    """Whether there is a process of that number."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True
