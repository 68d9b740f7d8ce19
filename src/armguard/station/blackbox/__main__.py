"""The recorder as a process: `python -m armguard.station.blackbox`."""

import argparse
import logging
import signal
import sys
from pathlib import Path

from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.station.blackbox.recorder import (
    Recorder,
    RecorderSettings,
    wait_for_ring,
)
from armguard.station.processes import end_with
from armguard.station.service.counters import (
    CountersError,
    CountersReader,
    counters_path,
)
from armguard.station.service.rings import lives

UNITS = {"": 1, "k": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def size(text: str) -> int:
    """Bytes, as 500M or 20G."""
    number, unit = text.rstrip("kMGTB"), text.removesuffix("B").lstrip("0123456789.")
    if unit not in UNITS:
        raise argparse.ArgumentTypeError(f"{text!r} is no size; write 500M or 20G")
    return int(float(number) * UNITS[unit])


def main() -> int:
    """Record until the ring is closed or somebody ends it."""
    own = RecorderSettings()
    parser = argparse.ArgumentParser("armguard.station.blackbox", description=__doc__)
    parser.add_argument("--ring", type=Path, required=True, help="the service's ring")
    parser.add_argument("--folder", type=Path, required=True, help="for recordings")
    parser.add_argument("--keep", type=size, default=own.keep, help="all of them")
    parser.add_argument("--keep-near", type=int, default=own.keep_near)
    parser.add_argument("--keep-near-size", type=size, default=own.keep_near_size)
    parser.add_argument("--file-size", type=size, default=own.file_size)
    parser.add_argument("--file-time", type=float, default=own.file_time)
    parser.add_argument("--before", type=float, default=own.before)
    parser.add_argument("--after", type=float, default=own.after)
    parser.add_argument("--near-clearance", type=float, default=own.clearance)
    parser.add_argument("--near-slack", type=float, default=own.slack)
    parser.add_argument("--wait", type=float, default=10.0, help="for the ring [s]")
    parser.add_argument(
        "--parent", type=int, help="ends with this process; with the ring's service"
    )
    options = parser.parse_args()
    logging.basicConfig(format="recorder: %(message)s", level=logging.INFO)
    ended: list[int] = []
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda number, _: ended.append(number))
    settings = RecorderSettings(
        keep=options.keep,
        keep_near=options.keep_near,
        keep_near_size=options.keep_near_size,
        file_size=options.file_size,
        file_time=options.file_time,
        before=options.before,
        after=options.after,
        clearance=options.near_clearance,
        slack=options.near_slack,
    )
    try:
        ring = wait_for_ring(options.ring, options.wait)
    except ArmguardError as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 2
    parent = options.parent or service_of(options.ring)
    if parent is not None:
        end_with(parent)

    def ends() -> bool:
        return bool(ended) or (parent is not None and not lives(parent))

    Recorder(options.folder, settings).run(ring, ends)
    return 0


def service_of(ring: Path) -> int | None:
    """The process that writes a ring, by its counters; None if that is not known."""
    try:
        return CountersReader(counters_path(ring)).process
    except CountersError:
        return None


if __name__ == "__main__":
    run_program(main, "recorder:")
