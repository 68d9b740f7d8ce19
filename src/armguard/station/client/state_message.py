"""A STATE in a buffer of its own: from one to the next only numbers change."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.client.connection import Connection
from armguard.station.client.welcome import Welcome
from armguard.station.errors import RefusedError
from armguard.station.wire import Form, Kind
from armguard.station.wire.layout import (
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    MAGIC,
    SEAL,
    STATE,
    VERSION,
    WISH,
)

Floats = NDArray[np.float64]


class StateMessage:
    """The STATEs of one client about the same robots.

    Attributes:
        bits: Its robots: bit k for robot k.

    Args:
        connection: Sends them; it knows session and scene by now.
        welcome: Description of the service.
        robots: Names of the robots, or the name of one; all if None.
        velocities: Whether it holds velocities.
        desired: Whether it holds desired velocities.

    Raises:
        RefusedError: There is no robot of that name.
    """

    def __init__(
        self,
        connection: Connection,
        welcome: Welcome,
        robots: str | tuple[str, ...] | None,
        *,
        velocities: bool,
        desired: bool,
    ) -> None:
        self._outbox, self._seal = connection.outbox, connection.seal
        named = welcome.robots if robots is None else robots
        names = (named,) if isinstance(named, str) else named
        for name in names:
            if name not in welcome.robots:
                raise RefusedError(f"the scene has no robot '{name}'")
        own = {welcome.robots.index(name) for name in names}
        self.bits = sum(1 << k for k in own)
        self._joints = joints = sum(welcome.parts[k].count for k in own)
        row = ("<f8", (joints,))
        fields: list[Any] = [("head", HEADER.dtype), ("state", STATE.dtype)]
        fields.append(("q", *row))
        if velocities:
            fields.append(("velocity", *row))
        if desired:
            fields += [("wish", WISH.dtype), ("desired", *row)]
        message = np.zeros(1, np.dtype([*fields, ("seal", "u1", (SEAL,))]))
        self._message = message.view(np.uint8).data
        outbox, size = self._outbox, message.itemsize
        head = MAGIC, VERSION, Kind.STATE, size, outbox.session, outbox.scene
        HEADER.pack_into(self._message, 0, *head, connection.sender, 0, 0)
        flags = (HAS_VELOCITY if velocities else 0) | (HAS_WISH if desired else 0)
        message["state"]["robots"], message["state"]["flags"] = self.bits, flags
        # All that changes from one to the next. A memoryview takes as many float64 as
        # there are and nothing else, and takes them faster than an array.
        self._sequence, self._sent = (message["head"][x] for x in ("sequence", "stamp"))
        self._stamp = message["state"]["stamp"]
        self._q = message["q"][0].data
        self._q[:] = np.full(joints, np.nan)
        self._velocity = message["velocity"][0].data if velocities else None
        if desired:
            wish = message["wish"]
            wish["form"], wish["numbers"] = Form.VELOCITIES, joints
            self._token = wish["token"]
            self._desired = message["desired"][0].data

    @property
    def q(self) -> Floats:
        """Positions in the last one, NaN before it, shape (k,) [rad or m]."""
        return np.array(self._q)

    def write(
        self,
        now: int,
        stamp: float,
        q: ArrayLike,
        velocity: ArrayLike | None,
        desired: ArrayLike | None = None,
        token: int = 0,
    ) -> memoryview:
        """The next one; good until the one after it.

        Args:
            now: The client's monotonic clock [ns].
            stamp: When it was measured, on the service's clock [s].
            q: Positions, shape (k,) [rad or m].
            velocity: Velocities, shape (k,), if it holds any [rad/s or m/s].
            desired: Desired velocities, shape (k,), if it holds any [rad/s or m/s].
            token: The commander's token.

        Raises:
            RefusedError: An array has another number of joints.
        """
        outbox = self._outbox
        outbox.sequence = sequence = outbox.sequence + 1
        self._sequence[0], self._sent[0] = sequence, now + outbox.ahead
        self._stamp[0] = stamp
        self._put(self._q, q, "q")
        if velocity is not None:
            self._put(self._velocity, velocity, "velocity")
        if desired is not None:
            self._token[0] = token
            self._put(self._desired, desired, "the wish")
        self._seal.put(self._message)
        return self._message

    def _put(self, row: Any, values: Any, name: str) -> None:
        """Write a number of each joint."""
        try:
            row[:] = values
        except (TypeError, ValueError, NotImplementedError):
            numbers = np.asarray(values, dtype=np.float64)
            if numbers.shape != (self._joints,):
                raise RefusedError(
                    f"{name} has shape {numbers.shape}; it must be ({self._joints},)"
                ) from None
            row[:] = numbers
