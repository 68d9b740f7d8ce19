"""`armguard sense` and its subcommands."""

from typing import Any

import typer
from typer.core import TyperGroup

from armguard.cli.calibrate import calibrate
from armguard.cli.sense import sense


class PlayByDefault(TyperGroup):
    """A group whose first argument may be a scene: then the command is `play`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Arguments of the group, with the name of a command before all others."""
        named = args and (args[0] in self.commands or args[0] == "--help")
        found: list[str] = super().parse_args(ctx, args if named else ["play", *args])
        return found


sensing = typer.Typer(
    cls=PlayByDefault,
    help="Sensors fill the map: `armguard sense SCENE --play FILE` plays frames again, "
    "`armguard sense calibrate` finds the pose of a sensor.",
    no_args_is_help=False,
    rich_markup_mode=None,
    add_completion=False,
)
sensing.command("play")(sense)
sensing.command("calibrate")(calibrate)
