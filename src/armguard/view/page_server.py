"""The page and its own channel, at one port of this machine.

The page is viser's with a script and a style of ours beside it. The channel is a
separate websocket beside viser's, so that a level reaches light and sound at once,
whatever the drawing has to send; keys, gamepads and heartbeats come back on it.
"""

import asyncio
import http
import json
import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from armguard.errors import StationError
from armguard.view.login import Login, abort, from_within, navigates, page_name
from armguard.view.viser_server import DropLog

HERE = Path(__file__).parent / "page"
CHANNEL = "/station"

# A page that has this much still to fetch gets the next message instead [bytes].
BACKLOG = 1 << 16

# Longest message a page may send [bytes].
LONGEST = 1 << 14

TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}

# What the page may do: nothing leaves this machine, whatever a name or a file says.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "connect-src 'self' data: blob: {sockets}"
)

STRANGER = (
    "This browser was not let in: open the link that armguard printed last in its "
    "terminal (each link lets one browser in, and the next one is printed then).\n"
)

quiet = logging.getLogger("armguard.view.page")
quiet.setLevel(logging.CRITICAL)


class PageServer:
    """Serves the page on loopback, and exchanges messages with all that have it open.

    Attributes:
        port: The port it is at.
        newest: The newest message of each type, as JSON; pages that open get them.

    Args:
        port: The port wanted; 0 for any that is free.
        scene_port: Port of viser's own websocket.
        login: Says which requests are answered; gets the page's port.
        received: Called with the name of a page and each message of it, from the
            server's thread; with a message of the type "gone" when it was closed.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self,
        port: int,
        scene_port: int,
        login: Login,
        received: Callable[[str, Mapping[str, Any]], None],
    ) -> None:
        self._scene_port, self._login, self._received = scene_port, login, received
        self._drops = DropLog()
        self._open: set[ServerConnection] = set()
        self.newest: dict[str, str] = {}
        self._files = {
            "/": ("text/html", self._index().encode()),
            **{
                f"/{path.name}": (TYPES[path.suffix], path.read_bytes())
                for path in HERE.iterdir()
                if path.suffix in TYPES
            },
        }
        started: Future[None] = Future()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(port, started)),
            name="page",
            daemon=True,
        )
        self._thread.start()
        try:
            started.result()
        except OSError as error:
            raise StationError(
                f"the page cannot be at port {port}: {error.strerror}; give another "
                "with --page-port, or 0 for any that is free"
            ) from error

    def publish(
        self, kind: str, message: Mapping[str, Any], repeat: bool = False
    ) -> None:
        """Send all pages a message; one that cannot keep up is left out.

        Args:
            kind: Its type, by which the page knows what to do.
            message: Its other fields, ready for JSON.
            repeat: Whether to send it also if it is the same as the last of its type.
        """
        text = json.dumps({"type": kind, **message}, allow_nan=False)
        if text == self.newest.get(kind) and not repeat:
            return
        self.newest[kind] = text
        if self._open:
            self._loop.call_soon_threadsafe(self._send, text)

    def close(self) -> None:
        """Close the port and all connections."""
        self._loop.call_soon_threadsafe(self._server.close)
        self._thread.join(timeout=3.0)

    def _send(self, text: str) -> None:
        broadcast(
            [
                connection
                for connection in self._open
                if connection.transport.get_write_buffer_size() < BACKLOG
            ],
            text,
        )

    async def _serve(self, port: int, started: "Future[None]") -> None:
        self._loop = asyncio.get_running_loop()
        try:
            self._server = await serve(
                self._talk,
                "127.0.0.1",
                port,
                process_request=self._answer,
                max_size=LONGEST,
                compression=None,
                server_header=None,
                logger=quiet,
            )
        except OSError as error:
            started.set_exception(error)
            return
        self.port = next(iter(self._server.sockets)).getsockname()[1]
        self._login.port = self.port
        started.set_result(None)
        await self._server.wait_closed()

    def _answer(
        self, connection: ServerConnection, request: Request
    ) -> Response | None:
        """A file of the page, or None for the channel."""
        login, path = self._login, request.path.partition("?")[0]
        if "Upgrade" in request.headers:
            opens = path == CHANNEL and login.opens_socket(request, self.port)
            return None if opens else abort(connection)
        opened = navigates(request)
        if not login.addressed(request, self.port):
            return abort(connection)
        cookie = login.admit(request) if opened and path == "/" else ""
        known = cookie or login.knows(request)
        if not (opened or (known and from_within(request))):
            return abort(connection)
        if not known:
            return self._reply(http.HTTPStatus.FORBIDDEN, body=STRANGER.encode())
        if path not in self._files:
            return self._reply(http.HTTPStatus.NOT_FOUND)
        return self._reply(http.HTTPStatus.OK, *self._files[path], cookie=cookie)

    async def _talk(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        page = page_name(connection.request.path)
        self._open.add(connection)
        try:
            for text in tuple(self.newest.values()):
                await connection.send(text)
            async for message in connection:
                self._receive(page, message)
        except ConnectionClosed:
            pass
        finally:
            self._open.discard(connection)
            self._received(page, {"type": "gone"})

    def _receive(self, page: str, message: str | bytes) -> None:
        """Hand on a page's message; one that cannot be understood is dropped."""
        try:
            fields = json.loads(message)
            if not isinstance(fields, dict) or not isinstance(fields.get("type"), str):
                raise ValueError("no object with a type")
            self._received(page, fields)
        except Exception as error:  # whatever a page says, its channel goes on
            self._drops.add(str(error)[:200])

    def _index(self) -> str:
        """Viser's page, with the address of its websocket, and ours beside it."""
        import viser

        folder = Path(viser.__file__).parent / "client" / "build"
        page = (folder / "index.html").read_text(encoding="utf-8")
        ours = (
            "<title>armguard</title>\n"
            "<script>{const asked = new URLSearchParams(location.search);"
            # The link is used up, and of no use in the browser's history.
            "asked.delete('token');"
            "window.stationPage = crypto.randomUUID();"
            "asked.set('websocket', 'ws://' + location.hostname + "
            f"':{self._scene_port}/?page=' + stationPage);"
            "history.replaceState(null, '', '?' + asked)}</script>\n"
            '<link rel="stylesheet" href="/station.css">\n'
            '<script src="/pace.js"></script>\n'
            '<script src="/timeline.js" defer></script>\n'
            '<script src="/line.js" defer></script>\n'
            '<script src="/charts.js" defer></script>\n'
            '<script src="/station.js" defer></script>\n'
        )
        page = page.replace("<title>Viser</title>", "")
        return page.replace(
            '<meta charset="utf-8" />', '<meta charset="utf-8" />' + ours
        )

    def _reply(
        self,
        status: http.HTTPStatus,
        kind: str = "text/plain",
        body: bytes = b"",
        cookie: str = "",
    ) -> Response:
        """An answer for this page alone, which no cache keeps."""
        ports = (self.port, self._scene_port)
        sockets = [f"ws://{name}" for port in ports for name in self._login.names(port)]
        headers = Headers(
            {
                "Content-Type": f"{kind}; charset=utf-8",
                "Content-Length": str(len(body)),
                "Cache-Control": "no-store",
                "Content-Security-Policy": POLICY.format(
                    sockets=" ".join(sorted(sockets))
                ),
                "Cross-Origin-Opener-Policy": "same-origin",
                "Cross-Origin-Resource-Policy": "same-origin",
                "Referrer-Policy": "no-referrer",
                "X-Content-Type-Options": "nosniff",
                "X-Frame-Options": "DENY",
            }
        )
        if cookie:
            headers["Set-Cookie"] = cookie
        return Response(status, status.phrase, headers, body)
