"""The page Prometheus asks for, on this machine's loopback."""

from collections.abc import Iterable
from wsgiref.simple_server import WSGIServer
from wsgiref.types import StartResponse, WSGIEnvironment

from prometheus_client import CollectorRegistry, make_wsgi_app, start_http_server

from armguard.station.errors import StationError

LOOPBACK = "127.0.0.1"


class ExporterError(StationError, RuntimeError):
    """The exporter cannot start."""


def start_page(registry: CollectorRegistry, port: int) -> WSGIServer:
    """Serve metrics at http://127.0.0.1:PORT/metrics until the server is shut down.

    Only who asks for this machine by a name of its own gets an answer: a page of the
    web that has its own name lead here asks for that name.

    Args:
        registry: The metrics.
        port: Port; 0 for any that is free.

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
            return [f"ask for {own[0]}\n".encode()]
        page: Iterable[bytes] = metrics(request, respond)
        return page

    server.set_app(answer)
    return server
