"""The application and its commands."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup


class Listed(NamedTuple):
    """A command in the list of `armguard --help`.

    Attributes:
        summary: The sentence beside its name: how its help begins.
        place: Its module and function, `module:function`; both have its name if empty.
    """

    summary: str
    place: str = ""


# A command's module takes up to two seconds to import, so it is imported when called.
LISTED = {
    "demo": Listed("Guard two simulated arms that a careless operator drives."),
    "init": Listed("Write a scene file for your robots."),
    "check": Listed("Check a scene."),
    "run": Listed("Judge a motion, cycle by cycle."),
    "verify": Listed("Prove that plans keep every buffer."),
    "serve": Listed("Run the guard as a service, for programs in other processes."),
    "keys": Listed("Write a key file for a service and its clients."),
    "reset": Listed("Lift the stop of a reflex."),
    "view": Listed("Show a running service or a recording in the browser."),
    "replay": Listed("Judge a recording again, and compare the results bit by bit."),
    "report": Listed("Write a report about a recording, one HTML page."),
    "batch": Listed("Check many configurations, the rows of a file."),
    "coordinate": Listed("Let robots execute jobs as they arrive."),
    "reserve": Listed("Find when each robot may start its plan."),
    "chaos": Listed("Inject faults into a simulated guard, and check the answers."),
    "map": Listed(
        "Draw which parts of robots' plans may be executed together.", "map:map_plans"
    ),
    "sense": Listed("Sensors fill the map.", "sensing:sensing"),
    "fleet": Listed("Audit, prove, replay or execute many motions with many workers."),
}


class Commands(Mapping[str, Any]):
    """The commands by name; each is imported when it is read."""

    def __getitem__(self, name: str) -> Any:
        module, _, function = (LISTED[name].place or f"{name}:{name}").partition(":")
        found = getattr(import_module(f"armguard.cli.{module}"), function)
        if not isinstance(found, typer.Typer):
            alone = typer.Typer(add_completion=False, rich_markup_mode=None)
            alone.command(name)(found)
            found = alone
        return typer.main.get_command(found)

    def __iter__(self) -> Iterator[str]:
        return iter(LISTED)

    def __len__(self) -> int:
        return len(LISTED)


class Application(TyperGroup):
    """The group of all commands; its list imports none of them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        # Typer's own would hold commands that are already imported.
        self.commands: Any = Commands()

    def format_commands(self, _ctx: Any, formatter: Any) -> None:
        """Write names and summaries."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, row.summary) for name, row in LISTED.items()])


app = typer.Typer(
    name="armguard",
    cls=Application,
    help="Real-time collision guard for robot arms. Exit codes: 0 clear, "
    "1 a pair came too close, 2 bad input.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback(invoke_without_command=True)
def armguard(
    version: bool = typer.Option(False, "--version", help="Print the version."),
) -> None:
    """Real-time collision guard for robot arms."""
    if version:
        from armguard import __version__

        typer.echo(__version__)
        raise typer.Exit
