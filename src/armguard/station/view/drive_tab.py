"""The tab to drive by: command, sliders, handles, keys, stops and grippers."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from armguard.scene.settings import CHOICES
from armguard.station.frames import Frame
from armguard.station.view.drawing.handles import Handles
from armguard.station.view.driving.commander import Commander
from armguard.station.view.driving.driver import Driver, Hands
from armguard.station.view.driving.jog import KEYS_SENTENCE, PAD_SENTENCE
from armguard.station.view.scene_port import page_of
from armguard.station.view.world import World
from armguard.station.wire.keys import Role

# Sliders follow their joints this often [s], but not within this time of being moved.
FOLLOW, TOUCHED = 0.2, 0.6

# A slider ends so far inside of its joint's limits, so that the arm does [rad or m].
INSIDE = 0.005

# Modes that predict stops; a service needs one of them.
MODES = ("path", "speed")


class DriveTab:
    """What is in the tab.

    Args:
        server: The page.
        world: What is driven.
        driver: Who drives.
        commander: Who has the command.
        tele: Makes somebody who drives in the operator's place.
        keyboard: Called with whether keys and gamepads drive.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        world: World,
        driver: Driver,
        commander: Commander,
        tele: Callable[[], Hands],
        keyboard: Callable[[bool], None],
    ) -> None:
        self._world, self._driver, self._commander = world, driver, commander
        self._make_tele, self._keyboard = tele, keyboard
        self.handles = Handles(server, world.tables, driver)
        self._sliders: list[Any] = []
        self._touched = np.full(len(world.tables.q_names), -np.inf)
        self._followed = -np.inf
        self._add_command(server)
        self._add_ways(server)
        self._add_stops(server)
        self._add_grippers(server)
        self._add_joints(server)
        if commander.role >= Role.ADMINISTER:
            self._add_settings(server)

    def show(self, frame: Frame, now: float) -> None:
        """Let handles, sliders and words follow."""
        self.handles.move(frame)
        if now - self._followed < FOLLOW:
            return
        self._followed = now
        for k, slider in enumerate(self._sliders):
            # A slider that leads its joint shows where to.
            if self._driver.leads(k) or now - self._touched[k] < TOUCHED:
                continue
            shown = min(max(round(float(frame.q[k]), 3), slider.min), slider.max)
            if slider.value != shown:
                slider.value = shown
        has = self._commander.commands
        if self._take.disabled != has:
            self._take.disabled, self._give.disabled = has, not has
        if self._tele.value and self._driver.tele is None:
            self._tele.value = False
        robot = self._world.tables.robots[self._driver.chosen].name
        if self._robot.value != robot:
            self._robot.value = robot

    def let_go(self) -> None:
        """Who held something is gone."""
        self._driver.let_go()

    def _add_command(self, server: viser.ViserServer) -> None:
        gui = server.gui
        self._take = gui.add_button("Take the command", icon=viser.Icon.HAND_GRAB)
        self._give = gui.add_button("Give it back", disabled=True)

        @self._take.on_click
        def _(event: viser.GuiEvent) -> None:
            if self._commander.claim():
                return
            if self._commander.role >= Role.ADMINISTER:
                force(event)
            else:
                # It is refused, with the sentence that says why.
                self._commander.claim(force=True)

        @self._give.on_click
        def _(_: viser.GuiEvent) -> None:
            self._driver.let_go()
            self._commander.give_back()

        def force(event: viser.GuiEvent) -> None:
            if event.client is None:
                return
            with event.client.gui.add_modal("Somebody else has the command") as modal:
                event.client.gui.add_markdown(
                    "Take it from them? What they ask for is not heard any more."
                )
                yes = event.client.gui.add_button("Take it", color="orange")
                no = event.client.gui.add_button("Leave it")

            @yes.on_click
            def _(_: viser.GuiEvent) -> None:
                modal.close()
                self._commander.claim(force=True)

            @no.on_click
            def _(_: viser.GuiEvent) -> None:
                modal.close()

    def _add_ways(self, server: viser.ViserServer) -> None:
        gui, driver = server.gui, self._driver
        self._tele = tele = gui.add_checkbox("Tele-driver", False)
        handles = gui.add_checkbox("Handles at tools", False)
        keys = gui.add_checkbox("Keys and gamepad", False)
        share = gui.add_slider("Speed [%]", 5, 100, 5, round(100 * driver.share))
        names = tuple(part.name for part in self._world.tables.robots)
        self._robot = gui.add_dropdown("Keys lead", names)
        words = gui.add_markdown(f"{KEYS_SENTENCE}\n\n{PAD_SENTENCE}", visible=False)

        @tele.on_update
        def _(_: viser.GuiEvent) -> None:
            driver.tele = self._make_tele() if tele.value else None

        @handles.on_update
        def _(_: viser.GuiEvent) -> None:
            self.handles.show(handles.value)

        @keys.on_update
        def _(_: viser.GuiEvent) -> None:
            words.visible = keys.value
            self._keyboard(keys.value)

        @share.on_update
        def _(_: viser.GuiEvent) -> None:
            driver.share = share.value / 100.0

        @self._robot.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None and self._robot.value in names:
                driver.chosen = names.index(self._robot.value)

    def _add_stops(self, server: viser.ViserServer) -> None:
        engage = server.gui.add_button("Engage all", icon=viser.Icon.PLAYER_PLAY)
        reset = server.gui.add_button("Reset after a brake", color="gray")

        @engage.on_click
        def _(_: viser.GuiEvent) -> None:
            self._commander.engage()

        @reset.on_click
        def _(_: viser.GuiEvent) -> None:
            self._driver.let_go()
            self._commander.call("reset")

    def _add_grippers(self, server: viser.ViserServer) -> None:
        holds = self._world.tables.holds
        if not holds.grippers or not holds.objects:
            return
        gui = server.gui
        with gui.add_folder("Grippers"):
            who = gui.add_dropdown("Robot", tuple(g.name for g in holds.grippers))
            what = gui.add_dropdown("Object", tuple(holds.objects))
            grasp = gui.add_button("Grasp")
            release = gui.add_button("Release")

        @grasp.on_click
        def _(_: viser.GuiEvent) -> None:
            self._commander.call("grasp", robot=who.value, name=what.value)

        @release.on_click
        def _(_: viser.GuiEvent) -> None:
            self._commander.call("release", robot=who.value, name=what.value)

    def _add_joints(self, server: viser.ViserServer) -> None:
        tables = self._world.tables
        for part in tables.robots:
            with server.gui.add_folder(
                f"Joints of {part.name}", expand_by_default=False
            ):
                for k, joint in enumerate(part.joints):
                    self._add_slider(server, part.first_joint + k, joint)

    def _add_slider(self, server: viser.ViserServer, place: int, joint: str) -> None:
        tables = self._world.tables
        low, high = float(tables.lower[place]), float(tables.upper[place])
        # What turns without end is led within one turn.
        low, high = max(low, -np.pi) + INSIDE, min(high, np.pi) - INSIDE
        slider = server.gui.add_slider(
            joint,
            min=round(low, 3),
            max=round(high, 3),
            step=0.001,
            initial_value=float(np.clip(round(tables.home[place], 3), low, high)),
        )
        self._sliders.append(slider)

        @slider.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is None:
                return
            self._touched[place] = time.monotonic()
            page = page_of(server, event.client_id)
            self._driver.lead_joint(place, float(slider.value), page)

    def _add_settings(self, server: viser.ViserServer) -> None:
        gui, first = server.gui, self._world.tables.robots[0]
        with gui.add_folder("Response and buffer", expand_by_default=False):
            response = gui.add_dropdown(
                "Response", CHOICES["kind"], initial_value=first.response.kind
            )
            mode = gui.add_dropdown("Mode", MODES, initial_value=first.mode)
            apply = gui.add_button("Set, while all rest")

        @apply.on_click
        def _(_: viser.GuiEvent) -> None:
            self._driver.let_go()
            self._commander.call("configure", response=response.value, mode=mode.value)
