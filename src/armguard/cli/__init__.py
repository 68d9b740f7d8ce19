"""The command line: `armguard demo`, `check`, `run`, `serve` and others."""

from armguard.entry import run_program

__all__ = ["main"]


def main() -> None:
    """Run the command line; an error is one message and exit code 2."""
    run_program(command_line)


def command_line() -> None:
    """Run a command as typer does, with its exit code."""
    # Imported here: what fails while libraries are loaded is a message, too.
    from armguard.cli.app import app

    app()
