"""`armguard reserve`: when each robot of a cell may start its plan."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    Json,
    loading_bar,
    out,
    print_json,
)
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.job import read_job
from armguard.maps.regions import EDGE
from armguard.maps.reservations import Booking, Reservations


def reserve(
    job: Annotated[
        Path,
        typer.Argument(help="Cell job: YAML with a scene and the plan of each robot."),
    ],
    edge: Annotated[float, Option(help="Edge of a cell of space [m].")] = EDGE,
    json: Json = False,
) -> None:
    """Find when each robot may start its plan; each waits where its plan begins.

    Robots reserve cells of space for times, that with the highest priority first.

    Exit code 0 all plans have a start, 1 one has none, 2 bad input.
    """
    with loading_bar() as progress:
        cell = read_job(job, progress)
    space = Reservations(cell.scene, edge=edge, floor=cell.floor)
    order = sorted(cell.plans, key=lambda robot: -cell.plans[robot].priority)
    regions = [space.region(robot, cell.plans[robot]) for robot in order]
    bookings, problem = tuple[Booking, ...](), None
    try:
        bookings = space.in_turn(regions)
    except CoordinationError as error:
        problem = str(error)
    total = sum(region.duration for region in regions)
    if json:
        print_json(
            {
                "starts": [asdict(one) for one in bookings],
                "problem": problem,
                "together_s": max((one.end for one in bookings), default=None),
                "one_after_another_s": total,
            }
        )
    elif problem is not None:
        out.print(problem, markup=False)
    else:
        for one in bookings:
            out.print(one.sentence, markup=False)
        last = max(one.end for one in bookings)
        out.print(f"{last:.1f} s together, {total:.1f} s one after the other")
    raise typer.Exit(CLEAR if problem is None else TOO_CLOSE)
