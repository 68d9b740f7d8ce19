"""The exporter as a process: `python -m armguard.station.exporter`."""

import argparse
import signal
import sys
import threading
import time
from pathlib import Path

from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.station.errors import StationError
from armguard.station.exporter.collector import registry_of
from armguard.station.exporter.page import start_page
from armguard.station.ring import RingReader
from armguard.station.service.counters import CountersReader, counters_path
from armguard.station.service.rings import lives

# How often it is looked whether the service is still there [s].
LOOK = 0.5


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
    path = options.counters or counters_path(options.ring)
    try:
        ring, counters = opened(options.ring, path, options.wait, ended)
        process = counters.process
        page = start_page(registry_of(counters, ring, process), options.port)
        print(f"metrics at http://127.0.0.1:{page.server_port}/metrics", flush=True)
        while not (ended.wait(LOOK) or ring.closed) and lives(process):
            pass
        page.shutdown()
    except ArmguardError as error:
        print(f"exporter: {error}", file=sys.stderr)
        return 2
    return 0


def opened(
    ring: Path, counters: Path, patience: float, ended: threading.Event
) -> tuple[RingReader, CountersReader]:
    """Ring and counters, which a service that is being started will have made soon.

    Args:
        ring: Its ring.
        counters: Its counters.
        patience: When to give up [s].
        ended: Whether to give up at once.

    Raises:
        StationError: They are not there in time.
    """
    end = time.monotonic() + patience
    while True:
        try:
            return RingReader(ring), CountersReader(counters)
        except StationError:
            if time.monotonic() > end or ended.wait(LOOK):
                raise


if __name__ == "__main__":
    run_program(main, "exporter:")
