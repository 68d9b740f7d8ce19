"""The tab to drive by: command, sliders, handles, keys, stops and grippers."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from armguard.recording.rights import Role
from armguard.scene.settings import CHOICES
from armguard.view.commander import Commander
from armguard.view.controls import ask, on_click, on_page, on_value
from armguard.view.drawables import Drawable, pose_of, put
from armguard.view.driver import Driver, TeleOperator
from armguard.view.jog import KEYS_SENTENCE, PAD_SENTENCE
from armguard.view.viser_server import page_of
from armguard.view.world import Cycle, World, tool_pose

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

    def _draw(self, cycle: Cycle) -> None:
        for part in self.tables.robots:
            if part.name not in self.nodes:
                self._add(part.name)
            node = self.nodes[part.name]
            T = tool_pose(self.tables, part, cycle.frame.poses)
            off = np.abs(pose_of(node) - T).max()
            if off > ASIDE and not self._driver.leads_tool(part.name):
                put(node, T)

    def _hide(self) -> None:
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
    _ran = False

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

    def _draw(self, cycle: Cycle) -> None:
        for k, slider in enumerate(self._sliders):
            # A slider that leads its joint shows its target.
            touched = time.monotonic() - self._touched[k] < TOUCHED
            if not touched and not self._driver.leads(k):
                q = round(float(cycle.frame.q[k]), 3)
                slider.value = min(max(q, slider.min), slider.max)
        commands = self._commander.commands
        self._take.disabled, self._give.disabled = commands, not commands
        ran, self._ran = self._ran, self._driver.tele is not None
        if ran and not self._ran:
            self._tele.value = False
        self._robot.value = self.tables.robots[self._driver.chosen].name

    def _add_command(self) -> None:
        gui, commander = self.gui, self._commander
        self._take = gui.add_button("Take the command", icon=viser.Icon.HAND_GRAB)
        self._take.on_click(self._claim)
        self._give = gui.add_button("Give it back", disabled=True)
        on_click(self._give, lambda: self._at_rest(commander.give_back))

    def begin(self) -> None:
        """Take the command, also from another client, and drive by handles and keys."""
        if self._commander.commands or self._commander.claim(force=True):
            self._commander.call("engage")
            self._handles.value = self._keys.value = True

    def _claim(self, event: viser.GuiEvent) -> None:
        """Take the command; ask whether to take it from its holder."""
        commander = self._commander
        question = "Take over? Its commands will be ignored."
        if commander.claim():
            return
        if commander.role < Role.ADMINISTER:
            # It is refused, with the sentence that says why.
            commander.claim(force=True)
            return
        ask(
            event,
            "Another client has the command",
            lambda gui: gui.add_markdown(question),
            ("Take it", "orange"),
            "Leave it",
            lambda _: commander.claim(force=True),
        )

    def _at_rest(self, does: Callable[[], object]) -> None:
        """Do something after all inputs have ended."""
        self._driver.release()
        does()

    def _add_inputs(self) -> None:
        gui, driver = self.gui, self._driver
        names = tuple(part.name for part in self.tables.robots)

        def drive_by_program(on: bool) -> None:
            driver.tele = self._make_tele() if on else None

        def drive_by_keys(on: bool) -> None:
            words.visible = on
            self._keyboard(on)

        def limit(percent: float) -> None:
            driver.share = percent / 100.0

        def choose(_: viser.GuiEvent) -> None:
            if self._robot.value in names:
                driver.chosen = names.index(self._robot.value)

        self._tele = on_value(gui.add_checkbox("Tele-driver", False), drive_by_program)
        handles = gui.add_checkbox("Handles at tools", False)
        keys = gui.add_checkbox("Keys and gamepad", False)
        self._handles = on_value(handles, self.handles.show)
        self._keys = on_value(keys, drive_by_keys)
        share = round(100 * driver.share)
        on_value(gui.add_slider("Speed [%]", 5, 100, 5, share), limit)
        self._robot = on_page(gui.add_dropdown("Keys lead", names), choose)
        words = gui.add_markdown(f"{KEYS_SENTENCE}\n\n{PAD_SENTENCE}", visible=False)

    def _add_stops(self) -> None:
        gui, commander = self.gui, self._commander
        engage = gui.add_button("Engage all", icon=viser.Icon.PLAYER_PLAY)
        on_click(engage, commander.engage)
        reset = gui.add_button("Reset after a brake", color="gray")
        on_click(reset, lambda: self._at_rest(lambda: commander.call("reset")))

    def _add_grippers(self) -> None:
        holds, gui = self.tables.holds, self.gui
        if not holds.grippers or not holds.objects:
            return

        def call(what: str) -> None:
            self._commander.call(what, robot=robot.value, name=item.value)

        with gui.add_folder("Grippers"):
            robot = gui.add_dropdown("Robot", tuple(g.name for g in holds.grippers))
            item = gui.add_dropdown("Object", tuple(holds.objects))
            on_click(gui.add_button("Grasp"), lambda: call("grasp"))
            on_click(gui.add_button("Release"), lambda: call("release"))

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

        def lead(event: viser.GuiEvent) -> None:
            self._touched[place] = time.monotonic()
            page = page_of(self.world.server, event.client_id)
            self._driver.lead_joint(place, float(slider.value), page)

        on_page(slider, lead)

    def _add_settings(self) -> None:
        gui, first = self.gui, self.tables.robots[0]
        kinds, kind = CHOICES["kind"], first.response.kind

        def configure() -> None:
            settings = {"response": response.value, "mode": mode.value}
            self._commander.call("configure", **settings)

        with gui.add_folder("Response and buffer", expand_by_default=False):
            response = gui.add_dropdown("Response", kinds, initial_value=kind)
            mode = gui.add_dropdown("Mode", MODES, initial_value=first.mode)
            apply = gui.add_button("Set, while all rest")
            on_click(apply, lambda: self._at_rest(configure))
