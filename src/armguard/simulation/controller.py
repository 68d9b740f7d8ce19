"""A controller whose robots are simulated: it sends states and obeys the answers."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import StationError
from armguard.recording.ring import RingWriter
from armguard.respond.command import Action
from armguard.scene.scene import Scene
from armguard.service.client import Answer, Client
from armguard.service.wire import Cause
from armguard.simulation.plant import Imperfection, Plant

Floats = NDArray[np.float64]

# How often a service that was lost is asked whether it is there again, and how long
# it gets to answer [s].
KNOCK, AN_ANSWER = 0.5, 0.05

# Size of a trace: some minutes [bytes].
TRACE_SIZE = 16 << 20


class SimulatedArms:
    """Arms that stand in for real ones, at the rate of the service.

    They do what the service answers, and take its silence for a stop. After that they
    say nothing until the guard has stopped them too, for want of states: nothing sets
    out again by itself. What happened while this process had to wait for its turn is
    made up for: each order is obeyed as of the instant at which it came.

    Attributes:
        client: The client they talk by.
        plant: The arms.

    Args:
        client: A client that is connected.
        scene: The scene of its welcome.
        imperfection: How inexact and late they are.
        trace: Where the true state is written, see `trace_of`; nowhere if None.
    """

    def __init__(
        self,
        client: Client,
        scene: Scene,
        *,
        imperfection: Imperfection | None = None,
        trace: Path | None = None,
    ) -> None:
        self.client = client
        self.plant = Plant(scene, imperfection=imperfection, time=client.clock())
        self._stops = dict.fromkeys(scene.robots, Action.STOP)
        # Whether they stopped by themselves and the service does not know it yet, and
        # whether it has had them go on meanwhile.
        self._alone = self._silent = False
        self._knock = 0.0
        # When no answer was left to take in [s].
        self._heard = client.clock()
        self._trace = None if trace is None else RingWriter(trace, TRACE_SIZE)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Move, measure, send, obey, until something is true."""
        client, plant = self.client, self.plant
        period = client.welcome.period
        due = client.clock()
        while not until():
            self._listen(plant.time)
            plant.advance(max(client.clock() - plant.time, 0.0))
            self._write()
            if client.connected and not self._silent:
                q, v = plant.measure()
                client.send_state(q, v, stamp=plant.time)
            # A turn that was missed is not made up for.
            due = max(due + period, plant.time)
            self._listen(due)
            latest = client.latest
            if latest.cycle < 0:
                # What the client says where it hears nothing.
                self._alone, self._silent = True, False
                self._stop()
                self._find_again(latest.cause)

    def _listen(self, due: float) -> None:
        """Take in what the service answers until some time, and what it has answered.

        Args:
            due: That time; one that has passed if only answers that wait are wanted.
        """
        client = self.client
        while True:
            left = max(due - client.clock(), 0.0)
            answer = client.receive(left) if client.connected else None
            if answer is not None:
                self._obey(answer)
                continue
            if not client.connected:
                time.sleep(left)
            self._heard = client.clock()
            if self._heard >= due:
                return

    def _obey(self, answer: Answer) -> None:
        """Have the arms do what an answer says, as of when it came."""
        actions = answer.actions
        if self._alone and Action.FOLLOW in actions.values():
            self._silent = True
            self._stop()
            return
        self._alone = self._silent = False
        # It came since none was left, however long this process waited for its turn.
        self.plant.send(answer.velocity, actions, at=max(answer.sent, self._heard))

    def close(self) -> None:
        """End the trace; the client is its owner's."""
        if self._trace is not None:
            self._trace.close()

    def _stop(self) -> None:
        """Have all arms stop."""
        self.plant.send(np.zeros(len(self.plant.q)), self._stops)

    def _find_again(self, cause: Cause) -> None:
        """Ask now and then whether a service that was lost is there again."""
        there = (Cause.NO_ANSWER, Cause.REFLEX_STOPPED, Cause.REFLEX_SILENT)
        if cause in there or self.plant.time < self._knock:
            return
        self._knock = self.plant.time + KNOCK
        try:
            self.client.connect(timeout=AN_ANSWER)
        except StationError:
            # A service that ended has taken its key file with it.
            return

    def _write(self) -> None:
        if self._trace is not None:
            self._trace.append(trace_of(self.plant.time, self.plant))


def trace_of(now: float, plant: Plant) -> Floats:
    """The true state: time, whether each arm is held, positions, velocities."""
    held: Mapping[str, bool] = plant.held
    return np.concatenate([[now], [*held.values()], plant.q, plant.v])
