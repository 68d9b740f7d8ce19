"""`python witness.py FILE CPU`: when this machine ran nothing on a processor.

It sleeps a millisecond, again and again, before every other process of the processor. A
sleep that is longer is a pause of the machine, of which FILE keeps end and length [ns].
"""

import mmap
import os
import sys
import time
from pathlib import Path
from struct import Struct

# End and length of a pause [ns]; pauses that are kept of each processor.
PAUSE, KEPT = Struct("<qq"), 256
SIZE = KEPT * PAUSE.size

# Sleep, and from where on it was too long [ns].
SLEEP, PAUSED = 1_000_000, 500_000
PRIORITY = 80


def pauses(file: Path, start: int, end: int) -> int:
    """Time for which any processor paused between two times [ns].

    Args:
        file: What the witnesses write.
        start: Monotonic [ns].
        end: Likewise.
    """
    kept = PAUSE.iter_unpack(file.read_bytes())
    return sum(
        max(min(end, until) - max(start, until - length), 0) for until, length in kept
    )


def main() -> None:
    """Watch until it is ended."""
    cpu = int(sys.argv[2])
    os.sched_setaffinity(0, {cpu})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    with Path(sys.argv[1]).open("r+b") as file:
        room = mmap.mmap(file.fileno(), 0)
    count, before = 0, time.monotonic_ns()
    while True:
        time.sleep(SLEEP * 1e-9)
        now = time.monotonic_ns()
        length, before = now - before - SLEEP, now
        if length > PAUSED:
            PAUSE.pack_into(room, cpu * SIZE + count % KEPT * PAUSE.size, now, length)
            count += 1


if __name__ == "__main__":
    main()
