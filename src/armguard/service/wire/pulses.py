"""Pulses of a reflex, as its listeners hear them, and the reset of its stop."""

import json
import os
import socket
from pathlib import Path
from secrets import token_hex
from select import select
from time import monotonic, monotonic_ns
from typing import Any, NamedTuple

from armguard.errors import StationError
from armguard.reflex import (
    NONE,
    PULSE,
    PULSE_MAGIC,
    RESET,
    RESET_MAGIC,
    SEAL,
    VERSION,
    Trip,
    opened,
    read_settings,
    sealed,
)
from armguard.service.wire.layout import Cause

LOOPBACK = "127.0.0.1"

SENTENCES = {
    Trip.CLEAR: "it stops no arm",
    Trip.STARTED: "it was started, and not reset yet",
    Trip.ENDED: "it was ended; start it",
    Trip.FAULT: "it has a fault; read its log",
    Trip.NEAR: "a zone is nearer than its threshold",
    Trip.SILENT: "the sensor is silent; check it and its cable",
    Trip.COUNTER: "the counter of its frames does not rise; start the sensor again",
    Trip.REPEATED: "the sensor repeats its distances to the bit; start it again",
    Trip.STAMP_BACK: "the stamp of its frames does not rise; check its clock",
    Trip.STAMP_AHEAD: "the stamp of its frame is in the future; check its clock",
    Trip.STAMP_OLD: "its frame is older than its timeout; check load and network",
    Trip.SIZE: "its frame has another size than its zones need; check its driver",
    Trip.CORRUPT: "the checksum of its frame does not fit; check its cable",
    Trip.BLIND: "most of its zones are invalid; clean the sensor, or shade it",
}


class Pulse(NamedTuple):
    """A pulse; the fields of `armguard.reflex.PULSE` behind its version."""

    trip: int = Trip.CLEAR  # why the arms have to stop
    session: int = 0  # random, new at each start of the reflex
    number: int = 0  # rises from pulse to pulse
    stamp: int = 0  # when it was sent, on CLOCK_MONOTONIC [ns]
    stops: int = 0  # number of the newest stop; a reset has to name it
    sensor: int = NONE  # id of the sensor that stopped the arms
    zone: int = NONE  # its zone that was too near
    distance: int = 0  # of that zone [mm]
    dropped: int = 0  # messages that the reflex could not use


def pulse_of(key: str, message: bytes) -> Pulse | None:
    """The pulse in a message; None if it is none with that key."""
    fields = opened(key, PULSE, message)
    if fields is None or fields[:2] != (PULSE_MAGIC, VERSION):
        return None
    return Pulse(*fields[2:])


class Pulses:
    """A listener of a reflex: it knows whether the arms may move.

    It takes the first listener's port of the reflex's file that is free, and waits once
    for a pulse, so that a reflex that runs is not silent at the start.

    Attributes:
        newest: The newest pulse that counts.
        cause: What `hear` found last.

    Args:
        file: File of the reflex.

    Raises:
        StationError: The file cannot be used, or no port in it is free.
    """

    def __init__(self, file: Path) -> None:
        given = settings_of(file)
        self._key, self._watchdog = given["key"], int(given["watchdog"] * 1e9)
        self._names = {one.id: one.name for one in given["sensors"].values()}
        self._socket = listening(given["listeners"], file)
        self.newest, self.cause = Pulse(), Cause.REFLEX_SILENT
        select([self._socket], (), (), given["watchdog"])
        self.hear(monotonic_ns())

    def fileno(self) -> int:
        """Its socket, for `select`."""
        return self._socket.fileno()

    def hear(self, now: int) -> Cause:
        """Take pulses in: why the arms have to stop, `NONE` if they may move.

        Args:
            now: The monotonic clock [ns].
        """
        while True:
            try:
                pulse = pulse_of(self._key, self._socket.recv(PULSE.size + SEAL + 1))
            except OSError:
                break
            if pulse is not None and pulse.stamp > self.newest.stamp:
                self.newest = pulse
        self.cause = Cause.REFLEX_STOPPED if self.newest.trip else Cause.NONE
        if now - self.newest.stamp > self._watchdog:
            self.cause = Cause.REFLEX_SILENT
        return self.cause

    @property
    def sentence(self) -> str:
        """What the reflex says, in words."""
        if self.cause is Cause.REFLEX_SILENT:
            return self.cause.sentence
        return sentence_of(self.newest, self._names)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def sentence_of(pulse: Pulse, names: dict[int, str]) -> str:
    """A pulse in words.

    Args:
        pulse: The pulse.
        names: Names of the sensors by id.
    """
    says = f"the reflex: {SENTENCES.get(Trip(pulse.trip), 'unknown')}"
    if pulse.sensor != NONE:
        says += f" (sensor '{names.get(pulse.sensor, pulse.sensor)}'"
        if pulse.zone != NONE:
            says += f", zone {pulse.zone}, {pulse.distance} mm"
        says += ")"
    return says


