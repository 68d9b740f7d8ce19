"""The panel beside the scene: what is shown, and how the last seconds went."""

import viser

from armguard.station.view.judged import Judged
from armguard.station.view.plot import ClearancePlot
from armguard.station.view.world import World


class Panel:
    """Tabs of the panel.

    Args:
        server: The page.
        world: What is drawn.
    """

    def __init__(self, server: viser.ViserServer, world: World) -> None:
        self.world = world
        self.tabs = server.gui.add_tab_group()
        with self.tabs.add_tab("Watch", viser.Icon.EYE):
            self._plot = ClearancePlot(server, world.tables.margin)
            self._near = server.gui.add_markdown("")
            self._text = ""
            with server.gui.add_folder("Show"):
                primitives = server.gui.add_checkbox("checked primitives", False)
                shells = server.gui.add_checkbox("distance each pair needs", True)
                ghost = server.gui.add_checkbox("rest if stopped now", True)

        @primitives.on_update
        def _(_: viser.GuiEvent) -> None:
            self.world.bodies.show_primitives(primitives.value)

        @shells.on_update
        def _(_: viser.GuiEvent) -> None:
            self.world.near.shells_shown = shells.value

        @ghost.on_update
        def _(_: viser.GuiEvent) -> None:
            self.world.ghost.shown = ghost.value

    def show(self, cycle: Judged, now: float) -> None:
        """Show a cycle."""
        self._plot.add(cycle.verdict, now)
