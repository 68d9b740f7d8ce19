"""Viser's server, kept to this machine and to our own page."""

import contextlib
import io
from collections.abc import Callable
from typing import Any

import viser

from armguard.station.palette import BLUE


def open_scene_port(origins: Callable[[], set[str]]) -> viser.ViserServer:
    """Start viser at a port of its own that nobody needs to know.

    Args:
        origins: Gives the origins of our own pages; any other page that finds the port
            is shut out, since what it asks for would move arms.
    """
    # Viser prints a box with its address, which is not the one to open.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    connection = server._websock_server

    @connection.on_client_connect
    async def _(page: Any) -> None:
        live = connection._live_connections[page.client_id]
        if live.request.headers.get("Origin") not in origins():
            await live.close(1008, "another page's origin")

    return server


def dress(server: viser.ViserServer) -> None:
    """Empty the panel, and give it its place and its colours."""
    server.gui.reset()
    server.gui.configure_theme(
        # The button would open a tunnel to the outside.
        show_share_button=False,
        show_logo=False,
        brand_color=BLUE,
    )
    server.gui.main_panel.dock_right()
