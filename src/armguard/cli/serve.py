"""`armguard serve`: guard a scene as a process of its own."""

import logging
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from armguard.cli.console import say, say_progress


def serve(
    scene: Annotated[
        str, typer.Argument(help="Scene file, or a bundled scene: bay, two-pandas.")
    ],
    port: Annotated[
        int, typer.Option(help="UDP port; 0 for one that is free.")
    ] = 47800,
    bind: Annotated[
        str, typer.Option(help="Address; all but loopback need --key-file.")
    ] = "127.0.0.1",
    key_file: Annotated[
        Path | None,
        typer.Option(help="File with the key of each role; new keys if left out."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Cycles a second [Hz].")] = 250.0,
    late: Annotated[
        float, typer.Option(help="How much later than its period a cycle may come [s].")
    ] = 0.004,
    wish_watchdog: Annotated[
        float,
        typer.Option(
            help="How long a wish counts [s]; longer than a round trip to the operator."
        ),
    ] = 0.1,
    stale: Annotated[
        float | None,
        typer.Option(help="How old states may be; as the scene says if left out [s]."),
    ] = None,
    mode: Annotated[
        str | None, typer.Option(help="How distances are made: path or speed.")
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(help="What robots do: stop, slow, deflect or field."),
    ] = None,
    ring: Annotated[
        Path | None, typer.Option(help="File of the ring; in memory if left out.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Folder to record everything into.")
    ] = None,
    metrics: Annotated[
        int | None, typer.Option(help="Port to serve metrics for Prometheus on.")
    ] = None,
    zenoh: Annotated[bool, typer.Option(help="Also speak Zenoh.")] = False,
    view: Annotated[bool, typer.Option(help="Also open the live view.")] = False,
    realtime: Annotated[
        bool, typer.Option(help="Ask for real-time scheduling.")
    ] = False,
    lock_memory: Annotated[
        bool, typer.Option(help="Ask for memory that is never swapped out.")
    ] = False,
    cpu: Annotated[int | None, typer.Option(help="Processor to stay on.")] = None,
    spin: Annotated[
        float,
        typer.Option(help="Stay awake for so long before a state is expected [s]."),
    ] = 0.0,
    stopped: Annotated[
        bool, typer.Option(help="Keep robots stopped until they are engaged.")
    ] = False,
    self_test: Annotated[
        bool, typer.Option(help="Let the guard test itself first.")
    ] = True,
) -> None:
    """Guard a scene for controllers and a commander, until told to end.

    The first line on standard output tells where it listens.
    """
    from armguard.respond.compiling import compile_ahead
    from armguard.station.service import Service, ServiceSettings
    from armguard.station.service.scenes import open_scene
    from armguard.station.service.throttled_log import PatientHandler
    from armguard.station.wire import read_keys

    patient = PatientHandler()
    logging.basicConfig(level=logging.INFO, handlers=[patient])
    companions: dict[str, tuple[str, ...]] = {}
    keyed = () if key_file is None else ("--key-file", str(key_file))
    if record is not None:
        companions["record"] = ("--folder", str(record))
    if metrics is not None:
        companions["metrics"] = ("--port", str(metrics))
    if zenoh:
        companions["zenoh"] = ("--companion", *keyed)
    if view:
        companions["view"] = keyed
    settings = ServiceSettings(
        bind=bind,
        port=port,
        keys={} if key_file is None else read_keys(key_file),
        rate=rate,
        late=late,
        stale=stale,
        wish_watchdog=wish_watchdog,
        ring=ring,
        self_test=self_test,
        realtime=realtime,
        lock_memory=lock_memory,
        cpu=cpu,
        spin=spin,
        stopped=stopped,
        companions=companions,
    )
    # The default action ends the program at once. A handler of Python would run only
    # after the compiler has returned, minutes later.
    for ending in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ending, signal.SIG_DFL)
    opened, file = open_scene(
        scene,
        period=settings.period,
        late=late,
        stale=stale,
        mode=mode,
        response=response,
        progress=say_progress,
    )
    modes = {robot.mode for robot in opened.robots.values()}
    compile_ahead(say, guarded=modes != {"fixed"})
    asked: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        asked.append(number)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    service = Service(opened, settings, file=file)
    for note in service.notes:
        say(f"note: {note}")
    sys.stdout.write(f"listening on {bind}:{service.port}, ring {service.ring.path}\n")
    sys.stdout.flush()
    service.run(until=lambda: bool(asked))
    patient.finish()
