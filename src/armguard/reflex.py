"""The reflex: an independent process that stops the arms by zone sensors alone.

    python -m armguard.reflex reflex.json

It knows no model and imports nothing of the package. It starts stopped, stops whenever
a zone is too near or a sensor is in doubt, and stays so until a sealed reset comes.
docs/reflex.md explains its messages, its file and its limits.
"""

import gc
import json
import os
import select
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from hashlib import blake2s
from hmac import compare_digest
from pathlib import Path
from struct import Struct, iter_unpack
from typing import Any
from zlib import crc32

# A frame: magic, sensor, zones, counter, stamp [ns]; distance [mm] and status of each
# zone; the CRC-32 of all that. Zeros fill gaps.
FRAME_MAGIC, FRAME, ZONE, CRC = 0x5A474741, Struct("<IHHI4xq"), "<HBx", Struct("<I")
# A pulse: magic, version, trip, session, number, stamp [ns], stops, sensor, zone,
# distance [mm], dropped messages. A reset: magic, version, and session and stops of the
# pulse that it answers. A seal follows either.
PULSE_MAGIC, VERSION, PULSE = 0x58524741, 1, Struct("<IHHQQqIHHII")
RESET_MAGIC, RESET = 0x53524741, Struct("<IH2xQI4x")
SEAL, NONE = 16, 0xFFFF
# Status of a zone: its distance counts; nothing is within range; neither is known.
MEASURED, NOTHING, INVALID = range(3)
# Zones of which noise alters one or more; frames in a row in which it may not; how far
# a stamp may be ahead [ns]; messages between two looks at clocks.
NOISY, REPEATS, AHEAD, BATCH = 8, 2, 1_000_000, 64
# Kind of a key, bounds of its value or length, and its default if it has one.
OF_FILE: dict[str, Any] = {
    "port": (int, 1, 65535),
    "key": (str, 16, 32),
    "reset": (str, 16, 32),
    "listeners": (list, 1, 16),
    "period": (float, 0.001, 0.05, 0.02),
    "watchdog": (float, 0.003, 1.0, 0.1),
    "line": (str, 0, 4096, ""),
    "sensors": (dict, 1, 256),
}
OF_SENSOR: dict[str, Any] = {
    "id": (int, 0, NONE - 1),
    "timeout": (float, 1e-3, 2.0),
    "thresholds": (list, 1, 4096),
    "vote": (int, 1, 2, 1),
}


class Trip(IntEnum):
    """Why the reflex stops the arms; `CLEAR` if it does not."""

    CLEAR, STARTED, ENDED, FAULT, NEAR, SILENT, COUNTER, REPEATED = range(8)
    STAMP_BACK, STAMP_AHEAD, STAMP_OLD, SIZE, CORRUPT, BLIND = range(8, 14)


def checked(where: str, given: Any, keys: dict[str, Any]) -> dict[str, Any]:
    """Values by key, each of its kind and within its bounds.

    Raises:
        ValueError: One is not, is missing, or has no such key.
    """
    found, wrong = {}, {f"{given!r:.40}"}
    if unknown := given.keys() - keys.keys() if isinstance(given, dict) else wrong:
        raise ValueError(f"{where}no key '{min(unknown)}'; keys are {', '.join(keys)}")
    for key, (kind, least, most, *default) in keys.items():
        value: Any = given.get(key, *default)
        right = isinstance(value, int | float if kind is float else kind)
        sized = kind in (str, list, dict)
        size: Any = len(value) if right and sized else value
        if not right or isinstance(value, bool) or not least <= size <= most:
            need = f"{kind.__name__}{' of length' * sized} from {least:g} to {most:g}"
            raise ValueError(f"{where}{key} is {value!r:.80}; give {need}")
        found[key] = value
    return found


