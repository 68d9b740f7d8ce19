"""`armguard bench`: our cycle and its peers, measured in one run."""

import json as json_format
from pathlib import Path
from typing import Annotated

import typer

from armguard.cli.console import JsonOption, jsonable, out, print_json, say


def bench(
    name: Annotated[
        str,
        typer.Argument(
            help="cycle, stop, filter, gripping, index, memory, distance, scale; all."
        ),
    ] = "all",
    cycles: Annotated[
        int | None, typer.Option(min=1, help="Cycles to measure.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Write the JSON here as well.")
    ] = None,
    json: bool = JsonOption,
) -> None:
    """Measure: figures are printed, never asserted."""
    from armguard.benchmark import print_result, run

    answer = run(name, cycles=cycles, progress=say)
    if output is not None:
        text = json_format.dumps(jsonable(answer), indent=1)
        output.write_text(text + "\n", encoding="utf-8")
    if json:
        print_json(answer)
    else:
        out.print(print_result(answer), markup=False)
