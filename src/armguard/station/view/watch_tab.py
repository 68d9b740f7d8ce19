"""The tab to watch by: how the last seconds went, who is near, what is drawn."""

import viser

from armguard.station.view.judged import Judged
from armguard.station.view.plot import ClearancePlot
from armguard.station.view.world import World

# The list of near pairs is written anew this often [s].
LIST = 0.25

# Near pairs in the list.
MOST = 6


class WatchTab:
    """What is in the tab.

    Args:
        server: The page.
        world: What is drawn.
    """

    def __init__(self, server: viser.ViserServer, world: World) -> None:
        self._world = world
        self._plot = ClearancePlot(server, world.tables.margin)
        self._near = server.gui.add_markdown("")
        self._text, self._listed = "", -float("inf")
        with server.gui.add_folder("Show"):
            primitives = server.gui.add_checkbox("Checked primitives", False)
            shells = server.gui.add_checkbox("Room each pair needs", True)
            ghost = server.gui.add_checkbox("Rest if stopped now", True)
            leaves = server.gui.add_checkbox("Octree leaves at the arms", False)

        @primitives.on_update
        def _(_: viser.GuiEvent) -> None:
            world.bodies.show_primitives(primitives.value)

        @shells.on_update
        def _(_: viser.GuiEvent) -> None:
            world.near.shells_shown = shells.value

        @ghost.on_update
        def _(_: viser.GuiEvent) -> None:
            world.ghost.shown = ghost.value

        @leaves.on_update
        def _(_: viser.GuiEvent) -> None:
            world.leaves.shown = leaves.value

    def show(self, cycle: Judged, now: float) -> None:
        """Show a cycle."""
        self._plot.add(cycle.verdict, now)
        if now - self._listed < LIST:
            return
        self._listed = now
        pairs = sorted(cycle.verdict.near, key=lambda pair: pair.clearance)
        lines = [
            f"| {inert(pair.a)} | {inert(pair.b)} | {pair.distance * 1e3:.0f} "
            f"| {pair.clearance * 1e3:.0f} |"
            for pair in pairs[:MOST]
        ]
        text = "\n".join(
            ["| near | to | mm | left |", "| --- | --- | --: | --: |", *lines]
        )
        if len(pairs) > MOST:
            text += f"\n\n… and {len(pairs) - MOST} more"
        if text != self._text:
            self._near.content = self._text = text


def inert(name: str) -> str:
    """A name in which no sign means anything in Markdown or HTML."""
    return "".join(sign if sign.isalnum() else f"&#{ord(sign)};" for sign in name)
