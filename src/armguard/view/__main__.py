"""`python -m armguard.view --service PORT`: the view beside a service."""

import argparse
import signal
from pathlib import Path
from threading import Event

from armguard.entry import run_program
from armguard.view.live_view import LiveView
from armguard.view.view import View


def main() -> None:
    """Show a service until the process is ended."""
    parser = argparse.ArgumentParser(prog="armguard.view")
    parser.add_argument("--service", type=int, default=47800)
    parser.add_argument("--page-port", type=int, default=8080)
    parser.add_argument("--key-file", type=Path, help="the service's keys")
    options = parser.parse_args()
    show(LiveView(options.service, options.page_port, keys=options.key_file))


def show(view: View) -> None:
    """Run a view until the process is asked to end."""
    end = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: end.set())
    view.login.used = lambda link: print(
        f"a browser was let in; for another one: {link}", flush=True
    )
    print(f"open the page in one browser: {view.login.link}", flush=True)
    try:
        view.run(end.is_set)
    finally:
        view.close()


if __name__ == "__main__":
    run_program(main, "view:")
