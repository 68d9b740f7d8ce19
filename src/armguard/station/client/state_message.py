"""A STATE whose room is there already: from one to the next only numbers change."""

from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.client.connection import Connection
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
    """The STATEs of one client that tell of the same robots.

    Attributes:
        bits: Its robots: bit k for robot k.

    Args:
        connection: Where they are sent; it knows session and scene by now.
        bits: See there.
        joints: How many joints k they have together.
        velocities: Whether it tells velocities.
        wish: Whether it wishes for velocities.
    """

    def __init__(
        self,
        connection: Connection,
        bits: int,
        joints: int,
        *,
        velocities: bool,
        wish: bool,
    ) -> None:
        self._outbox = outbox = connection.outbox
        self._seal = connection.seal
        self.bits, self._joints = bits, joints
        self._flags = (HAS_VELOCITY if velocities else 0) | (HAS_WISH if wish else 0)
        told = 8 * joints * (2 if velocities else 1)
        end = JOINTS_AT + told
        # All that changes but joints, which are written behind it.
        changing = "<Qq" + STATE.format[1:]
        if wish:
            changing += f"{told}xQ"
            end += WISH.size + 8 * joints
        self._changing = Struct(changing)
        size = end + SEAL
        self._buffer = bytearray(size)
        self._message = memoryview(self._buffer)
        head = MAGIC, VERSION, Kind.STATE, size, outbox.session, outbox.scene
        HEADER.pack_into(self._buffer, 0, *head, connection.sender, 0, 0)
        if wish:
            WISH.pack_into(self._buffer, JOINTS_AT + told, 0, Form.VELOCITIES, joints)
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
            velocity: Velocities, shape (k,), if it tells any.
            wish: Velocities that are wished for, shape (k,), if it wishes for any.
            token: What the commander shows.

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
