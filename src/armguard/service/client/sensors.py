"""A client of the service that sends frames of sensors to the process of the map."""

import socket
import time
from contextlib import suppress
from math import ceil
from pathlib import Path
from reprlib import repr as brief

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import RefusedError, did_you_mean
from armguard.service.client.client import Client
from armguard.service.wire import Keys, Kind, Role
from armguard.service.wire.layout import Header
from armguard.service.wire.sensing import (
    FRAME,
    FRAME_PART,
    HEALTH,
    METRES,
    MILLIMETRES,
    MOST_PARTS,
    SENSOR,
    SensorRow,
)

# Bytes that are sent at once: as many fit into the socket of a receiver that is busy
# for some milliseconds. Then the sender waits for so long [s].
BURST, PAUSE = 128_000, 0.001

LOOPBACK = "127.0.0.1"

# A map that reported nothing for so long is gone [s].
GONE = 1.0


class SensorClient(Client):
    """Sends frames of sensors to the map of a service; from one thread.

    The map reports its port over the service. Frames are dropped while there is none.

    Attributes:
        clock: The service's clock; stamps are on it.
        lost: Frames that were not sent, since no map takes them.

    Args:
        port: Port of the service, on this machine.
        role: Rights of this client, `Role.SENSE` at least.
        keys: See `Client`.
        name: Its name in the service's log.

    Example:
        >>> from armguard import SensorClient
        >>> SensorClient(port=1).health
        {}
    """

    def __init__(
        self, port: int = 47800, *, role: Role = Role.SENSE,
        keys: Keys | str | Path | None = None, name: str = "sensors",
    ) -> None:  # fmt: skip
        super().__init__(port, role=role, keys=keys, name=name, every=0)
        self.lost = 0

    def _forget(self) -> None:
        super()._forget()
        self._map: tuple[int, float] | None = None
        self._rows: dict[int, SensorRow] = {}
        self._numbers: dict[int, int] = {}

    @property
    def maps(self) -> bool:
        """Whether a map takes frames now."""
        self._drain()
        if self.connected:
            self._connection.keep_alive()
        return self._map is not None and time.monotonic() - self._map[1] < GONE

    @property
    def frames_port(self) -> int:
        """Port that the map takes frames on; 0 before one has reported."""
        return 0 if self._map is None else self._map[0]

    @property
    def health(self) -> dict[str, str]:
        """State of each sensor in words, by name; empty without a map."""
        if self._welcome is None or not self.maps:
            return {}
        rows, names = self._rows, self.welcome.text["sensors"]
        return {
            name: rows[k].words.rstrip(b"\0").decode(errors="replace")
            for k, name in enumerate(names)
            if k in rows
        }

    def depth(self, name: str, image: ArrayLike, stamp: float) -> bool:
        """Send an image of a depth camera.

        An image of 640×480 pixels takes some 8 ms.

        Args:
            name: Name of the sensor.
            image: Depths, shape (rows, columns): floats [m] or integers [mm].
            stamp: Its stamp, on the service's clock [s].

        Returns:
            Whether a map is there that takes it.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
            RefusedError: The scene has no such sensor, or it is no array of numbers.
        """
        return self._send_frame(name, distances_of(image), b"", stamp)

    def zones(
        self, name: str, distance: ArrayLike, status: ArrayLike | None, stamp: float
    ) -> bool:
        """Send a frame of an array of zones; see `depth`.

        Args:
            name: Name of the sensor.
            distance: Distances, shape (rows, columns): floats [m] or integers [mm].
            status: Status of each zone, from 0 to 255; None if all were measured.
            stamp: Its stamp, on the service's clock [s].
        """
        codes = b"" if status is None else status_of(status)
        return self._send_frame(name, distances_of(distance), codes, stamp)

    def frame(self, name: str, values: ArrayLike, stamp: float) -> bool:
        """Send a frame of a sensor of kind points, range, infrared or capacitive.

        Args:
            name: Name of the sensor.
            values: Floats: points in its frame, shape (n, 3) [m]; or its distance [m];
                or its signal, as `Sense.infrared` and `Sense.capacitive` take it.
            stamp: Its stamp, on the service's clock [s].

        Returns:
            Whether a map is there that takes it.

        Raises:
            NoServiceError: `connect` has not succeeded yet.
            RefusedError: The scene has no such sensor, or they are no floats.
        """
        kind, data = distances_of(values)
        if kind != METRES:
            raise RefusedError(f"values are {brief(values)}; they must be floats")
        return self._send_frame(name, (kind, data), b"", stamp)

    def _send_frame(
        self, name: str, distances: tuple[int, bytes], status: bytes, stamp: float
    ) -> bool:
        names = self.welcome.text["sensors"]
        if name not in names:
            raise RefusedError(
                f"no sensor is named {name!r}; {did_you_mean(name, names)}"
            )
        there = self.maps
        if not there or self._map is None:
            self.lost += 1
            return False
        sensor, address = names.index(name), (LOOPBACK, self._map[0])
        kind, numbers = distances
        data = memoryview(numbers + status)
        number = self._numbers[sensor] = self._numbers.get(sensor, 0) + 1
        head = (kind, bool(status), 0, number, len(data), float(stamp))
        parts = ceil(len(data) / FRAME_PART)
        if not 0 < parts <= MOST_PARTS:
            raise RefusedError(f"a frame of {len(data)} bytes cannot be sent")
        outbox, sent = self._connection.outbox, 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            for part in range(parts):
                some = data[part * FRAME_PART : (part + 1) * FRAME_PART]
                message = outbox.message(
                    Kind.FRAME, FRAME.pack(sensor, part, *head), bytes(some)
                )
                with suppress(OSError):
                    # A frame without a part is dropped by the map.
                    one.sendto(message, address)
                sent += len(message)
                if sent >= BURST:
                    time.sleep(PAUSE)
                    sent = 0
        return True

    def _take_other(self, head: Header, payload: memoryview) -> bool:
        known = (
            self._welcome is not None
            and head.session == self._connection.outbox.session
        )
        if head.kind != Kind.HEALTH or not known:
            return super()._take_other(head, payload)
        found = HEALTH.unpack_from(payload)
        self._map = found.port, time.monotonic()
        rows = SENSOR.rows(bytes(payload[HEALTH.size :]))
        self._rows.update(enumerate(rows, found.first))
        return True


def distances_of(values: ArrayLike) -> tuple[int, bytes]:
    """Distances as a FRAME has them: what they are, and their bytes.

    Raises:
        RefusedError: They are no numbers.
    """
    try:
        found: NDArray[np.generic] = np.asarray(values)
    except (TypeError, ValueError):
        found = np.zeros(0, dtype=object)
    if found.dtype.kind == "f":
        return METRES, found.astype("<f4").tobytes()
    if found.dtype.kind not in "iu":
        raise RefusedError(f"distances are {brief(values)}; they must be real numbers")
    # What no u16 holds cannot have been measured.
    return MILLIMETRES, np.clip(found, 0, 65535).astype("<u2").tobytes()


def status_of(values: ArrayLike) -> bytes:
    """Status of zones as a FRAME has it.

    Raises:
        RefusedError: They are no whole numbers from 0 to 255.
    """
    found = np.asarray(values)
    if found.dtype.kind not in "iu" or not ((found >= 0) & (found <= 255)).all():
        raise RefusedError(f"status is {brief(values)}; it must be from 0 to 255")
    return found.astype("u1").tobytes()
