"""The page Prometheus asks for, on this machine's loopback."""

from types import TracebackType
from typing import Self

from prometheus_client import CollectorRegistry, start_http_server

from armguard.station.errors import StationError

LOOPBACK = "127.0.0.1"


class ExporterError(StationError, RuntimeError):
    """The exporter cannot start."""


class Page:
    """Serves metrics at http://127.0.0.1:PORT/metrics until it is closed.

    Attributes:
        port: Where.

    Args:
        registry: The metrics.
        port: Port; 0 for any that is free.

    Raises:
        ExporterError: The port is taken.
    """

    def __init__(self, registry: CollectorRegistry, port: int) -> None:
        try:
            self._server, self._thread = start_http_server(
                port, addr=LOOPBACK, registry=registry
            )
        except OSError as error:
            raise ExporterError(
                f"cannot serve metrics on {LOOPBACK}:{port}: {error.strerror}; choose "
                "another port"
            ) from error
        self.port = self._server.server_port

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
