"""`python noise.py FILE`: floods a reflex and its listeners; none of it counts."""

import os
import random
import socket
import sys
import time
from pathlib import Path

from armguard.chaos.zone_sensor import WALL, frame_of
from armguard.reflex import MEASURED, PULSE, RESET, SEAL, read_settings

# Time from message to message [s].
EVERY = 5e-4


def main() -> None:
    """Flood until it is ended."""
    given, rng = read_settings(Path(sys.argv[1])), random.Random(0)
    wrong = os.urandom(SEAL)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        while True:
            frame = frame_of(999, 1, time.monotonic_ns(), [(int(WALL), MEASURED)] * 64)
            for data, port in (
                (rng.randbytes(rng.randrange(1, 1500)), given["port"]),
                (frame, given["port"]),
                (rng.randbytes(RESET.size) + wrong, given["port"]),
                *((rng.randbytes(PULSE.size) + wrong, p) for p in given["listeners"]),
            ):
                one.sendto(data, ("127.0.0.1", port))
                time.sleep(EVERY)


main()
