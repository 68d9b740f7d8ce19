"""The tab to drive by: command, sliders, handles, keys, stops and grippers."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from armguard.scene.settings import CHOICES
from armguard.station.view.commander import Commander
from armguard.station.view.controls import ask, by_page
from armguard.station.view.cycles import Cycle
from armguard.station.view.drawables import Drawable, pose_of, put
from armguard.station.view.driver import Driver, TeleOperator
from armguard.station.view.jog import KEYS_SENTENCE, PAD_SENTENCE
from armguard.station.view.viser_server import page_of
from armguard.station.view.world import World, tool_pose
from armguard.station.wire.keys import Role

# Sliders follow their joints except for so long after they were moved [s].
TOUCHED = 0.6

# A slider ends so far inside of its joint's limits, so that the arm does [rad or m].
INSIDE = 0.005

# A handle that is not held is put back to its tool when it is this far off [m].
ASIDE = 2e-3

# Modes that predict stops; a service needs one of them.
MODES = ("path", "speed")


class ToolHandles(Drawable):
    """Handles at all tools, to drag them by; the guard's inverse kinematics follow."""

    shown = False

    def __init__(self, world: World, driver: Driver) -> None:
        super().__init__(world)
        self._driver = driver

    def draw(self, cycle: Cycle) -> None:
        """Keep the handles that are not held at their tools."""
        for part in self.tables.robots:
            if part.name not in self.nodes:
                self._add(part.name)
            node = self.nodes[part.name]
            T = tool_pose(self.tables, part, cycle.frame.poses)
            off = np.abs(pose_of(node) - T).max()
            if off > ASIDE and not self._driver.leads_tool(part.name):
                put(node, T)

    def hide(self) -> None:
        """Remove the handles."""
        while self.nodes:
            name, node = self.nodes.popitem()
            self._driver.lead_tool(name, None)
            node.remove()

    def _add(self, name: str) -> None:
        node = self.nodes[name] = self.api.add_transform_controls(
            f"/handles/{name}", scale=0.28, line_width=3.0, depth_test=False
        )

        @node.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            T = None if event.phase == "end" else pose_of(event.target)
            page = page_of(self.world.server, event.client_id)
            self._driver.lead_tool(name, T, page)


