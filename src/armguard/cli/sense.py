"""`armguard sense`: the map as a process, or frames of sensors played again."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from typer import Option

from armguard.cli.console import (
    CLEAR,
    Json,
    RobotOption,
    SceneFile,
    loading_bar,
    out,
    print_json,
)
from armguard.recording.sensor_files import sensor_source
from armguard.scene import load_scene
from armguard.sense import Sense, SensorHealth
from armguard.service.mapping.__main__ import fill_map

# Exit code if a sensor was at fault, or an object is missing.
AT_FAULT = 1


def sense(
    scene: SceneFile,
    play: Annotated[
        list[Path] | None,
        Option(
            help="File of joint positions and frames: ours, a bag of ROS, a cloud, a "
            "folder of clouds or depth images; a tree of OctoMap (.bt) is a start of "
            "the map. Repeat it for several, which are played in order."
        ),
    ] = None,
    topic: Annotated[
        list[str] | None,
        Option(help="Sensor of a topic of a bag, as SENSOR=/topic; repeat it."),
    ] = None,
    service: Annotated[
        str | None,
        Option(help="HOST:PORT of a service on this machine, whose map is filled."),
    ] = None,
    record: Annotated[
        Path | None, Option(help="With --service: file for positions and frames.")
    ] = None,
    port: Annotated[
        int, Option(help="With --service: UDP port for frames; 0 for a free one.")
    ] = 0,
    key_file: Annotated[
        Path | None, Option(help="With --service: file with the service's keys.")
    ] = None,
    robot: RobotOption = None,
    json: Json = False,
) -> None:
    """Let sensors fill the map of a service, or play their frames from a file.

    With --service it runs until it is ended. Exit codes: 0 all sensors were in order,
    1 a sensor was at fault or a modelled object is missing, 2 the file cannot be read,
    or the service has another scene.
    """
    if (play is None) == (service is None):
        raise typer.BadParameter("give either --play FILE or --service HOST:PORT")
    if play is None:
        assert service is not None
        fill_map(str(scene), service, port, record, key_file)
        return
    with loading_bar() as progress:
        loaded = load_scene(scene, robot=robot, progress=progress)
    sensed, events, notes = Sense(loaded), 0, list[str]()
    for path in play:
        if path.suffix.lower() == ".bt":
            sensed.cells.read_octomap(path, 0.0)
            continue
        source = sensor_source(path, loaded, topic or ())
        events += sensed.play(source.events)
        notes += source.notes
    answer = answer_of(sensed, events) | {"notes": notes}
    if json:
        print_json(answer)
    else:
        show(answer)
    raise typer.Exit(answer["exit_code"])


def answer_of(sensed: Sense, events: int) -> dict[str, Any]:
    """What became of all frames, as plain values; times in s."""
    sensors = {name: row_of(health) for name, health in sensed.health.items()}
    faulty = any(row["faults"] for row in sensors.values()) or bool(sensed.missing)
    return {
        "events": events,
        "intakes": {one.name: count for one, count in sensed.intakes.items()},
        "sensors": sensors,
        "missing": dict(sensed.missing),
        "occupied": int(sensed.cells.occupied().sum()),
        "known_free": int(sensed.cells.known_free().sum()),
        "exit_code": AT_FAULT if faulty else CLEAR,
    }


def row_of(health: SensorHealth) -> dict[str, Any]:
    """State of a sensor, and all its faults."""
    return {
        "state": str(health),
        "frames": sum(health.intakes.values()),
        "faults": [
            {"fault": one.fault.name, "from": one.since, "to": one.seen, "is": str(one)}
            for one in (*health.past, *health.faults.values())
        ],
    }


def show(answer: dict[str, Any]) -> None:
    """Print it."""
    table = Table("sensor", "frames", "state", box=None)
    for name, row in answer["sensors"].items():
        table.add_row(name, str(row["frames"]), row["state"])
    out.print(table)
    for name, row in answer["sensors"].items():
        for one in row["faults"]:
            out.print(f"{one['from']:.3f} to {one['to']:.3f} s: {name}: {one['is']}")
    for name, since in answer["missing"].items():
        out.print(f"{since:.3f} s: object '{name}' is not where the scene has it")
    for note in answer["notes"]:
        out.print(f"note: {note}")
    counts = ", ".join(f"{count} {name}" for name, count in answer["intakes"].items())
    out.print(
        f"{answer['events']} events ({counts}); {answer['occupied']} cells occupied, "
        f"{answer['known_free']} known free"
    )
