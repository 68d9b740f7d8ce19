"""Faults of sensors, and of the process of the map."""

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP, Signals

import numpy as np

from armguard.chaos.fault import Effect, Fault, Injection, Unplayable
from armguard.chaos.injections import children
from armguard.chaos.playground import Playground
from armguard.errors import StationError
from armguard.sense import Fault as SensorFault
from armguard.service.client import SensorClient
from armguard.simulation.rig_link import ask_rig

GROUP = "sensors and the map"

MAP, RIG = "armguard.service.mapping", "armguard.simulation.rig"

# How long map and sensors get to fill the cells [s].
PATIENCE = 60.0

# How long a fault lasts that makes cells old [s].
LASTS = 4.0

# Messages of noise.
NOISE = 2000

# Does something to a running map or to its sensors.
Disturb = Callable[[Playground], None]


def sensed(
    begin: Disturb, end: Disturb | None = None, names: SensorFault | None = None,
    *, anew: bool = False,
) -> Injection:  # fmt: skip
    """A fault of a guard with simulated sensors.

    Args:
        begin: Begins it.
        end: Ends it; it ends by itself if None.
        names: How the health of the first sensor has to name it; any if None.
        anew: Whether the guard is started anew before: a service waits longer with each
            map that ends.
    """

    @contextmanager
    def inject(ground: Playground) -> Iterator[None]:
        if ground.scene.sensing is None:
            raise Unplayable("the scene has no sensors, so the service started no map")
        if anew:
            ground.restart()
        wait_for_map(ground)
        ground.settle()
        with SensorClient(ground.stage.port) as client:
            client.connect()
            ground.begin()
            begin(ground)
            try:
                yield
                if names is not None and not says(client, names):
                    raise AssertionError(f"not {names.name}: {client.health}")
            finally:
                if end is not None:
                    end(ground)
                wait_for_map(ground)

    return inject


def says(client: SensorClient, fault: SensorFault) -> bool:
    """Whether the health of the first sensor names a fault."""
    return fault.name in next(iter(client.health.values()), "")


def wait_for_map(ground: Playground) -> None:
    """Wait until every sensor is in order, or late as a busy machine has it.

    Raises:
        StationError: They are not in time.
    """
    end = time.monotonic() + PATIENCE
    with SensorClient(ground.stage.port) as client:
        client.connect()
        while time.monotonic() < end:
            ground.watch(0.1)
            health = client.health
            good = [one == "in order" or is_late(one) for one in health.values()]
            if sum(good) == len(ground.scene.sensors):
                return
        raise StationError(f"the map is not there again: {client.health}")


def is_late(state: str) -> bool:
    """Whether a sensor is late, and nothing else."""
    return state.startswith(SensorFault.LATE.name) and ";" not in state.replace(
        SensorFault.LATE.sentence, ""
    )


def process_of(ground: Playground, module: str) -> int:
    """A process that the service has started.

    Raises:
        Unplayable: There is none.
    """
    for pid in children(ground.stage.crew["service"].pid):
        if module in Path(f"/proc/{pid}/cmdline").read_text(errors="replace"):
            return pid
    raise Unplayable(f"the service started no '{module}' on this machine")


def signals(module: str, number: Signals) -> Disturb:
    """Send a signal to a process that the service has started."""
    return lambda ground: os.kill(process_of(ground, module), number)


def first_sensor(fault: str | None) -> Disturb:
    """Let the first sensor have a fault, see `rig_link.FAULTS`; none if None."""

    def disturb(ground: Playground) -> None:
        name = next(iter(ground.scene.sensors))
        found = ask_rig(ground.stage.port, {} if fault is None else {name: fault})
        if found is None:
            raise StationError("the simulated sensors do not answer")

    return disturb


def faulty(fault: str, names: SensorFault) -> Injection:
    """A fault of the first sensor, which its health has to name."""
    return sensed(first_sensor(fault), first_sensor(None), names)


def noise(ground: Playground) -> None:
    """Send noise to the port for frames."""
    rng, port = np.random.default_rng(0), port_of_frames(ground)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        for _ in range(NOISE):
            one.sendto(rng.bytes(int(rng.integers(0, 200))), ("127.0.0.1", port))


def port_of_frames(ground: Playground) -> int:
    """The port that takes frames.

    Raises:
        StationError: No map runs.
    """
    with SensorClient(ground.stage.port) as client:
        client.connect()
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if client.maps:
                return client.frames_port
            time.sleep(0.02)
    raise StationError("no map runs")


def second_program(ground: Playground) -> None:
    """Send frames of all sensors from a second program."""
    with SensorClient(ground.stage.port, name="second") as client:
        client.connect()
        end = time.monotonic() + 0.5
        while time.monotonic() < end:
            for name, one in ground.scene.sensors.items():
                near = np.full(one.zones[0] * one.zones[1], one.range[0])
                client.zones(name, near, None, client.clock())
            time.sleep(0.02)


SENSOR_FAULTS: tuple[Fault, ...] = (
    Fault(
        name="the map is killed, and started again", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "cycle"),
        counts=("companions_restarted",),
        inject=sensed(signals(MAP, SIGKILL), anew=True),
    ),
    Fault(
        name="the map is paused", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "cycle"),
        inject=sensed(signals(MAP, SIGSTOP), signals(MAP, SIGCONT)),
    ),
    Fault(
        name="all sensors are paused", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "cycle"),
        inject=sensed(signals(RIG, SIGSTOP), signals(RIG, SIGCONT), SensorFault.SILENT),
    ),
    Fault(
        name="a sensor is silent", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "sensor", "cycle"),
        inject=faulty("lost", SensorFault.SILENT),
    ),
    Fault(
        name="a sensor is blindfolded", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "sensor", "cycle"),
        inject=faulty("blind", SensorFault.BLIND),
    ),
    Fault(
        name="stamps of a sensor are in the future", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "sensor", "cycle"),
        inject=faulty("ahead", SensorFault.STAMP_AHEAD),
    ),
    Fault(
        name="stamps of a sensor go back", group=GROUP, effect=Effect.STOPS,
        reasons=("CELLS_STALE",), hold=LASTS, within=("cells", "sensor", "cycle"),
        inject=faulty("back", SensorFault.STAMP_BACK),
    ),
    Fault(
        name="noise on the port for frames", group=GROUP, effect=Effect.GOES_ON,
        inject=sensed(noise),
    ),
    Fault(
        name="a second program sends frames", group=GROUP, effect=Effect.GOES_ON,
        hold=0.6, inject=sensed(second_program),
    ),
)  # fmt: skip
