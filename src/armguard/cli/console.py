"""Shared by all commands: options, exit codes, JSON, progress, messages."""

import json
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer
from rich.console import Console, ConsoleDimensions
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

if TYPE_CHECKING:
    from armguard.guard.events import Event
    from armguard.guard.levels import Level
    from armguard.guard.verdict import Verdict

CLEAR = 0
TOO_CLOSE = 1
BAD_INPUT = 2

# Colours of levels, by name: they differ for the colour-blind as well, and the text has
# the same information.
STYLES = {
    "CLEAR": "blue",
    "CAUTION": "yellow",
    "SLOW": "bold yellow",
    "STOP": "bold magenta",
    "RECOVER": "magenta",
    "BRAKE": "bold white on magenta",
    "HARDWARE_STOP": "bold white on red",
}

# Width of a line that is not for a terminal: no table or sentence is that long.
UNBROKEN = 100_000


class Lines(Console):
    """Console that breaks no line outside a terminal, so that text can be searched."""

    # Nothing sets it, so it needs no setter.
    @property  # type: ignore[misc]
    def size(self) -> ConsoleDimensions:
        """Size of the terminal; outside one, a width that no line has."""
        found = super().size
        return found if self.is_terminal else ConsoleDimensions(UNBROKEN, found.height)


out = Lines(highlight=False)
# Progress and remarks, so that standard output holds the answer alone.
err = Lines(stderr=True, highlight=False)

Options = TypeVar("Options")

# Arguments and options of several commands.
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print every change of pair or level.")
]
SceneFile = Annotated[
    Path, typer.Argument(help="Scene file of armguard, or planning scene of MoveIt.")
]
SceneName = Annotated[
    str,
    typer.Argument(
        help="Scene file, or a bundled scene: bay, two-pandas, sensed-table, conveyor."
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(help="Robot of a MoveIt scene: a URDF file or a bundled robot."),
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


def compile_kernels(guarded: bool = True) -> None:
    """On the first start compile all kernels of a guard, and report the time left.

    Meanwhile a signal ends the program at once: a handler in Python would run only
    after the compiler has returned.

    Args:
        guarded: Whether stops are predicted.
    """
    from armguard.respond.compiling import compile_ahead
    from armguard.respond.guard import try_out

    numbers = (signal.SIGTERM, signal.SIGINT)
    before = [signal.signal(number, signal.SIG_DFL) for number in numbers]
    compile_ahead(say, guarded, try_out)
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def plain_table(*titles: str) -> Table:
    """A table without lines, whose cells are folded where they are too long."""
    columns = (Column(title, overflow="fold") for title in titles)
    return Table(*columns, box=None, pad_edge=False)


@contextmanager
def progress_bar(title: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar on standard error; call it with the steps made."""
    with bars() as progress:
        task = progress.add_task(title, total=total)
        yield lambda steps: progress.update(task, advance=steps)


@contextmanager
def loading_bar() -> Iterator[Callable[[str, int, int], None]]:
    """A bar on standard error; call it before each step of loading a scene.

    With what the step does, its number and their count. Outside a terminal each step is
    a line.
    """
    if not err.is_terminal:
        yield lambda what, number, count: say(
            f"{what}, {number} of {count}" if count > 1 else what
        )
        return
    with bars() as progress:
        task = progress.add_task("", visible=False)

        def show(what: str, number: int, count: int) -> None:
            progress.update(
                task, description=what, completed=number - 1, total=count, visible=True
            )

        yield show


def bars() -> Progress:
    """Bars with their counts and the time left, erased at the end."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed} of {task.total},"),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=err,
        transient=True,
    )


def event_line(event: "Event", start: float) -> str:
    """An event as one line of rich's markup.

    Args:
        event: The event.
        start: Stamp from which its time counts [s].
    """
    return (
        f"{event.began - start:8.2f} s  {level_word(event.level)}"
        f" for {event.seconds:5.2f} s  {escape(event.why)}"
    )


def cycle_line(verdict: "Verdict", start: float) -> str:
    """A cycle as one line of rich's markup, aligned with `event_line`."""
    time = (verdict.stamp or 0.0) - start
    return (
        f"{time:8.2f} s  {level_word(verdict.level)}              {escape(verdict.why)}"
    )


def level_word(level: "Level") -> str:
    """A level in its colour, padded."""
    return f"[{STYLES[level.name]}]{level.name:13}[/]"


def exit_code(levels: "dict[Level, int]", faults: int) -> int:
    """Exit code of a run: input that could not be judged outranks closeness."""
    from armguard.guard.levels import Level

    if faults:
        return BAD_INPUT
    stopped = any(n for level, n in levels.items() if level >= Level.STOP)
    return TOO_CLOSE if stopped else CLEAR
