"""Viser's server, behind our door."""

import contextlib
import io
import logging
from collections.abc import Iterator
from typing import Any

import viser
import websockets.asyncio.server
from viser._messages import ShareUrlDisconnect, ShareUrlRequest
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from armguard.station.errors import StationError
from armguard.station.palette import BLUE
from armguard.station.view.door import Door, hang_up, page_name
from armguard.station.view.sieve import Drops, Sifted

# Longest message a page may send to viser [bytes].
LONGEST = 1 << 16

quiet = logging.getLogger("armguard.view.scene")
quiet.setLevel(logging.CRITICAL)


def open_scene_port(door: Door) -> viser.ViserServer:
    """Start viser at a port of its own that answers nothing but sockets of our page.

    Args:
        door: Says whose sockets open.

    Raises:
        StationError: This viser cannot be put behind a door.
    """
    # Viser prints a box with its address, which is not the one to open.
    drops = Drops()
    with behind(door, drops) as held, contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    if not held:
        server.stop()
        raise StationError(
            f"viser {viser.__version__} opens its port in a way that the view does not "
            "know and cannot guard; install the version in requirements/core.txt"
        )
    messages = server._websock_server
    # They would open a tunnel to the outside.
    messages.unregister_handler(ShareUrlRequest)
    messages.unregister_handler(ShareUrlDisconnect)
    # What a message of the page brings about in viser is one line, not its stack.
    server._event_loop.set_exception_handler(
        lambda loop, context: drops.add(str(context.get("exception", "no reason")))
    )
    return server


@contextlib.contextmanager
def behind(door: Door, drops: Drops) -> Iterator[list[str]]:
    """While in here, a server that viser starts is one that the door guards.

    Yields:
        The address of each server that was started.
    """
    module, held = websockets.asyncio.server, list[str]()
    serve = module.serve

    def guard(connection: ServerConnection, request: Request) -> Response | None:
        port = connection.local_address[1]
        return None if door.opens_socket(request, port) else hang_up(connection)

    def guarded(handler: Any, host: str, port: int, **options: Any) -> Any:
        async def sifted(connection: ServerConnection) -> None:
            await handler(Sifted(connection, drops))

        held.append(host)
        own = {
            "process_request": guard,
            "max_size": LONGEST,
            "server_header": None,
            "logger": quiet,
        }
        return serve(sifted, host, port, **{**options, **own})

    module.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield held
    finally:
        module.serve = serve  # type: ignore[misc]


def page_of(server: viser.ViserServer, client: int) -> str:
    """The name of the page that a client of viser's is in; empty if it has none.

    Args:
        server: Viser's server.
        client: Viser's number of the client.
    """
    live = server._websock_server._live_connections.get(client)
    return "" if live is None or live.request is None else page_name(live.request.path)


def dress(server: viser.ViserServer) -> None:
    """Empty the panel, and give it its place and its colours."""
    server.gui.reset()
    server.gui.configure_theme(
        show_share_button=False, show_logo=False, brand_color=BLUE
    )
    server.gui.main_panel.dock_right()
