"""Shared by all commands: options, exit codes, JSON, progress, messages."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column, Table

from armguard.guard.events import Event
from armguard.guard.levels import Level

CLEAR = 0
TOO_CLOSE = 1
BAD_INPUT = 2

# Colours that differ for the colour-blind as well; the text has the same information.
STYLES = {
    Level.CLEAR: "blue",
    Level.CAUTION: "yellow",
    Level.SLOW: "bold yellow",
    Level.STOP: "bold magenta",
    Level.RECOVER: "magenta",
    Level.BRAKE: "bold white on magenta",
    Level.HARDWARE_STOP: "bold white on red",
}

out = Console(highlight=False)
# Progress and remarks, so that standard output holds the answer alone.
err = Console(stderr=True, highlight=False)

Options = TypeVar("Options")

# Arguments and options of several commands.
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
SceneFile = Annotated[Path, typer.Argument(help="Scene file: ours, or MoveIt's.")]
SceneName = Annotated[
    str, typer.Argument(help="Scene file, or a bundled scene: bay, two-pandas.")
]
RobotOption = Annotated[
    str | None, typer.Option(help="URDF for a MoveIt scene, or a robot's name.")
]
Rate = Annotated[float, typer.Option(help="Cycles a second [Hz].")]
Late = Annotated[
    float, typer.Option(help="How much later than its period a cycle may come [s].")
]


def with_options(
    options: type[Options],
) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """A command that takes its options as one object.

    Args:
        options: A dataclass; its fields are annotated as typer's parameters are.
    """

    def decorate(work: Callable[[Options], None]) -> Callable[..., None]:
        @wraps(work)
        def command(**chosen: Any) -> None:
            work(options(**chosen))

        # Typer reads both.
        command.__signature__ = signature(options)  # type: ignore[attr-defined]
        command.__annotations__ = get_type_hints(options)
        return command

    return decorate


def json_of(answer: dict[str, Any]) -> str:
    """One JSON object in lines; NaN and infinity become null."""
    return json.dumps(jsonable(answer), indent=1, allow_nan=False) + "\n"


def print_json(answer: dict[str, Any]) -> None:
    """Print one JSON object."""
    sys.stdout.write(json_of(answer))


def jsonable(value: Any) -> Any:
    """A value as JSON has it: NaN and infinity become None."""
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and (value != value or abs(value) == float("inf")):
        return None
    return value


def say(sentence: str) -> None:
    """A remark on standard error."""
    err.print(sentence, markup=False, style="dim")


def say_progress(what: str, number: int, count: int) -> None:
    """A remark before something that takes a second or more."""
    say(f"{what}, {number} of {count}" if count > 1 else what)


def plain_table(*titles: str) -> Table:
    """A table without lines, whose cells are folded where they are too long."""
    columns = (Column(title, overflow="fold") for title in titles)
    return Table(*columns, box=None, pad_edge=False)


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar on standard error; call it with the steps made."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True) as progress:
        task = progress.add_task(title, total=total)
        yield lambda steps: progress.update(task, advance=steps)


def event_line(event: Event) -> str:
    """An event as one line."""
    time = "" if event.stamp is None else f" {event.stamp:8.3f} s"
    style = STYLES[event.level]
    level = f"[{style}]{event.level.name:13}[/]"
    return f"{level} cycle {event.at:6d}{time}  {event.why}"


def exit_code(levels: dict[Level, int], faults: int) -> int:
    """Exit code of a run: input that could not be judged outranks closeness."""
    if faults:
        return BAD_INPUT
    stopped = any(n for level, n in levels.items() if level >= Level.STOP)
    return TOO_CLOSE if stopped else CLEAR