def read_settings(path: Path) -> dict[str, Any]:
    """Values of the file of the reflex by key of `OF_FILE`, sensors by id.

    Raises:
        OSError: It cannot be read.
        ValueError: Others may read its keys, or a value is wrong.
    """
    if path.stat().st_mode & 0o077:
        raise ValueError(f"others may read its keys; run: chmod 600 {path}")
    found = checked("", json.loads(path.read_text(encoding="utf-8")), OF_FILE)
    if found["key"] == found["reset"]:
        raise ValueError("reset equals key; only the operator may know reset")
    if not all(type(one) is int and 0 < one < 65536 for one in found["listeners"]):
        raise ValueError("listeners must be UDP ports of this machine")
    named = found["sensors"].items()
    made = [Sensor(name, **checked(f"{name}: ", s, OF_SENSOR)) for name, s in named]
    found["sensors"] = {one.id: one for one in made}
    if len(found["sensors"]) < len(made):
        raise ValueError("two sensors have the same id; give each another one")
    for one in made:
        used = [t for t in one.thresholds if t is not None]
        if not used or not all(type(t) in (int, float) and 0 < t < 65 for t in used):
            raise ValueError(f"{one.name}: thresholds must be metres, or null, not all")
    return found


def sealed(key: str, body: bytes) -> bytes:
    """A message with its seal: keyed BLAKE2s, as in messages of the service."""
    return body + blake2s(body, key=key.encode(), digest_size=SEAL).digest()


def opened(key: str, form: Struct, data: bytes) -> tuple[Any, ...] | None:
    """Fields of a sealed message; None if its size or its seal does not fit."""
    body = data[:-SEAL]
    right = len(body) == form.size and compare_digest(sealed(key, body), data)
    return form.unpack(body) if right else None


