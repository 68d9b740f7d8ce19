"""`armguard reset`: the operator lifts the stop of a reflex."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument

from armguard.cli.console import CLEAR, out

# Exit code if the reflex still stops the arms.
STILL_STOPPED = 1


def reset(
    file: Annotated[
        Path, Argument(help="File of the reflex, with the operator's key.")
    ] = Path("reflex.json"),
) -> None:
    """Lift the stop of a reflex; then the commander engages the robots.

    The reflex refuses as long as a zone is too near or a sensor is at fault. Exit code
    0 if it stops the arms no longer, 1 if it still does.
    """
    from armguard.service.wire.pulses import reset as reset_reflex

    why = reset_reflex(file)
    out.print(why or "the reflex stops no arm; engage the robots", markup=False)
    raise typer.Exit(STILL_STOPPED if why else CLEAR)
