"""`python -m armguard.chaos.zone_sensor`: a zone sensor that sees a bare wall.

SIGUSR1 puts an object before it, SIGUSR2 takes it away.
"""

import argparse
import random
import signal
import socket
import time
from collections.abc import Iterable
from pathlib import Path
from struct import pack
from zlib import crc32

from armguard.entry import run_program
from armguard.errors import StationError
from armguard.reflex import (
    CRC,
    FRAME,
    FRAME_MAGIC,
    MEASURED,
    ZONE,
    Sensor,
    read_settings,
)

# Distance of wall and object, and the noise of both [mm].
WALL, OBJECT, NOISE = 400.0, 50.0, 3.0


def frame_of(
    sensor: int, counter: int, stamp: int, zones: Iterable[tuple[int, int]]
) -> bytes:
    """The frame of a sensor, see docs/reflex.md.

    Args:
        sensor: Its id.
        counter: Rises from frame to frame, modulo 2**32.
        stamp: When it was measured, on CLOCK_MONOTONIC [ns].
        zones: Distance [mm] and status of each.
    """
    rows = b"".join(pack(ZONE, *zone) for zone in zones)
    body = FRAME.pack(FRAME_MAGIC, sensor, len(rows) // 4, counter, stamp) + rows
    return body + CRC.pack(crc32(body))


class ZoneSensor:
    """Sends frames of one sensor to a reflex.

    Attributes:
        near: Whether an object is before it.

    Args:
        port: Port of the reflex.
        sensor: Its settings.
        period: Time from frame to frame [s].
    """

    def __init__(self, port: int, sensor: Sensor, period: float) -> None:
        self.near = False
        self._sensor, self._period = sensor, int(period * 1e9)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._rng = random.Random(sensor.id)
        self._counter, self._due = 0, time.monotonic_ns()

    def frame(self) -> bytes:
        """The next frame."""
        middle = OBJECT if self.near else WALL
        zones = [
            (max(round(self._rng.gauss(middle, NOISE)), 0), MEASURED)
            for _ in self._sensor.thresholds
        ]
        self._counter += 1
        return frame_of(self._sensor.id, self._counter, time.monotonic_ns(), zones)

    def turn(self) -> None:
        """Wait until the next frame is due, and send it; a missed one is left out."""
        time.sleep(max(self._due - time.monotonic_ns(), 0) * 1e-9)
        self._due = max(self._due + self._period, time.monotonic_ns())
        try:
            self._socket.send(self.frame())
        except OSError:
            # No reflex listens yet.
            return


def main() -> int:
    """Run until it is ended; an error of ours is one message and exit code 2."""
    words = argparse.ArgumentParser(
        prog="python -m armguard.chaos.zone_sensor",
        description=(__doc__ or "").splitlines()[0],
    )
    words.add_argument("file", type=Path, help="file of the reflex")
    words.add_argument("sensor", help="name of the sensor in it")
    words.add_argument("--period", type=float, default=1 / 15, help="of frames [s]")
    asked = words.parse_args()
    given = read_settings(asked.file)
    named = {one.name: one for one in given["sensors"].values()}
    if asked.sensor not in named:
        raise StationError(f"{asked.file} has no sensor '{asked.sensor}'")
    ending: list[int] = []
    sensor = ZoneSensor(given["port"], named[asked.sensor], asked.period)

    def show(number: int, _: object) -> None:
        sensor.near = number == signal.SIGUSR1

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda got, _: ending.append(got))
    for number in (signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, show)
    while not ending:
        sensor.turn()
    return 0


if __name__ == "__main__":
    run_program(main, "zone sensor:")
