"""Arms that do at once what a service tells them, at its rate."""

import time
from collections.abc import Callable

import numpy as np

from armguard import Client
from armguard.station.client import Answer
from armguard.station.errors import RefusedError

# Period of the services in tests [s].
PERIOD = 0.004

# After that long nothing more is waited for [s].
PATIENCE = 20.0


class Arms:
    """Arms behind a client.

    Attributes:
        q: Where they are.
        velocity: How fast they move.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.q = client.welcome.home.copy()
        self.velocity = np.zeros_like(self.q)
        # Whoever was here before has left his arms somewhere else.
        client.claim(force=True)
        deadline = time.monotonic() + PATIENCE
        while True:
            client.send_state(self.q, self.velocity)
            try:
                client.call("reset")
                break
            except RefusedError:
                assert time.monotonic() < deadline
                client.send_velocities(0.0 * self.q)
                time.sleep(PERIOD)
        client.give_back()

    def drive(self, wish: np.ndarray, cycles: int) -> Answer:
        """Be controller and commander for some cycles; the last answer."""
        for _ in range(cycles):
            if not self.client.commands:
                self.client.claim()
            answer = self._obey(
                self.client.cycle(self.q, wish, self.velocity, timeout=PATIENCE)
            )
        return answer

    def drive_until(self, wish: np.ndarray, done: Callable[[Answer], bool]) -> Answer:
        """The same until an answer is as it is to be."""
        return until(lambda: self.drive(wish, 1), done)

    def lead(self, wish: np.ndarray) -> Answer:
        """Drive until the wish is followed to the bit.

        A machine that was busy elsewhere for too long has stopped the arms; then they
        are let go of first, as an operator would.
        """
        still = 0.0 * wish

        def step() -> Answer:
            answer = self.drive(wish, 1)
            if answer.stops:
                self.drive_until(still, lambda a: not a.stops)
            return answer

        return until(step, lambda a: bool((a.velocity == wish).all()))

    def measure(self) -> Answer:
        """Be only controller, for one cycle."""
        self.client.send_state(self.q, self.velocity)
        answer = self.client.receive(PATIENCE)
        assert answer is not None
        while (newer := self.client.receive()) is not None:
            answer = newer
        return self._obey(answer)

    def measure_until(self, done: Callable[[Answer], bool]) -> Answer:
        """The same until an answer is as it is to be."""
        return until(self.measure, done)

    def _obey(self, answer: Answer) -> Answer:
        self.velocity = answer.velocity.copy()
        self.q = self.q + self.velocity * PERIOD
        time.sleep(0.8 * PERIOD)
        return answer


def until(step: Callable[[], Answer], done: Callable[[Answer], bool]) -> Answer:
    """Step until an answer is as it is to be."""
    deadline = time.monotonic() + PATIENCE
    while not done(answer := step()):
        assert time.monotonic() < deadline, (answer.cause, answer.reason)
    return answer


def wait_for(done: Callable[[], bool]) -> None:
    """Wait until something is so."""
    deadline = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.002)
