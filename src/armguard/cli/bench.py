"""`armguard bench`: our cycle and its peers, and the service, measured in one run."""

import json as json_format
from pathlib import Path
from typing import Annotated, Any

import typer

from armguard.cli.console import JsonOption, jsonable, out, print_json, say


def bench(
    name: Annotated[
        str,
        typer.Argument(
            help="cycle, stop, filter, gripping, index, memory, distance, scale; all. "
            "Or service, which takes ten minutes."
        ),
    ] = "all",
    cycles: Annotated[
        int | None, typer.Option(min=1, help="Cycles to measure.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Write the JSON here as well.")
    ] = None,
    json: bool = JsonOption,
    seconds: Annotated[
        float, typer.Option(min=0.5, help="service: how long [s].")
    ] = 600.0,
    rate: Annotated[
        float, typer.Option(min=1.0, help="service: cycles a second [Hz].")
    ] = 1000.0,
    view: Annotated[bool, typer.Option(help="service: a view looks on.")] = True,
    record: Annotated[
        bool, typer.Option(help="service: everything is recorded.")
    ] = True,
    realtime: Annotated[
        bool,
        typer.Option(help="service: it and what it is compared with are real-time."),
    ] = False,
    spin: Annotated[
        float,
        typer.Option(min=0.0, help="service: see `armguard serve --spin` [s]."),
    ] = 0.0,
    soak: Annotated[
        float | None,
        typer.Option(min=0.1, help="service: memory over so many minutes instead."),
    ] = None,
) -> None:
    """Measure: figures are printed, never asserted."""
    if name == "service":
        from armguard.benchmark.service import ServiceBench, bench_service
        from armguard.benchmark.service_figures import print_service

        wanted = ServiceBench(
            seconds=seconds if soak is None else 60.0 * soak,
            rate=rate,
            view=view,
            record=record,
            realtime=realtime,
            spin=spin,
            soak=soak is not None,
        )
        hand_over(bench_service(wanted, say), print_service, output, json)
        return
    from armguard.benchmark import print_result, run

    hand_over(run(name, cycles=cycles, progress=say), print_result, output, json)


def hand_over(
    answer: dict[str, Any], in_words: Any, output: Path | None, json: bool
) -> None:
    """Figures to where they are wanted.

    Args:
        answer: The figures.
        in_words: Puts them into lines.
        output: File to write the JSON to, if any.
        json: Whether to print JSON.
    """
    if output is not None:
        text = json_format.dumps(jsonable(answer), indent=1)
        output.write_text(text + "\n", encoding="utf-8")
    if json:
        print_json(answer)
    else:
        out.print(in_words(answer), markup=False, soft_wrap=True)
