"""The exporter as a process: `python -m armguard.bridges.prometheus`."""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from wsgiref.simple_server import WSGIServer
from wsgiref.types import StartResponse, WSGIEnvironment

from prometheus_client import CollectorRegistry, make_wsgi_app, start_http_server

from armguard.bridges.prometheus.metrics import registry_of
from armguard.entry import run_program
from armguard.errors import ArmguardError, StationError
from armguard.processes import interrupted, wait_for
from armguard.recording.counters import CountersReader, counters_path
from armguard.recording.ring import RingReader
from armguard.recording.rings import lives

LOOPBACK = "127.0.0.1"

# Time between two looks at whether the service is still there [s].
LOOK = 0.5


class ExporterError(StationError, RuntimeError):
    """The exporter cannot start."""


def main() -> int:
    """Serve metrics until the service ends, or a signal comes."""
    parser = argparse.ArgumentParser("armguard.bridges.prometheus", description=__doc__)
    parser.add_argument("--ring", type=Path, required=True, help="the service's ring")
    parser.add_argument("--counters", type=Path, help="its counters; beside the ring")
    parser.add_argument("--port", type=int, required=True, help="to serve on, loopback")
    parser.add_argument("--wait", type=float, default=10.0, help="for the service [s]")
    options = parser.parse_args()
    path = options.counters or counters_path(options.ring)
    try:
        with interrupted() as ended:
            ring, counters = wait_for(
                lambda: (RingReader(options.ring), CountersReader(path)),
                options.wait,
                ended,
            )
            process = counters.process
            page = start_page(registry_of(counters, ring, process), options.port)
            print(f"metrics at http://127.0.0.1:{page.server_port}/metrics", flush=True)
            while not (ended.wait(LOOK) or ring.closed) and lives(process):
                pass
            page.shutdown()
    except ArmguardError as error:
        print(f"exporter: {error}", file=sys.stderr)
        return 2
    return 0


def start_page(registry: CollectorRegistry, port: int) -> WSGIServer:
    """Serve metrics at http://127.0.0.1:PORT/metrics until the server is shut down.

    Only requests for this machine by a name of its own get an answer: a page of the web
    whose name leads here requests that name. Port 0 is any that is free.

    Raises:
        ExporterError: The port is taken.
    """
    try:
        # Its page is empty until the one that looks at names takes its place.
        server, _ = start_http_server(port, LOOPBACK, CollectorRegistry())
    except OSError as error:
        raise ExporterError(
            f"cannot serve metrics on {LOOPBACK}:{port}: {error.strerror}; choose "
            "another port"
        ) from error
    metrics = make_wsgi_app(registry)
    own = [f"{name}:{server.server_port}" for name in (LOOPBACK, "localhost")]

    def answer(request: WSGIEnvironment, respond: StartResponse) -> Iterable[bytes]:
        if request.get("HTTP_HOST") not in own:
            respond("421 Misdirected Request", [("Content-Type", "text/plain")])
            return [f"use {own[0]}\n".encode()]
        page: Iterable[bytes] = metrics(request, respond)
        return page

    server.set_app(answer)
    return server


if __name__ == "__main__":
    run_program(main, "exporter:")
