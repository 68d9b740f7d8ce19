"""`python -m armguard.station.view --service PORT`: the view beside a service."""

import argparse
import signal
import sys
from threading import Event
from typing import Any

from armguard.station.view.live_view import LiveView


def main() -> None:
    """Show a service until told to end."""
    parser = argparse.ArgumentParser(prog="armguard.station.view")
    parser.add_argument("--service", type=int, default=47800)
    parser.add_argument("--page-port", type=int, default=8080)
    asked = parser.parse_args()
    show(LiveView(asked.service, asked.page_port))


def show(view: Any) -> None:
    """Run a view until the process is told to end."""
    end = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: end.set())
    sys.stdout.write(f"the page is at {view.address}\n")
    sys.stdout.flush()
    try:
        view.run(end.is_set)
    finally:
        view.close()


if __name__ == "__main__":
    main()
