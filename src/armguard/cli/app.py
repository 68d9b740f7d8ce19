"""The application and its commands."""

import typer

from armguard.cli.batch import batch
from armguard.cli.chaos import chaos
from armguard.cli.check import check
from armguard.cli.coordinate import coordinate
from armguard.cli.demo import demo
from armguard.cli.fleet import fleet
from armguard.cli.init import init
from armguard.cli.keys import keys
from armguard.cli.map import map_plans
from armguard.cli.replay import replay
from armguard.cli.report import report
from armguard.cli.reserve import reserve
from armguard.cli.reset import reset
from armguard.cli.run import run
from armguard.cli.sensing import sensing
from armguard.cli.serve import serve
from armguard.cli.verify import verify
from armguard.cli.view import view

app = typer.Typer(
    name="armguard",
    help="Real-time collision guard for robot arms. Exit codes: 0 clear, "
    "1 a pair came too close, 2 bad input.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    demo,
    init,
    check,
    run,
    verify,
    serve,
    keys,
    reset,
    view,
    replay,
    report,
    batch,
    coordinate,
    reserve,
    chaos,
):
    app.command()(command)
app.command(name="map")(map_plans)

app.add_typer(sensing, name="sense")
app.add_typer(fleet, name="fleet")


@app.callback(invoke_without_command=True)
def armguard(
    version: bool = typer.Option(False, "--version", help="Print the version."),
) -> None:
    """Real-time collision guard for robot arms."""
    if version:
        from armguard import __version__

        typer.echo(__version__)
        raise typer.Exit
