"""A STATE in a buffer of its own: from one to the next only numbers change."""

from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.client.connection import Connection
from armguard.station.client.welcome import Welcome
from armguard.station.errors import RefusedError
from armguard.station.wire.layout import (
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    MAGIC,
    SEAL,
    STATE,
    VERSION,
    WISH,
    Form,
    Kind,
)

Floats = NDArray[np.float64]

# Where in a header the sequence is, and behind it the clock [bytes].
SEQUENCE_AT = 32

# Where the joints begin [bytes].
JOINTS_AT = HEADER.size + STATE.size


class StateMessage:
    """The STATEs of one client about the same robots.

    Attributes:
        bits: Its robots: bit k for robot k.

    Args:
        connection: Where they are sent; it knows session and scene by now.
        welcome: Description of the service.
        robots: Names of the robots, or the name of one; all if None.
        velocities: Whether it holds velocities.
        wish: Whether it holds desired velocities.

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
        wish: bool,
    ) -> None:
        self._outbox = outbox = connection.outbox
        self._seal = connection.seal
        named = welcome.robots if robots is None else robots
        names = (named,) if isinstance(named, str) else named
        for name in names:
            if name not in welcome.robots:
                raise RefusedError(f"the scene has no robot '{name}'")
        own = {welcome.robots.index(name) for name in names}
        self.bits = sum(1 << k for k in own)
        self._joints = joints = sum(welcome.parts[k].count for k in own)
        self._flags = (HAS_VELOCITY if velocities else 0) | (HAS_WISH if wish else 0)
        measured = 8 * joints * (2 if velocities else 1)
        end = JOINTS_AT + measured
        # All that changes but joints, which are written behind it.
        changing = "<Qq" + STATE.format[1:]
        if wish:
            changing += f"{measured}xQ"
            end += WISH.size + 8 * joints
        self._changing = Struct(changing)
        size = end + SEAL
        self._buffer = bytearray(size)
        self._message = memoryview(self._buffer)
        head = MAGIC, VERSION, Kind.STATE, size, outbox.session, outbox.scene
        HEADER.pack_into(self._buffer, 0, *head, connection.sender, 0, 0)
        if wish:
            at = JOINTS_AT + measured
            WISH.pack_into(self._buffer, at, 0, Form.VELOCITIES, joints)
        self._q = self._row(JOINTS_AT)
        self._q[:] = np.full(joints, np.nan)
        self._velocity = self._row(JOINTS_AT + 8 * joints)
        self._wish = self._row(end - 8 * joints)

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
        wish: ArrayLike | None = None,
        token: int = 0,
    ) -> memoryview:
        """The next one; good until the one after it.

        Args:
            now: The client's monotonic clock [ns].
            stamp: When it was measured, on the service's clock [s].
            q: Positions, shape (k,) [rad or m].
            velocity: Velocities, shape (k,), if it holds any [rad/s or m/s].
            wish: Desired velocities, shape (k,), if it holds any [rad/s or m/s].
            token: The commander's token.

        Raises:
            RefusedError: Something has another number of joints.
        """
        outbox = self._outbox
        outbox.sequence = sequence = outbox.sequence + 1
        sent = now + outbox.ahead
        changing = sequence, sent, self.bits, self._flags, stamp
        try:
            if wish is None:
                self._changing.pack_into(self._buffer, SEQUENCE_AT, *changing)
            else:
                self._changing.pack_into(self._buffer, SEQUENCE_AT, *changing, token)
                self._wish[:] = wish
            self._q[:] = q
            if velocity is not None:
                self._velocity[:] = velocity
        except (TypeError, ValueError, NotImplementedError):
            # A memoryview takes as many float64 as there are and nothing else.
            self._convert(self._q, q, "q")
            self._convert(self._velocity, velocity, "velocity")
            self._convert(self._wish, wish, "the wish")
        self._seal.put(self._message)
        return self._message

    def _row(self, first: int) -> Any:
        """Room for a number of each joint, as float64."""
        return self._message[first : first + 8 * self._joints].cast("d")

    def _convert(self, row: Any, values: ArrayLike | None, name: str) -> None:
        """Write what is no float64 yet."""
        if values is None:
            return
        numbers = np.asarray(values, dtype=np.float64)
        if numbers.shape != (self._joints,):
            raise RefusedError(
                f"{name} has shape {numbers.shape}; it must be ({self._joints},)"
            )
        row[:] = numbers
