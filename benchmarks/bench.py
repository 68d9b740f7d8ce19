"""Our cycle and its peers, and the service, measured in one run.

make bench                              everything but the service
make bench ARGS="filter --cycles 500"   one of them
make bench ARGS="batch --scene FILE"    rates of batches in a given scene
make bench ARGS="robots --only shelf --cycles 100000"   cycles in one scene
make bench ARGS="service --seconds 60"  the service, ten minutes if not given
make bench ARGS="joint_table --output docs/joint_table.json"   the joint-space table
make bench ARGS=regions                 whole arms beside region octrees
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from armguard.cli.console import Json, json_of, out, print_json, say, with_options
from armguard.entry import run_program
from armguard.errors import UnknownNameError, did_you_mean
from speed.service import ServiceBench, bench_service
from speed.service_figures import print_service
from timing import describe_machine

# Each is a module of `speed` with a function `bench` and a count `CYCLES`.
NAMES = (
    "cycle",
    "robots",
    "batch",
    "stop",
    "filter",
    "gripping",
    "index",
    "memory",
    "sensed",
    "sense",
    "distance",
    "scale",
)

# Those that `all` leaves out.
ALONE = ("octree", "joint_table", "regions")


@dataclass(frozen=True, kw_only=True)
class Options(ServiceBench):
    """The command line."""

    name: Annotated[
        str,
        typer.Argument(
            help=f"{', '.join(NAMES)}; all. Or service, which takes ten minutes, "
            "octree, which draws the tree of the bay, joint_table, or regions."
        ),
    ] = "all"
    cycles: Annotated[int | None, Option(min=1, help="Cycles to measure.")] = None
    scene: Annotated[
        Path | None, Option(help="Scene file, for batch; the bundled scenes if none.")
    ] = None
    only: Annotated[str | None, Option(help="One scene of robots; all if none.")] = None
    output: Annotated[Path | None, Option(help="Write the JSON here as well.")] = None
    json: Json = False


@with_options(Options)
def bench(options: Options) -> None:
    """Measure: figures are printed, never asserted."""
    if options.name == "service":
        answer = bench_service(options, say)
        lines = print_service(answer)
    else:
        given = {"scene": options.scene, "only": options.only}
        own = {key: value for key, value in given.items() if value is not None}
        answer = run(options.name, cycles=options.cycles, progress=say, **own)
        lines = print_result(answer)
    if options.output is not None:
        options.output.write_text(json_of(answer), encoding="utf-8")
    if options.json:
        print_json(answer)
    else:
        out.print(lines, markup=False, soft_wrap=True)


def run(
    name: str,
    *,
    cycles: int | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
    **own: Any,
) -> dict[str, Any]:
    """Run a benchmark.

    Args:
        name: One of `NAMES` or `ALONE`, or all.
        cycles: Cycles to measure; each benchmark has its own default.
        progress: Called with a sentence before each part that takes a while.
        **own: Arguments of one benchmark: `scene` of "batch", `only` of "robots".

    Returns:
        The figures; with "all", those of each under its name.

    Raises:
        UnknownNameError: There is no such benchmark.
    """
    if name == "all":
        return {key: run(key, cycles=cycles, progress=progress) for key in NAMES}
    if name not in (*NAMES, *ALONE):
        near = did_you_mean(name, [*NAMES, *ALONE, "all"])
        raise UnknownNameError(f"no benchmark is named '{name}'; {near}")
    module = import_module(f"speed.{name}")
    count = module.CYCLES if cycles is None else cycles
    figures = module.bench(count, progress, **own)
    return {"name": name, "machine": describe_machine(), **figures}


def print_result(value: Any, path: str = "") -> str:
    """Figures as text, one a line."""
    if isinstance(value, dict):
        parts = (
            print_result(item, f"{path}.{key}" if path else str(key))
            for key, item in value.items()
        )
        return "\n".join(part for part in parts if part)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "\n".join(f"{path}: {row_of(row)}" for row in value)
    return f"{path}: {value:.4g}" if isinstance(value, float) else f"{path}: {value}"


def row_of(row: dict[str, Any]) -> str:
    """The figures of a row of a table, without those that have parts of their own."""
    return ", ".join(
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in row.items()
        if not isinstance(value, dict)
    )


if __name__ == "__main__":
    app = typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
    )
    app.command()(bench)
    run_program(app)