@dataclass(slots=True)
class Sensor:
    """A zone sensor: its settings, and what its newest frame says."""

    name: str
    id: int
    timeout: float
    thresholds: list[float | None]
    vote: int
    due: int = 0  # when the next frame must have come [ns]
    newest: tuple[int, int, bytes] | None = None  # its counter, stamp and zones
    equal: int = 0  # frames in a row whose zones equal those before
    votes: dict[int, int] = field(default_factory=dict)  # frames that see a zone near
    fault: Trip = Trip.SILENT  # of the newest frame alone
    where: tuple[int, int] = (NONE, 0)  # a zone that is too near, and its distance [mm]

    def take(self, frame: bytes, now: int) -> Trip:
        """Judge a frame that came at `now` [ns]: why it stops the arms, if it does."""
        self.due, self.where = now + int(self.timeout * 1e9), (NONE, 0)
        self.fault = self._judge(frame, now)
        waits = self.fault is Trip.NEAR and max(self.votes.values()) < self.vote
        return Trip.CLEAR if waits else self.fault

    def _judge(self, frame: bytes, now: int) -> Trip:
        """The fault of a frame alone."""
        _, _, zones, counter, stamp = FRAME.unpack_from(frame)
        rows, before = frame[FRAME.size : -CRC.size], self.newest
        if not len(rows) == 4 * zones == 4 * len(self.thresholds):
            return Trip.SIZE
        if CRC.pack(crc32(frame[: -CRC.size])) != frame[-CRC.size :]:
            return Trip.CORRUPT
        self.newest = counter, stamp, rows
        if stamp > now + AHEAD:
            return Trip.STAMP_AHEAD
        if now - stamp > self.timeout * 1e9:
            return Trip.STAMP_OLD
        if before is not None:
            if not 0 < (counter - before[0]) % 2**32 < 2**31:
                return Trip.COUNTER
            if stamp <= before[1]:
                return Trip.STAMP_BACK
            self.equal = self.equal + 1 if rows == before[2] else 0
        return self._look(rows)

    def _look(self, rows: bytes) -> Trip:
        """The fault of the zones."""
        measured = seen = valid = 0
        votes: dict[int, int] = {}
        for k, (distance, status) in enumerate(iter_unpack(ZONE, rows)):
            measured += status == MEASURED
            threshold = self.thresholds[k]
            if threshold is None:
                continue
            seen, valid = seen + 1, valid + (status < INVALID)
            if status == MEASURED and distance < 1e3 * threshold:
                votes[k], self.where = self.votes.get(k, 0) + 1, (k, distance)
            elif status >= INVALID and k in self.votes:
                votes[k] = self.votes[k]
        self.votes = votes
        if self.where[0] != NONE:
            return Trip.NEAR
        if 2 * valid < seen:
            return Trip.BLIND
        frozen = self.equal >= REPEATS and measured >= min(NOISY, len(rows) // 4)
        return Trip.REPEATED if frozen else Trip.CLEAR


class Reflex:
    """The loop: frames and resets in, pulses out."""

    def __init__(self, given: dict[str, Any]) -> None:
        self.key, self.reset = given["key"], given["reset"]
        self.period = int(given["period"] * 1e9)
        self.sensors, self.listeners = given["sensors"], given["listeners"]
        self.line = os.open(given["line"] or os.devnull, os.O_WRONLY | os.O_CREAT)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", given["port"]))
        self.socket.setblocking(False)
        self.session = int.from_bytes(os.urandom(8))
        self.beat = self.number = self.dropped = self.stops = 0
        self.trip, self.by = Trip.CLEAR, (NONE, NONE, 0)
        self.stop(Trip.STARTED)

    def stop(self, trip: Trip, sensor: Sensor | None = None) -> None:
        """Stop the arms, unless they are stopped."""
        if self.trip is Trip.CLEAR or trip is Trip.ENDED:
            self.trip, self.stops = trip, self.stops + 1
            self.by = (sensor.id, *sensor.where) if sensor else (NONE, NONE, 0)
            self.pulse()
            say(f"stop {self.stops}: {trip.name} {sensor.name if sensor else ''}")

    def pulse(self, *to: int) -> None:
        """Say whether the arms have to stop, to all listeners or to one port."""
        self.number += 1
        head = PULSE_MAGIC, VERSION, self.trip, self.session, self.number
        tail = self.stops, *self.by, self.dropped
        message = sealed(self.key, PULSE.pack(*head, time.monotonic_ns(), *tail))
        for port in to or self.listeners:
            with suppress(OSError):
                self.socket.sendto(message, ("127.0.0.1", port))
        with suppress(OSError):
            os.pwrite(self.line, b"0" if self.trip else b"1", 0)

    def take(self, data: bytes, port: int) -> None:
        """Take a message in: a frame, or a reset, which a pulse answers."""
        whole = len(data) >= FRAME.size + CRC.size
        magic, sensor = FRAME.unpack_from(data)[:2] if whole else (0, 0)
        one = self.sensors.get(sensor)
        if reset := opened(self.reset, RESET, data):
            good = all(one.fault is Trip.CLEAR for one in self.sensors.values())
            if good and reset == (RESET_MAGIC, VERSION, self.session, self.stops):
                self.trip, self.by = Trip.CLEAR, (NONE, NONE, 0)
                say(f"reset of stop {self.stops}")
            self.pulse(port)
        elif magic != FRAME_MAGIC or one is None:
            self.dropped += 1
        elif trip := one.take(data, time.monotonic_ns()):
            self.stop(trip, one)

    def turn(self) -> None:
        """Wait for a message or a time that is due, and do what is due."""
        due = min(self.beat, *(one.due for one in self.sensors.values()))
        select.select([self.socket], (), (), max(due - time.monotonic_ns(), 0) * 1e-9)
        with suppress(BlockingIOError):
            for _ in range(BATCH):
                data, sender = self.socket.recvfrom(1 << 16)
                self.take(data, sender[1])
        now = time.monotonic_ns()
        for one in self.sensors.values():
            if now > one.due:
                one.fault, one.where = Trip.SILENT, (NONE, 0)
                one.due = now + int(one.timeout * 1e9)
                self.stop(Trip.SILENT, one)
        if now >= self.beat:
            self.beat = now + self.period
            self.pulse()


def say(sentence: str) -> None:
    """Write a line of the log; a log that cannot be written stops nothing."""
    with suppress(OSError):
        print(sentence, file=sys.stderr, flush=True)


def main(words: list[str]) -> int:
    """Run until it is ended; 2 and a sentence if its file is wrong."""
    ended: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda got, _: ended.append(got))
    try:
        if len(words) != 1:
            raise ValueError("give one file: python -m armguard.reflex reflex.json")
        reflex = Reflex(read_settings(Path(words[0])))
    except (ValueError, OSError) as error:
        say(f"{' '.join(words)}: {error}")
        return 2
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except (AttributeError, OSError) as error:
        say(f"no real-time scheduling: {error}")
    gc.disable()
    while not ended:
        try:
            reflex.turn()
        except Exception as error:  # doubt is a stop
            reflex.stop(Trip.FAULT)
            say(f"{type(error).__name__}: {error}")
            time.sleep(1e-3)
    reflex.stop(Trip.ENDED)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
