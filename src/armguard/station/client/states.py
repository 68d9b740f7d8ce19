"""STATEs of a client, by the robots they tell of."""

import numpy as np
from numpy.typing import NDArray

from armguard.station.client.answer import Answer
from armguard.station.client.connection import Connection
from armguard.station.client.state_message import StateMessage
from armguard.station.client.welcome import Welcome
from armguard.station.errors import NoServiceError, RefusedError

Floats = NDArray[np.float64]

# Which robots a STATE tells of, all if None; whether it tells velocities, and a wish.
Form = tuple[str | tuple[str, ...] | None, bool, bool]


class States:
    """Makes each kind of STATE once.

    Args:
        connection: Where they are sent.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._welcome: Welcome | None = None
        self._made: dict[Form, StateMessage] = {}
        # Robots whose states were sent, as bits.
        self._sent = 0
        self._whole: StateMessage | None = None

    @property
    def q(self) -> Floats | None:
        """Where all robots were when that was told last; None if it was not yet."""
        return None if self._whole is None else self._whole.q

    def expect(self, welcome: Welcome | None) -> None:
        """From now on they are for this scene; None for none."""
        self._welcome = welcome
        self._made.clear()
        self._sent = 0

    def own(self, answer: Answer, sender: int) -> bool:
        """Whether robots of this controller were judged by its own states.

        Args:
            answer: The answer.
            sender: Number of this client.
        """
        if not self._sent:
            return True
        return all(
            row.sender == sender
            for k, row in enumerate(answer.numbers)
            if self._sent >> k & 1
        )

    def of(
        self, robots: str | tuple[str, ...] | None, velocities: bool, wish: bool
    ) -> StateMessage:
        """The STATE of these robots, in which only numbers have to be written.

        Args:
            robots: See `Client.send_state`.
            velocities: Whether it tells velocities.
            wish: Whether it wishes for velocities.

        Raises:
            NoServiceError: No service has told which robots there are.
            RefusedError: A robot is not there.
        """
        form = robots, velocities, wish
        state = self._made.get(form)
        if state is None:
            state = self._made[form] = self._make(robots, velocities, wish)
        if robots is None:
            self._whole = state
        self._sent |= state.bits
        return state

    def _make(
        self, robots: str | tuple[str, ...] | None, velocities: bool, wish: bool
    ) -> StateMessage:
        welcome = self._welcome
        if welcome is None:
            raise NoServiceError("not connected: call connect() first")
        if robots is None:
            robots = welcome.robots
        bits = joints = 0
        for name in (robots,) if isinstance(robots, str) else robots:
            if name not in welcome.robots:
                raise RefusedError(f"the scene has no robot '{name}'")
            k = welcome.robots.index(name)
            joints += 0 if bits >> k & 1 else welcome.parts[k].count
            bits |= 1 << k
        return StateMessage(
            self._connection, bits, joints, velocities=velocities, wish=wish
        )
