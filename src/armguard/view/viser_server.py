"""Viser's server, behind our login, with all messages but those of our page dropped.

Only the five messages that our page sends pass, each with the fields and types that
viser declares. Viser itself would act on any attribute a message names.
"""

import contextlib
import io
import logging
import math
import time
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import msgspec
import viser
import viser._messages as messages
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from armguard.errors import StationError
from armguard.view.login import Login, abort, page_name

log = logging.getLogger("armguard.view")
quiet = logging.getLogger("armguard.view.scene")
quiet.setLevel(logging.CRITICAL)

# Longest message a page may send to viser [bytes].
LONGEST = 1 << 16

MESSAGES: dict[str, type[Any]] = {
    kind.__name__: kind
    for kind in (
        messages.ViewerCameraMessage,
        messages.GuiUpdateMessage,
        messages.TransformControlsDragStartMessage,
        messages.TransformControlsUpdateMessage,
        messages.TransformControlsDragEndMessage,
    )
}

# Time between two lines about messages that were dropped [s].
PAUSE = 1.0

# Least length of a quaternion that is a rotation [-].
TURN = 1e-6

Value = bool | Annotated[float, msgspec.Meta(gt=-1e300, lt=1e300)] | str


class Update(msgspec.Struct, forbid_unknown_fields=True):
    """Update of a control, as our page sends it: its value and nothing else."""

    value: Value | list[Value]


def open_viser(login: Login) -> viser.ViserServer:
    """Start viser at a separate port that answers nothing but sockets of our page.

    Args:
        login: Says whose sockets open.

    Raises:
        StationError: This viser opens its port in a way that cannot be guarded.
    """
    # Viser prints a box with its address, which is not the one to open.
    drops = DropLog()
    with guarded(login, drops) as opened, contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    if not opened:
        server.stop()
        raise StationError(
            f"viser {viser.__version__} opens its port in a way that the view does not "
            "know and cannot guard; install the version in requirements/core.txt"
        )
    # They would open a tunnel to the outside.
    for kind in (messages.ShareUrlRequest, messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(kind)
    # What a message of the page brings about in viser is one line, not its stack.
    server._event_loop.set_exception_handler(
        lambda loop, context: drops.add(str(context.get("exception", "no reason")))
    )
    return server


@contextlib.contextmanager
def guarded(login: Login, drops: "DropLog") -> Iterator[list[str]]:
    """While in here, a server that viser starts is one that the login guards.

    Yields:
        The address of each server that was started.
    """
    module, opened = websockets.asyncio.server, list[str]()
    serve = module.serve

    def guard(connection: ServerConnection, request: Request) -> Response | None:
        port = connection.local_address[1]
        return None if login.opens_socket(request, port) else abort(connection)

    def serve_guarded(handler: Any, host: str, port: int, **options: Any) -> Any:
        opened.append(host)
        own = {
            "process_request": guard,
            "max_size": LONGEST,
            "server_header": None,
            "logger": quiet,
        }
        return serve(
            lambda connection: handler(FilteredConnection(connection, drops)),
            *(host, port),
            **{**options, **own},
        )

    module.serve = serve_guarded  # type: ignore[assignment,misc]
    try:
        yield opened
    finally:
        module.serve = serve  # type: ignore[misc]


def page_of(server: viser.ViserServer, client: int | None) -> str:
    """The name of the page that a client of viser's is in; empty if it has none.

    Args:
        server: Viser's server.
        client: Viser's number of the client.
    """
    live = server._websock_server._live_connections.get(client)
    return "" if live is None or live.request is None else page_name(live.request.path)


class DropLog:
    """Logs that messages were dropped, a line a second at most."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._count, self._logged = 0, -math.inf

    def add(self, why: str) -> None:
        """Count a message that was dropped."""
        self._count += 1
        if self._clock() - self._logged >= PAUSE:
            log.warning("dropped %d messages of pages: %s", self._count, why)
            self._count, self._logged = 0, self._clock()


class FilteredConnection:
    """A connection of viser's that receives nothing but messages of our page.

    Args:
        connection: The connection.
        drops: Where messages are counted that were dropped.
    """

    def __init__(self, connection: ServerConnection, drops: DropLog) -> None:
        self._connection, self._drops = connection, drops

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        """The next message that our page may send."""
        while True:
            message = await self._connection.recv()
            why = fault_of(message)
            if not why and isinstance(message, bytes):
                return message
            self._drops.add(why)


def fault_of(message: bytes | str) -> str:
    """Why a message is none that our page sends; empty if it is one."""
    if isinstance(message, str):
        return "a text where viser's messages are binary"
    try:
        fields = msgspec.msgpack.decode(message, type=dict[str, Any])
        kind = str(fields.pop("type", ""))
        if kind not in MESSAGES:
            return f"'{kind[:40]}' is no message of the page"
        read = msgspec.convert(fields, MESSAGES[kind])
        if isinstance(read, messages.GuiUpdateMessage):
            msgspec.convert(read.updates, Update)
            return ""
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return str(error)[:200]
    for name, value in vars(read).items():
        parts = value if isinstance(value, tuple) else (value,)
        if not all(math.isfinite(part) for part in parts if isinstance(part, float)):
            return f"'{name}' of a {kind} is not finite"
    if math.hypot(*getattr(read, "wxyz", (1.0,))) < TURN:
        return f"'wxyz' of a {kind} is no rotation"
    return ""
