"""Arms that obey the commands of a service at once, at its rate."""

import time
from collections.abc import Callable

import numpy as np

from armguard import Client
from armguard.errors import RefusedError
from armguard.service.client import Answer
from armguard.service.wire import Role

# Period of the services in tests [s].
PERIOD = 0.004

# After that long nothing more is waited for, and no answer to a cycle [s].
PATIENCE, ANSWERED = 20.0, 4.0


class Arms:
    """Arms behind a client.

    Args:
        client: It.
        anew: Whether the guard is reset and the arms are engaged before they move.

    Attributes:
        q: Where they are.
        velocity: How fast they move.
    """

    def __init__(self, client: Client, *, anew: bool = True) -> None:
        self.client = client
        self.q = client.welcome.home.copy()
        self.velocity = np.zeros_like(self.q)
        self._stamp = client.clock()
        if anew:
            self._begin()

    def drive(self, desired: np.ndarray, cycles: int) -> Answer:
        """Be controller and commander for some cycles; the last answer."""
        for _ in range(cycles):
            if not self.client.commands:
                self.client.claim()
            now = self._now()
            answer = self._obey(
                self.client.cycle(self.q, desired, self.velocity, now, timeout=ANSWERED)
            )
        return answer

    def drive_until(
        self, desired: np.ndarray, done: Callable[[Answer], bool]
    ) -> Answer:
        """The same until an answer is as it is to be."""
        return until(lambda: self.drive(desired, 1), done)

    def lead(self, desired: np.ndarray) -> Answer:
        """Drive until the desired motion is followed to the bit.

        A machine that was busy elsewhere for too long has stopped the arms; then they
        are let go of first, as an operator would.
        """
        still = 0.0 * desired

        def step() -> Answer:
            answer = self.drive(desired, 1)
            if answer.stops:
                self.drive_until(still, lambda a: not a.stops)
            return answer

        return until(step, lambda a: bool((a.velocity == desired).all()))

    def measure(self) -> Answer:
        """Be only controller, for one cycle."""
        now = self._now()
        self.client.send_state(self.q, self.velocity, now)
        answer = self.client.receive(PATIENCE)
        assert answer is not None
        while (newer := self.client.receive()) is not None:
            answer = newer
        return self._obey(answer)

    def measure_until(self, done: Callable[[Answer], bool]) -> Answer:
        """The same until an answer is as it is to be."""
        return until(self.measure, done)

    def _begin(self) -> None:
        """Reset the guard and engage the arms."""
        client = self.client
        # The client before this one has left its arms somewhere else.
        with Client(client.port, role=Role.ADMINISTER, every=0) as administrator:
            administrator.connect(PATIENCE)
            administrator.claim(force=True)
        client.claim()
        deadline = time.monotonic() + PATIENCE
        while True:
            now = self._now()
            client.send_state(self.q, self.velocity, now)
            try:
                client.call("reset")
                client.call("engage")
                break
            except RefusedError:
                assert time.monotonic() < deadline
                client.send_velocities(0.0 * self.q)
                time.sleep(PERIOD)
        client.give_back()

    def _now(self) -> float:
        """The service's time; the arms go on until then."""
        now = self.client.clock()
        self.q = self.q + self.velocity * (now - self._stamp)
        self._stamp = now
        return now

    def _obey(self, answer: Answer) -> Answer:
        self._now()
        self.velocity = answer.velocity.copy()
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
