"""The page and its own channel, at one port of this machine.

The page is viser's with a script and a style of ours beside it. The channel is a
websocket of its own beside viser's, so that a level reaches light and sound at once,
whatever the drawing has to send; keys, gamepads and pulses come back on it. The door
says which requests are answered.
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

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from armguard.station.errors import StationError
from armguard.station.view.door import (
    Door,
    from_within,
    hang_up,
    navigates,
    page_name,
)
from armguard.station.view.sieve import Drops

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

Heard = Callable[[str, Mapping[str, Any]], None]


class PageServer:
    """Serves the page on loopback, and talks with those that have it open.

    Attributes:
        port: The port it is at.

    Args:
        port: The port wanted; 0 for any that is free.
        scene_port: Where viser's own websocket is.
        door: Says which requests are answered; learns the page's port.
        heard: Called with the name of a page and each message of it, from the server's
            thread; with a message of the type "gone" when it was closed.

    Raises:
        StationError: The port is taken.
    """

    def __init__(self, port: int, scene_port: int, door: Door, heard: Heard) -> None:
        self._scene_port, self._door, self._heard = scene_port, door, heard
        self._drops = Drops()
        self._open: set[ServerConnection] = set()
        self._last: dict[str, str] = {}
        self._loop = asyncio.new_event_loop()
        self._server: Server | None = None
        self._files = {
            "/": ("text/html", self._index().encode()),
            **{
                f"/{path.name}": (TYPES[path.suffix], path.read_bytes())
                for path in HERE.iterdir()
                if path.suffix in TYPES
            },
        }
        self.port = port
        started: Future[None] = Future()
        self._thread = threading.Thread(
            target=self._run, args=(port, started), name="page", daemon=True
        )
        self._thread.start()
        try:
            started.result()
        except OSError as error:
            raise StationError(
                f"the page cannot be at port {port}: {error.strerror}; give another "
                "with --page-port, or 0 for any that is free"
            ) from error

    @property
    def pages(self) -> int:
        """How many have the page open."""
        return len(self._open)

    def tell(self, kind: str, message: Mapping[str, Any], keep: bool = False) -> None:
        """Send all pages a message; one that cannot keep up is left out.

        Args:
            kind: Its type, by which the page knows what to do.
            message: What else is in it, ready for JSON.
            keep: Whether those who come later are to get the last of its type.
        """
        text = json.dumps({"type": kind, **message}, allow_nan=False)
        if keep:
            self._last[kind] = text
        if self._open:
            self._loop.call_soon_threadsafe(self._send, text)

    def close(self) -> None:
        """Let go of the port and of everybody."""
        if self._server is not None:
            self._loop.call_soon_threadsafe(self._server.close)
        self._thread.join(timeout=3.0)

    def _send(self, text: str) -> None:
        for connection in tuple(self._open):
            if connection.transport.get_write_buffer_size() < BACKLOG:
                task = self._loop.create_task(self._push(connection, text))
                task.add_done_callback(lambda done: done.exception())

    async def _push(self, connection: ServerConnection, text: str) -> None:
        try:
            await connection.send(text)
        except ConnectionClosed:
            self._open.discard(connection)

    def _run(self, port: int, started: "Future[None]") -> None:
        asyncio.set_event_loop(self._loop)

        async def work() -> None:
            quiet = logging.getLogger("armguard.view.page")
            quiet.setLevel(logging.CRITICAL)
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
            self._door.port = self.port
            started.set_result(None)
            await self._server.wait_closed()

        self._loop.run_until_complete(work())
        self._loop.close()

    def _answer(
        self, connection: ServerConnection, request: Request
    ) -> Response | None:
        """A file of the page, or None for the channel."""
        door, path = self._door, request.path.partition("?")[0]
        if "Upgrade" in request.headers:
            opens = path == CHANNEL and door.opens_socket(request, self.port)
            return None if opens else hang_up(connection)
        if not door.ours(request, self.port):
            return hang_up(connection)
        cookie = door.let_in(request) if navigates(request) and path == "/" else ""
        if not (cookie or door.knows(request)):
            if not navigates(request):
                return hang_up(connection)
            return self._reply(http.HTTPStatus.FORBIDDEN, body=STRANGER.encode())
        if not (navigates(request) or from_within(request)):
            return hang_up(connection)
        if path not in self._files:
            return self._reply(http.HTTPStatus.NOT_FOUND)
        return self._reply(http.HTTPStatus.OK, *self._files[path], cookie=cookie)

    async def _talk(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        page = page_name(connection.request.path)
        self._open.add(connection)
        try:
            for text in tuple(self._last.values()):
                await connection.send(text)
            async for message in connection:
                self._hear(page, message)
        except ConnectionClosed:
            pass
        finally:
            self._open.discard(connection)
            self._heard(page, {"type": "gone"})

    def _hear(self, page: str, message: str | bytes) -> None:
        """Hand on what a page says; what cannot be understood is dropped."""
        try:
            said = json.loads(message)
            if not isinstance(said, dict) or not isinstance(said.get("type"), str):
                raise ValueError("no object with a type")
            self._heard(page, said)
        except Exception as error:  # whatever a page says, its channel goes on
            self._drops.add(str(error)[:200])

    def _index(self) -> str:
        """Viser's page, told where its websocket is, with ours beside it."""
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
        """An answer that is to be asked for anew each time, and by nobody else."""
        ports = (self.port, self._scene_port)
        sockets = [f"ws://{name}" for port in ports for name in self._door.names(port)]
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
