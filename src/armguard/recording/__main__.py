"""The recorder as a process: `python -m armguard.recording`."""

import argparse
import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.processes import end_with, interrupted, wait_for
from armguard.recording.counters import (
    CountersError,
    CountersReader,
    counters_path,
)
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.ring import RingReader
from armguard.recording.rings import lives

UNITS = {"": 1, "k": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def size(text: str) -> int:
    """Bytes, as 500M or 20G."""
    number, unit = text.rstrip("kMGTB"), text.removesuffix("B").lstrip("0123456789.")
    if unit not in UNITS:
        raise argparse.ArgumentTypeError(f"{text!r} is no size; write 500M or 20G")
    return int(float(number) * UNITS[unit])


# Options that are settings of the recorder.
OPTIONS: dict[str, Callable[[str], Any]] = {
    **{"keep_near": int, "keep_near_size": size, "file_size": size},
    **dict.fromkeys(("file_time", "before", "after"), float),
    **dict.fromkeys(("near_headroom", "near_time_left"), float),
}


def main() -> int:
    """Record until the ring is closed or a signal comes."""
    own = RecorderSettings()
    parser = argparse.ArgumentParser("armguard.recording", description=__doc__)
    parser.add_argument("--ring", type=Path, required=True, help="the service's ring")
    parser.add_argument("--folder", type=Path, required=True, help="for recordings")
    parser.add_argument("--keep", type=size, default=own.keep, help="all of them")
    for option, kind in OPTIONS.items():
        default = getattr(own, option.removeprefix("near_"))
        flag = "--" + option.replace("_", "-")
        parser.add_argument(flag, type=kind, default=default)
    parser.add_argument("--wait", type=float, default=10.0, help="for the ring [s]")
    parser.add_argument(
        "--parent", type=int, help="ends with this process; with the ring's service"
    )
    options = parser.parse_args()
    logging.basicConfig(format="recorder: %(message)s", level=logging.INFO)
    given = {name.removeprefix("near_"): getattr(options, name) for name in OPTIONS}
    settings = RecorderSettings(keep=options.keep, **given)
    with interrupted() as ended:
        try:
            ring = wait_for(lambda: RingReader(options.ring), options.wait, ended)
        except ArmguardError as error:
            print(f"recorder: {error}", file=sys.stderr)
            return 2
        parent = options.parent or service_of(options.ring)
        if parent is not None:
            end_with(parent)

        def ends() -> bool:
            return ended.is_set() or (parent is not None and not lives(parent))

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
