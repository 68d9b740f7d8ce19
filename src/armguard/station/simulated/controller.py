"""A controller whose robots are simulated: it sends states and obeys what comes back."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.respond.command import Action
from armguard.scene.scene import Scene
from armguard.station.client import Client
from armguard.station.errors import StationError
from armguard.station.ring import RingWriter
from armguard.station.simulated.plant import Imperfection, Plant

Floats = NDArray[np.float64]

# How often a service that is silent is asked whether it is there again [s].
KNOCK = 0.5

# Size of a trace: some minutes [bytes].
TRACE_SIZE = 16 << 20


class SimulatedArms:
    """Arms that stand in for real ones, at the rate of the service.

    They do what the service answers, and take its silence for a stop. What happened
    while this process had to wait for its turn is made up for: each order is obeyed as
    of the instant at which it came.

    Attributes:
        client: The client they talk by.
        plant: The arms.

    Args:
        client: A client that is connected.
        scene: The scene of its welcome.
        imperfection: How inexact and late they are.
        trace: Where what is true is written, see `trace_of`; nowhere if None.
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
        self._nothing = np.zeros(len(scene.q_names))
        self._knock = 0.0
        self._trace = None if trace is None else RingWriter(trace, TRACE_SIZE)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Move, measure, send, obey, until something is true."""
        client, plant = self.client, self.plant
        period = client.welcome.period
        due = client.clock()
        while not until():
            plant.advance(max(client.clock() - plant.time, 0.0))
            self._write()
            q, v = plant.measure()
            client.send_state(q, v, stamp=plant.time)
            # A turn that was missed is not made up for.
            due = max(due + period, plant.time)
            while (left := due - client.clock()) > 0.0:
                answer = client.receive(timeout=left)
                if answer is not None:
                    plant.tell(answer.velocity, answer.actions, at=client.clock())
            if client.silent:
                plant.tell(self._nothing, self._stops)
                self._find_again()

    def close(self) -> None:
        """End the trace; the client is its owner's."""
        if self._trace is not None:
            self._trace.close()

    def _find_again(self) -> None:
        """Ask now and then whether a service is there again."""
        if self.plant.time < self._knock:
            return
        self._knock = self.plant.time + KNOCK
        try:
            self.client.connect(timeout=0.1)
        except StationError:
            return

    def _write(self) -> None:
        if self._trace is not None:
            self._trace.append(trace_of(self.plant.time, self.plant))


def trace_of(time: float, plant: Plant) -> Floats:
    """What is true: time, then whether each arm is held, then positions, velocities."""
    held: Mapping[str, bool] = plant.held
    return np.concatenate([[time], [*held.values()], plant.q, plant.v])
