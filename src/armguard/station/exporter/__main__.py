"""The exporter as a process: `python -m armguard.station.exporter`."""

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from armguard.errors import ArmguardError
from armguard.station.errors import StationError
from armguard.station.exporter.collector import registry_of
from armguard.station.exporter.page import Page
from armguard.station.ring import RingReader
from armguard.station.service.counters import HEAD, CountersReader, counters_path

Thing = TypeVar("Thing")

# How often it is looked whether the service is still there [s].
LOOK = 0.5

# Place of the process in the head of counters.
PROCESS = 4


def main() -> int:
    """Serve metrics until the service ends, or somebody ends this."""
    parser = argparse.ArgumentParser("armguard.station.exporter", description=__doc__)
    parser.add_argument("--ring", type=Path, required=True, help="the service's ring")
    parser.add_argument("--counters", type=Path, help="its counters; beside the ring")
    parser.add_argument("--port", type=int, required=True, help="to serve on, loopback")
    parser.add_argument("--wait", type=float, default=10.0, help="for the service [s]")
    options = parser.parse_args()
    ended = threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda number, frame: ended.set())
    end = time.monotonic() + options.wait
    try:
        path = options.counters or counters_path(options.ring)
        ring = awaited(lambda: RingReader(options.ring), end, ended)
        counters = awaited(lambda: CountersReader(path), end, ended)
        process = process_of(path)
        with Page(registry_of(counters, ring, process), options.port) as page:
            print(f"metrics at http://127.0.0.1:{page.port}/metrics", flush=True)
            while not ended.wait(LOOK):
                if ring.closed or not alive(process):
                    break
    except ArmguardError as error:
        print(f"exporter: {error}", file=sys.stderr)
        return 2
    return 0


def awaited(open_it: Callable[[], Thing], end: float, ended: threading.Event) -> Thing:
    """What a service that is being started will have made soon.

    Args:
        open_it: Opens it.
        end: When to give up, monotonic [s].
        ended: Whether to give up at once.

    Raises:
        StationError: It is not there in time.
    """
    while True:
        try:
            return open_it()
        except StationError:
            if time.monotonic() > end or ended.wait(LOOK):
                raise


def process_of(path: Path) -> int:
    """The process that writes counters, from their head."""
    return int(np.fromfile(path, np.int64, HEAD)[PROCESS])


def alive(process: int) -> bool:
    """Whether a process is there."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


if __name__ == "__main__":
    sys.exit(main())
