"""`armguard serve`: guard a scene as a process of its own."""

import logging
import signal
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import FrameType
from typing import Annotated

from typer import Option

from armguard.cli.console import (
    SceneName,
    compile_kernels,
    loading_bar,
    say,
    with_options,
)
from armguard.scene.file import stated_cycle
from armguard.scene.settings import CHOICES
from armguard.sense.world import sensed_space
from armguard.service.server import Service, ServiceSettings
from armguard.service.server.scenes import open_scene
from armguard.service.server.throttled_log import PatientHandler
from armguard.service.wire import read_keys

USUAL = ServiceSettings()


@dataclass(frozen=True, kw_only=True)
class Options:
    """The command line; `ServiceSettings` has the options of the same names."""

    scene: SceneName
    port: Annotated[int, Option(help="UDP port; 0 for a free one.")] = USUAL.port
    bind: Annotated[
        str, Option(help="Address; all except loopback need --key-file.")
    ] = USUAL.bind
    key_file: Annotated[
        Path | None,
        Option(help="File with the key of each role; new keys if left out."),
    ] = None
    rate: Annotated[
        float | None,
        Option(
            help=f"Rate of the cycles [Hz]; that of the scene's `cycle`, or "
            f"{USUAL.rate:g}, if left out."
        ),
    ] = None
    late: Annotated[
        float | None,
        Option(
            help="Permitted delay of a cycle beyond its period [s]; that of the "
            f"scene's `cycle`, or {USUAL.late:g}, if left out."
        ),
    ] = None
    wish_watchdog: Annotated[
        float,
        Option(
            help="Validity of a desired motion [s]; longer than a round trip to the "
            "operator."
        ),
    ] = USUAL.wish_watchdog
    stale: Annotated[
        float | None,
        Option(help="Permitted age of states [s]; that of the scene if left out."),
    ] = None
    mode: Annotated[
        str | None, Option(help="Computation of required distances: path or speed.")
    ] = None
    response: Annotated[
        str | None,
        Option(help=f"Response of the robots: {', '.join(CHOICES['kind'])}."),
    ] = None
    reflex: Annotated[
        Path | None,
        Option(
            help="File of the reflex that service and controllers obey; that of the "
            "scene if left out."
        ),
    ] = None
    ring: Annotated[
        Path | None,
        Option(
            help="File of the ring, for views and recorders; in memory if left out."
        ),
    ] = None
    record: Annotated[Path | None, Option(help="Folder for recordings.")] = None
    metrics: Annotated[
        int | None, Option(help="Port of the metrics for Prometheus.")
    ] = None
    zenoh: Annotated[bool, Option(help="Start the Zenoh bridge as well.")] = False
    sense: Annotated[
        bool, Option(help="Start the map's process as well: sensors of the scene.")
    ] = False
    simulated_sensors: Annotated[
        bool,
        Option(help="Start the map, and simulated sensors that see unknown boxes."),
    ] = False
    view: Annotated[bool, Option(help="Start the live view as well.")] = False
    realtime: Annotated[bool, Option(help="Request real-time scheduling.")] = False
    lock_memory: Annotated[
        bool, Option(help="Request memory that is never swapped out.")
    ] = False
    cpu: Annotated[int | None, Option(help="Processor core for the loop.")] = None
    spin: Annotated[
        float, Option(help="Time before an expected state in which the loop polls [s].")
    ] = USUAL.spin
    stopped: Annotated[
        bool, Option(help="Keep robots stopped until they are engaged.")
    ] = False
    self_test: Annotated[bool, Option(help="Run the self-test at the start.")] = True

    def settings(self) -> ServiceSettings:
        """Settings of the service.

        Raises:
            KeyFileError: The key file cannot be used.
            SceneFileError: The scene file is wrong.
            ServiceError: A setting is out of its bounds.
        """
        shared = {field.name for field in fields(self)} & {
            field.name for field in fields(ServiceSettings)
        }
        given = {name: getattr(self, name) for name in shared}
        stated = stated_cycle(self.scene) if Path(self.scene).is_file() else {}
        if self.rate is None:
            period = stated.get("period")
            given["rate"] = USUAL.rate if period is None else 1.0 / period
        if self.late is None:
            given["late"] = stated.get("late", USUAL.late)
        return ServiceSettings(
            **given,
            keys={} if self.key_file is None else read_keys(self.key_file),
            companions=self.companions(),
        )

    def companions(self) -> dict[str, tuple[str, ...]]:
        """Processes to start beside the service, by name, with their arguments."""
        keyed = () if self.key_file is None else ("--key-file", str(self.key_file))
        found: dict[str, tuple[str, ...]] = {}
        if self.record is not None:
            found["record"] = ("--folder", str(self.record))
        if self.metrics is not None:
            found["metrics"] = ("--port", str(self.metrics))
        if self.zenoh:
            found["zenoh"] = ("--companion", *keyed)
        if self.sense or self.simulated_sensors:
            found["sense"] = (self.scene, *keyed)
        if self.simulated_sensors:
            found["rig"] = (self.scene, *keyed)
        if self.view:
            found["view"] = keyed
        return found


@with_options(Options)
def serve(options: Options) -> None:
    """Run the guard as a service, for programs in other processes.

    Controllers send measured joints, and a commander the desired motion.

    The first line on standard output has the address. Standard error has the log: stops
    as they begin, and each slowing or stop with its duration when it is over. SIGTERM
    and Ctrl-C end the service.
    """
    patient = PatientHandler()
    logging.basicConfig(level=logging.INFO, handlers=[patient])
    settings = options.settings()
    with loading_bar() as progress:
        scene, file = open_scene(
            options.scene,
            period=settings.period,
            late=settings.late,
            stale=settings.stale,
            mode=options.mode,
            response=options.response,
            progress=progress,
        )
    if settings.reflex is None and scene.reflex is not None:
        settings = replace(settings, reflex=Path(file).parent / scene.reflex.file)
    if options.sense or options.simulated_sensors:
        sensed_space(scene)
    compile_kernels({robot.mode for robot in scene.robots.values()} != {"fixed"})
    handle_signals(end_now)
    service = Service(scene, settings, file=file)
    received: list[int] = []
    handle_signals(lambda number, _: received.append(number))
    for note in service.notes:
        say(f"note: {note}")
    where = f"{settings.bind}:{service.port}, ring {service.ring.path}"
    print(f"listening on {where}", flush=True)
    service.run(until=lambda: bool(received))
    patient.finish()


def handle_signals(handler: Callable[[int, FrameType | None], object]) -> None:
    """Set the handler of the signals that end the service."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handler)


def end_now(number: int, _: FrameType | None) -> None:
    """End the program while the service is made; what was opened is closed."""
    raise SystemExit(128 + number)