class DriveTab(Drawable):
    """The controls of the tab.

    Args:
        world: The scene that is driven.
        driver: Takes the inputs.
        commander: Has the command.
        tele: Makes a tele-driver.
        keyboard: Called with whether keys and gamepads drive.
    """

    every = 0.2

    def __init__(
        self,
        world: World,
        driver: Driver,
        commander: Commander,
        tele: Callable[[], TeleOperator],
        keyboard: Callable[[bool], None],
    ) -> None:
        super().__init__(world)
        self._driver, self._commander = driver, commander
        self._make_tele, self._keyboard = tele, keyboard
        self.handles = ToolHandles(world, driver)
        self._touched = np.full(len(self.tables.q_names), -np.inf)
        self._add_command()
        self._add_inputs()
        self._add_stops()
        self._add_grippers()
        self._sliders: list[Any] = []
        for part in self.tables.robots:
            folder = f"Joints of {part.name}"
            with self.gui.add_folder(folder, expand_by_default=False):
                for joint in part.joints:
                    self._add_slider(len(self._sliders), joint)
        if commander.role >= Role.ADMINISTER:
            self._add_settings()

    def draw(self, cycle: Cycle) -> None:
        """Let sliders and buttons follow."""
        for k, slider in enumerate(self._sliders):
            # A slider that leads its joint shows its target.
            touched = time.monotonic() - self._touched[k] < TOUCHED
            if not touched and not self._driver.leads(k):
                q = round(float(cycle.frame.q[k]), 3)
                slider.value = min(max(q, slider.min), slider.max)
        commands = self._commander.commands
        self._take.disabled, self._give.disabled = commands, not commands
        if self._driver.tele is None:
            self._tele.value = False
        self._robot.value = self.tables.robots[self._driver.chosen].name

    def _add_command(self) -> None:
        gui, commander = self.gui, self._commander
        self._take = gui.add_button("Take the command", icon=viser.Icon.HAND_GRAB)
        self._give = gui.add_button("Give it back", disabled=True)

        @self._take.on_click
        def _(event: viser.GuiEvent) -> None:
            if commander.claim():
                return
            if commander.role < Role.ADMINISTER:
                # It is refused, with the sentence that says why.
                commander.claim(force=True)
                return
            question = "Take it from them? What they ask for is not heard any more."
            ask(
                event,
                "Somebody else has the command",
                lambda gui: gui.add_markdown(question),
                ("Take it", "orange"),
                "Leave it",
                lambda _: commander.claim(force=True),
            )

        self._give.on_click(lambda _: self._at_rest(commander.give_back))

    def _at_rest(self, does: Callable[[], object]) -> None:
        """Do something after all inputs have ended."""
        self._driver.release()
        does()

    def _add_inputs(self) -> None:
        gui, driver = self.gui, self._driver
        tele = self._tele = gui.add_checkbox("Tele-driver", False)
        handles = gui.add_checkbox("Handles at tools", False)
        keys = gui.add_checkbox("Keys and gamepad", False)
        share = gui.add_slider("Speed [%]", 5, 100, 5, round(100 * driver.share))
        names = tuple(part.name for part in self.tables.robots)
        robot = self._robot = gui.add_dropdown("Keys lead", names)
        words = gui.add_markdown(f"{KEYS_SENTENCE}\n\n{PAD_SENTENCE}", visible=False)
        handles.on_update(lambda _: self.handles.show(handles.value))

        @tele.on_update
        def _(_: viser.GuiEvent) -> None:
            driver.tele = self._make_tele() if tele.value else None

        @keys.on_update
        def _(_: viser.GuiEvent) -> None:
            words.visible = keys.value
            self._keyboard(keys.value)

        @share.on_update
        def _(_: viser.GuiEvent) -> None:
            driver.share = share.value / 100.0

        @robot.on_update
        @by_page
        def _(_: viser.GuiEvent) -> None:
            if robot.value in names:
                driver.chosen = names.index(robot.value)

    def _add_stops(self) -> None:
        commander = self._commander
        engage = self.gui.add_button("Engage all", icon=viser.Icon.PLAYER_PLAY)
        reset = self.gui.add_button("Reset after a brake", color="gray")
        engage.on_click(lambda _: commander.engage())
        reset.on_click(lambda _: self._at_rest(lambda: commander.call("reset")))

    def _add_grippers(self) -> None:
        holds, gui = self.tables.holds, self.gui
        if not holds.grippers or not holds.objects:
            return
        with gui.add_folder("Grippers"):
            robot = gui.add_dropdown("Robot", tuple(g.name for g in holds.grippers))
            item = gui.add_dropdown("Object", tuple(holds.objects))
            buttons = gui.add_button("Grasp"), gui.add_button("Release")

        def add(button: Any, call: str) -> None:
            button.on_click(
                lambda _: self._commander.call(call, robot=robot.value, name=item.value)
            )

        add(buttons[0], "grasp")
        add(buttons[1], "release")

    def _add_slider(self, place: int, joint: str) -> None:
        tables = self.tables
        # A joint that turns without end is led within one turn.
        low = max(float(tables.lower[place]), -np.pi) + INSIDE
        high = min(float(tables.upper[place]), np.pi) - INSIDE
        slider = self.gui.add_slider(
            joint,
            min=round(low, 3),
            max=round(high, 3),
            step=0.001,
            initial_value=float(np.clip(round(tables.home[place], 3), low, high)),
        )
        self._sliders.append(slider)

        @slider.on_update
        @by_page
        def _(event: viser.GuiEvent) -> None:
            self._touched[place] = time.monotonic()
            page = page_of(self.world.server, event.client_id)
            self._driver.lead_joint(place, float(slider.value), page)

    def _add_settings(self) -> None:
        gui, first = self.gui, self.tables.robots[0]
        with gui.add_folder("Response and buffer", expand_by_default=False):
            kind = gui.add_dropdown(
                "Response", CHOICES["kind"], initial_value=first.response.kind
            )
            mode = gui.add_dropdown("Mode", MODES, initial_value=first.mode)
            apply = gui.add_button("Set, while all rest")

        @apply.on_click
        def _(_: viser.GuiEvent) -> None:
            settings = {"response": kind.value, "mode": mode.value}
            self._at_rest(lambda: self._commander.call("configure", **settings))
