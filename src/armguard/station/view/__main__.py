"""`python -m armguard.station.view --service PORT`: the view beside a service."""

import argparse
import signal
import sys
from pathlib import Path
from threading import Event
from typing import Any

from armguard.entry import run_program
from armguard.station.view.live_view import LiveView


def main() -> None:
    """Show a service until told to end."""
    parser = argparse.ArgumentParser(prog="armguard.station.view")
    parser.add_argument("--service", type=int, default=47800)
    parser.add_argument("--page-port", type=int, default=8080)
    parser.add_argument("--key-file", type=Path, help="the service's keys")
    asked = parser.parse_args()
    show(LiveView(asked.service, asked.page_port, keys=asked.key_file))


def show(view: Any) -> None:
    """Run a view until the process is told to end."""
    end = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: end.set())
    door = view.view.door
    door.used = lambda link: say(f"a browser was let in; for another one: {link}")
    say(f"open the page in one browser: {door.link}")
    try:
        view.run(end.is_set)
    finally:
        view.close()


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    run_program(main, "view:")
