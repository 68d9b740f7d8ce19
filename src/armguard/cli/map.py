"""`armguard map`: which parts of plans may be executed together, and when."""

import csv
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from ruamel.yaml import YAML
from typer import Option

from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    Json,
    loading_bar,
    out,
    print_json,
    with_options,
)
from armguard.errors import StationError
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.coordination import CoordinationMap
from armguard.maps.interlocks import Interlock
from armguard.maps.job import map_of, read_job
from armguard.maps.picture import draw_map, draw_slice
from armguard.maps.schedule import Schedule
from armguard.maps.slices import configuration_slice
from armguard.scene import load_scene


@dataclass(frozen=True, kw_only=True)
class Options:
    """The command line."""

    job: Annotated[
        Path | None,
        typer.Argument(help="Cell job: YAML with a scene and the plan of each robot."),
    ] = None
    out: Annotated[Path, Option(help="Folder that the results are written to.")] = (
        Path()
    )
    joints: Annotated[
        str | None,
        Option(
            help="In place of a job: two joints of one robot, ROBOT/JOINT,ROBOT/JOINT, "
            "whose free configurations are drawn."
        ),
    ] = None
    scene: Annotated[Path | None, Option(help="Scene file of the joints.")] = None
    anywhere: Annotated[
        str | None,
        Option(
            help="Joints that may be anywhere, ROBOT/JOINT,...; all others are at home."
        ),
    ] = None
    view: Annotated[
        bool,
        Option(
            help="Show the schedule and the diagrams, or the slice, in the browser; "
            "dragging along one moves the robots."
        ),
    ] = False
    page_port: Annotated[int, Option(help="Port of that page; 0 for a free one.")] = (
        8080
    )
    json: Json = False


@with_options(Options)
def map_plans(options: Options) -> None:
    """Draw which parts of robots' plans may be executed together; find a schedule.

    Exit code 0 a schedule is found, 1 there is none or a plan alone comes too near,
    2 bad input.
    """
    if options.view and find_spec("viser") is None:
        raise StationError("the view needs viser: pip install 'armguard[view]'")
    options.out.mkdir(parents=True, exist_ok=True)
    if options.joints is not None:
        map_joints(options)
        return
    if options.job is None:
        raise CoordinationError("give a cell job, or --joints and --scene")
    with loading_bar() as progress:
        job = read_job(options.job, progress)
        cell = map_of(job)
    schedule, interlocks, problem = None, tuple[Interlock, ...](), None
    try:
        schedule = cell.schedule()
        interlocks = cell.interlocks(schedule)
    except CoordinationError as error:
        problem = str(error)
    write_results(cell, schedule, interlocks, options.out)
    if options.json:
        print_json(answer_of(cell, schedule, interlocks, problem))
    else:
        out.print(cell.sentence, markup=False)
        for rule in interlocks:
            out.print(f"  {rule.sentence}", markup=False)
        if schedule is not None:
            seconds = cell.execute(interlocks).times[-1]
            out.print(f"  by these interlocks {seconds:.1f} s", markup=False)
        for line in alone_lines(cell):
            out.print(f"  {line}", markup=False)
    if options.view:
        from armguard.view.__main__ import show
        from armguard.view.mapped_view import MappedView

        show(MappedView(job.scene, cell, schedule, options.page_port))
    clear = schedule is not None and not any(cell.alone.values())
    raise typer.Exit(CLEAR if clear else TOO_CLOSE)


def map_joints(options: Options) -> None:
    """Draw a slice of configurations."""
    names = (options.joints or "").split(",")
    if len(names) != 2 or options.scene is None:
        raise CoordinationError(
            "give two joints, --joints ROBOT/JOINT,ROBOT/JOINT, and their --scene"
        )
    anywhere = [name for name in (options.anywhere or "").split(",") if name]
    with loading_bar() as progress:
        scene = load_scene(options.scene, progress=progress)
    found = configuration_slice(scene, (names[0], names[1]), anywhere)
    draw_slice(found, options.out / "slice.png")
    np.savez_compressed(
        options.out / "slice.npz",
        joints=found.joints,
        anywhere=np.array(found.anywhere, dtype=np.str_),
        lower=np.array(found.lower),
        step=np.array(found.step),
        labels=found.labels,
    )
    if options.json:
        shares = [found.share(label) for label in range(3)]
        keys = ("free", "forbidden", "unknown")
        print_json({"joints": names, **dict(zip(keys, shares, strict=True))})
    else:
        out.print(found.sentence, markup=False)
    if options.view:
        from armguard.view.__main__ import show
        from armguard.view.mapped_view import SlicedView

        show(SlicedView(scene, found, options.page_port))


def write_results(
    cell: CoordinationMap,
    schedule: Schedule | None,
    interlocks: tuple[Interlock, ...],
    folder: Path,
) -> None:
    """Write the picture and the map, and schedule and interlocks if there are any."""
    draw_map(cell, schedule, folder / "diagram.png")
    arrays: dict[str, Any] = {"robots": np.array(cell.robots)}
    for diagram in cell.diagrams:
        name = "_".join(diagram.robots)
        arrays[f"{name}_labels"] = diagram.labels
        arrays[f"{name}_starts"] = np.array(diagram.starts)
        arrays[f"{name}_durations"] = np.array(diagram.durations)
        arrays[f"{name}_step"] = np.array(diagram.step)
    np.savez_compressed(folder / "map.npz", **arrays)
    if schedule is None:
        return
    with (folder / "schedule.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *schedule.robots])
        for time, places in zip(schedule.times, schedule.plan_times, strict=True):
            writer.writerow([f"{x:.6f}" for x in (time, *places)])
    rows = [row_of(rule) for rule in interlocks]
    with (folder / "interlocks.yaml").open("w") as file:
        YAML().dump({"interlocks": rows}, file)
    with (folder / "interlocks.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, ("robot", "waits_at", "until", "passed", "words"))
        table.writeheader()
        table.writerows(rows)


def row_of(rule: Interlock) -> dict[str, Any]:
    """An interlock as plain numbers and strings; times are those of plans [s]."""
    return {
        "robot": rule.waiting.robot,
        "waits_at": round(rule.at, 6),
        "until": rule.other.robot,
        "passed": round(rule.until, 6),
        "words": rule.sentence,
    }


def alone_lines(cell: CoordinationMap) -> list[str]:
    """What plans do by themselves, one line for each interval."""
    return [
        f"{robot} alone: {one.nearest.a} and {one.nearest.b} may be too near from "
        f"{one.start:.3f} s to {one.end:.3f} s of its plan"
        for robot, intervals in cell.alone.items()
        for one in intervals
    ]


def answer_of(
    cell: CoordinationMap,
    schedule: Schedule | None,
    interlocks: tuple[Interlock, ...],
    problem: str | None,
) -> dict[str, Any]:
    """The answer as one JSON object."""
    return {
        "robots": cell.robots,
        "free": cell.free,
        "forbidden": cell.touching,
        "unknown": cell.unknown,
        "problem": problem,
        "together_s": None if schedule is None else schedule.makespan,
        "by_interlocks_s": (
            None if schedule is None else cell.execute(interlocks).times[-1]
        ),
        "one_after_another_s": cell.one_after_another,
        "without_interference_s": cell.without_interference,
        "waits": [] if schedule is None else [asdict(one) for one in schedule.waits],
        "interlocks": [row_of(rule) for rule in interlocks],
        "alone": alone_lines(cell),
    }
