"""Which FRAMEs count: sealed, of this session, new, and of a frame's right size."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.recording.rights import Role
from armguard.scene.sensors import SceneSensor
from armguard.service.wire import Keys, Kind, Seal
from armguard.service.wire.layout import HEADER, LEAST, MAGIC, MOST, SEAL, VERSION
from armguard.service.wire.sensing import (
    FRAME,
    FRAME_PART,
    METRES,
    MILLIMETRES,
    FramePart,
)

# A message that was sent longer ago, or that much later than now, is dropped [ns].
OLDEST, AHEAD = 1_000_000_000, 20_000_000

# Senders that are known at a time. One that is silent for longer is forgotten: its
# messages are too old by then [ns].
MOST_SENDERS, FORGET = 32, 3_000_000_000

# Points of a frame at most.
MOST_POINTS = 1 << 20

# A sensor whose sender is silent for longer may get another one [ns].
SILENT = 500_000_000

DTYPES: dict[int, np.dtype[Any]] = {
    METRES: np.dtype("<f4"),
    MILLIMETRES: np.dtype("<u2"),
}


class SentFrame(NamedTuple):
    """A frame as it was sent.

    Attributes:
        name: Its sensor.
        values: Its values: of an image or of zones shape (rows · columns,), of points
            (n, 3), of other kinds (1,); floats, or integers [mm].
        status: Status of each; None if all were measured.
        stamp: Its stamp [s].
        arrived: When its last part came in, monotonic [ns].
    """

    name: str
    values: NDArray[np.generic]
    status: NDArray[np.uint8] | None
    stamp: float
    arrived: int


@dataclass(slots=True)
class Sender:
    """A sender of frames; times are monotonic [ns]."""

    seal: Seal
    sequence: int
    heard: int


@dataclass(slots=True)
class Assembly:
    """The frame of a sensor of which some parts are there."""

    name: str
    values: int  # values of a frame; 0 for any count of points
    sender: int = 0  # whose frames count, 0 for none yet
    heard: int = 0  # when its last part came in, monotonic [ns]
    head: FramePart | None = None  # of its first part; None before a frame began
    parts: set[int] = field(default_factory=set)  # those that are there
    data: bytearray = field(default_factory=bytearray)


class FrameGate:
    """Takes messages one at a time, and puts the parts of frames together.

    It holds a frame for each sensor, and a few numbers for each of some senders.

    Attributes:
        drop: Why the last message was dropped, "" if it was not.
        names: Names of the sensors.
        torn: Whether the last message ended a frame of which parts are missing.

    Args:
        sensors: Sensors of the scene, by name, in its order.
        keys: Keys of the service.
        session: Its session.
        scene: The scene as its headers name it.
    """

    def __init__(
        self, sensors: Mapping[str, SceneSensor], keys: Keys, session: int, scene: int
    ) -> None:
        self.drop, self.torn, self.names = "", False, tuple(sensors)
        self._seals = [Seal(key) for role, key in keys.items() if role >= Role.SENSE]
        self._session, self._scene = session, scene
        self._senders: dict[int, Sender] = {}
        self._assemblies = [
            Assembly(name, count_of(one)) for name, one in sensors.items()
        ]

    def admit(self, message: memoryview, now: int) -> SentFrame | None:
        """The frame that a message makes whole, None if there is none.

        Args:
            message: All that was received.
            now: Monotonic clock, that of the service [ns].
        """
        self.torn = False
        self.drop = self._check(message, now)
        if self.drop:
            return None
        sender = HEADER.unpack_from(message).sender
        return self._assemble(message[HEADER.size : -SEAL], sender, now)

    def _check(self, message: memoryview, now: int) -> str:
        """Why a message does not count, "" if it does."""
        size = len(message)
        if size < LEAST + FRAME.size:
            return "too_short"
        if size > MOST:
            return "oversized"
        head = HEADER.unpack_from(message)
        if head.magic != MAGIC:
            return "magic"
        if head.version != VERSION:
            return "version"
        if head.length != size:
            return "length"
        if head.kind != Kind.FRAME:
            return "kind"
        if head.session != self._session:
            return "session"
        if head.scene != self._scene:
            return "scene"
        if head.sender == 0:
            return "unknown_sender"
        # No older message than those of a sender that was forgotten counts.
        if now - head.stamp > OLDEST:
            return "late"
        if head.stamp - now > AHEAD:
            return "ahead"
        known = self._senders.get(head.sender)
        seals = self._seals if known is None else [known.seal]
        seal = next((one for one in seals if one.fits(message)), None)
        if seal is None:
            return "seal"
        if known is None:
            if not self._has_room(now):
                return "too_many_senders"
            known = self._senders[head.sender] = Sender(seal, 0, now)
        if head.sequence <= known.sequence:
            again = head.sequence == known.sequence
            return "replayed" if again else "out_of_order"
        known.sequence, known.heard = head.sequence, now
        return ""

    def _has_room(self, now: int) -> bool:
        """Whether another sender can be known; those that are silent are forgotten."""
        if len(self._senders) >= MOST_SENDERS:
            self._senders = {
                number: one
                for number, one in self._senders.items()
                if now - one.heard <= FORGET
            }
        return len(self._senders) < MOST_SENDERS

    def _assemble(self, payload: memoryview, sender: int, now: int) -> SentFrame | None:
        """Add a part to the frame of its sensor; the frame if it is whole now."""
        part, data = FRAME.unpack_from(payload), payload[FRAME.size :]
        if part.sensor >= len(self._assemblies):
            self.drop = "sensor"
            return None
        one = self._assemblies[part.sensor]
        if one.sender not in (0, sender) and now - one.heard <= SILENT:
            self.drop = "second_sender"
            return None
        dtype = DTYPES.get(part.distances)
        count = ceil(part.size / FRAME_PART)
        at = part.part * FRAME_PART
        if (
            dtype is None
            or not fits(part, dtype, one.values)
            or part.part >= count
            or len(data) != min(FRAME_PART, part.size - at)
        ):
            self.drop = "size"
            return None
        one.heard = now
        first = part._replace(part=0)
        if one.sender != sender or one.head != first:
            # What is there of another frame will not become whole.
            self.torn = one.head is not None
            one.sender, one.head, one.parts = sender, first, set()
            one.data = bytearray(part.size)
        one.parts.add(part.part)
        one.data[at : at + len(data)] = data
        if len(one.parts) < count:
            return None
        whole, one.head, one.data = bytes(one.data), None, bytearray()
        if one.values == 0:
            points = np.frombuffer(whole, dtype).reshape(-1, 3)
            return SentFrame(one.name, points, None, part.stamp, now)
        values = np.frombuffer(whole, dtype, one.values)
        status = None
        if part.has_status:
            status = np.frombuffer(whole, np.uint8, offset=values.nbytes)
        return SentFrame(one.name, values, status, part.stamp, now)


def count_of(sensor: SceneSensor) -> int:
    """Values of a frame of a sensor, 0 for any count of points."""
    if sensor.form in ("image", "zones"):
        return sensor.zones[0] * sensor.zones[1]
    return 0 if sensor.form == "points" else 1


def fits(part: FramePart, dtype: np.dtype[Any], values: int) -> bool:
    """Whether the whole frame of a part has a right size.

    Args:
        part: The part.
        dtype: Type of its values.
        values: How many it has to have, 0 for any count of points.
    """
    if values:
        return part.size == values * (dtype.itemsize + bool(part.has_status))
    points, rest = divmod(part.size, 3 * dtype.itemsize)
    return not part.has_status and rest == 0 and 0 < points <= MOST_POINTS