def reset(file: Path, timeout: float = 1.0) -> str:
    """Lift the stop of a reflex, as its operator.

    Args:
        file: File of the reflex, which holds the operator's key.
        timeout: How long to wait for its answers [s].

    Returns:
        Why it still stops the arms; "" if it does not.

    Raises:
        StationError: The file cannot be used, or the reflex does not answer.
    """
    given = settings_of(file)
    end, pulse = monotonic() + timeout, None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.connect((LOOPBACK, given["port"]))
        # The first one names no stop: its answer does.
        session = stops = 0
        for _ in range(2):
            body = RESET.pack(RESET_MAGIC, VERSION, session, stops)
            pulse = answer_to(sealed(given["reset"], body), one, given["key"], end)
            if pulse is None:
                raise StationError(
                    f"no reflex answers at {LOOPBACK}:{given['port']}; start it: "
                    f"python -m armguard.reflex {file}"
                )
            session, stops = pulse.session, pulse.stops
    assert pulse is not None
    names = {one.id: one.name for one in given["sensors"].values()}
    return sentence_of(pulse, names) if pulse.trip else ""


def answer_to(message: bytes, to: socket.socket, key: str, end: float) -> Pulse | None:
    """The pulse that answers a message; None if none comes in time.

    Args:
        message: The message.
        to: A socket that is connected to the reflex.
        key: Seals pulses.
        end: Until when to wait, on the monotonic clock [s].
    """
    try:
        to.send(message)
        while (left := end - monotonic()) > 0.0:
            to.settimeout(left)
            if (pulse := pulse_of(key, to.recv(PULSE.size + SEAL + 1))) is not None:
                return pulse
    except OSError:
        # Nothing listens there, or the time is over.
        return None
    return None


def settings_of(file: Path) -> dict[str, Any]:
    """Settings of a reflex.

    Raises:
        StationError: The file cannot be used.
    """
    try:
        return read_settings(file)
    except (OSError, ValueError) as error:
        raise StationError(
            f"{file}: {error}; `armguard check SCENE --reflex` writes this file"
        ) from error


def write_settings(file: Path, given: dict[str, Any]) -> None:
    """Write the file of a reflex, mode 0600, and check it.

    Args:
        file: The file; its keys `key` and `reset` stay those of a file that is there.
        given: All else that is in it, see docs/reflex.md.

    Raises:
        StationError: It cannot be written, or a value is wrong.
    """
    keys = {name: token_hex(16) for name in ("key", "reset")}
    part = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        if file.exists():
            before = json.loads(file.read_text(encoding="utf-8"))
            keys = {name: before[name] for name in keys}
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as out:
            json.dump(keys | given, out, indent=1)
        read_settings(part)
        part.replace(file)
    except (OSError, ValueError, KeyError, TypeError) as error:
        part.unlink(missing_ok=True)
        raise StationError(f"{file} cannot be written: {error}") from error


def listening(ports: list[int], file: Path) -> socket.socket:
    """A socket on the first port that is free.

    Raises:
        StationError: None is.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.setblocking(False)
    for port in ports:
        try:
            found.bind((LOOPBACK, port))
        except OSError:
            continue
        return found
    found.close()
    raise StationError(
        f"{file}: each port of `listeners` is taken; add one for each controller and "
        "for the service, and start the reflex again"
    )
