"""The command line: `armguard demo`, `check`, `run`, `serve` and others."""

import os

from armguard.entry import run_program

__all__ = ["main"]


def main() -> None:
    """Run the command line; an error is one message and exit code 2."""
    run_program(command_line)


def command_line() -> None:
    """Run a command as typer does, with its exit code."""
    # Matrices here are small: threads of BLAS only take cores from fits and the loop.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Imported here: what fails while libraries are loaded is a message, too.
    from armguard.cli.app import app

    app()
