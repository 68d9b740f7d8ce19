"""Controls of the panel do what they say, by messages of a page without a browser."""

import asyncio
import json
import time

import msgspec
import numpy as np
import pytest
from tests.view.conftest import greet, until

CAMERA = {
    "wxyz": [1, 0, 0, 0],
    "position": [1, 1, 1],
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}


class Page:
    """A page that lives: it sends heartbeats, and sets controls by their labels."""

    def __init__(self, view, channel, scene):
        self.view, self.channel, self.scene = view, channel, scene
        handles = view.server.gui._gui_input_handle_from_uuid
        self.names = {one._impl.props.label: name for name, one in handles.items()}

    async def send(self, kind, **fields):
        await self.scene.send(msgspec.msgpack.encode({"type": kind, **fields}))

    async def set(self, label, value=True):
        updates = {"value": value}
        await self.send("GuiUpdateMessage", uuid=self.names[label], updates=updates)

    async def until(self, what, seconds=30.0):
        """Live until something is true; whether it is."""
        end = time.monotonic() + seconds
        while not what() and time.monotonic() < end:
            await self.channel.send(json.dumps({"type": "pulse", "held": False}))
            await asyncio.sleep(0.05)
        return what()

    async def enter(self, label, value, what):
        """Set a control, again and again, until something is true; whether it is.

        The view may put a number back before it is read, and a busy machine may refuse
        a call.
        """
        for _ in range(10):
            await self.set(label, value)
            if await self.until(what, 3.0):
                return True
        return False


@pytest.fixture
def act(live):
    """Runs what a page does, once the arm was measured and the page is known."""
    view, browser = live
    assert until(lambda: view.source.newest is not None)

    def run(does):
        async def do():
            channel, scene = await greet(view, browser)
            async with channel as channel, scene as scene:
                page = Page(view, channel, scene)
                await page.send("ViewerCameraMessage", **CAMERA)
                assert await page.until(view.server.get_clients)
                await does(view, page)

        asyncio.run(do())

    return run


def test_the_arm_is_driven_by_the_controls_of_its_tab(act):
    async def drive(view, page):
        def held():
            return view.world.cycle(view.source.newest).command.held

        commander = view.commander
        assert await page.enter("Take the command", True, lambda: commander.commands)
        assert await page.enter("Engage all", True, lambda: not held())
        q = view.source.newest.q.copy()
        await page.set("joint7", float(q[6]) + 0.5)
        assert await page.until(lambda: view.source.newest.q[6] > q[6] + 0.4)
        assert np.abs(view.source.newest.q - q)[:6].max() < 0.01
        await page.set("Handles at tools")
        assert await page.until(lambda: "left" in view.drive.handles.nodes)
        await page.set("Handles at tools", False)
        assert await page.until(lambda: not view.drive.handles.nodes)
        await page.set("Speed [%]", 80)
        assert await page.until(lambda: view.driver.share == 0.8)
        await page.set("Keys and gamepad")
        assert await page.until(lambda: '"on": true' in view.page.newest["driving"])
        await page.set("Tele-driver")
        assert await page.until(lambda: view.driver.tele is not None)
        await page.set("Tele-driver", False)
        assert await page.until(lambda: view.driver.tele is None)
        assert await page.enter("Give it back", True, lambda: not commander.commands)

    act(drive)


def test_drive_yourself_takes_the_command_and_shows_the_inputs(act):
    async def drive(view, page):
        await page.channel.send(json.dumps({"type": "drive"}))
        assert await page.until(lambda: view.commander.commands)
        assert await page.until(lambda: "left" in view.drive.handles.nodes)
        assert await page.until(lambda: '"on": true' in view.page.newest["driving"])
        assert await page.until(lambda: '"commands": true' in view.page.newest["may"])
        assert await page.enter(
            "Give it back", True, lambda: not view.commander.commands
        )
        # What is refused without the command comes with the button that takes it.
        view.commander.call("engage")
        refused = json.loads(view.page.newest["refused"])
        assert refused["remedy"] == "Take the command" and refused["said"]
        await page.set("Handles at tools", False)
        await page.set("Keys and gamepad", False)

    act(drive)


def test_drawables_are_switched_by_their_checkboxes(act):
    async def switch(view, page):
        for one in view.drawables:
            if one.label:
                await page.set(one.label, not one.shown)
        shown = {one.label: one for one in view.drawables if one.label}
        leaves, checked = (
            shown["Octree leaves at the arms"],
            shown["Checked primitives"],
        )
        assert await page.until(lambda: len(checked.nodes) == 7 and leaves.nodes)
        await page.set(checked.label, False)
        nodes = checked.nodes.values()
        assert await page.until(lambda: not any(node.visible for node in nodes))

    act(switch)


def test_a_box_is_added_moved_resized_and_all_is_undone(act):
    async def edit(view, page):
        def pose():
            return view.world.objects.poses["spare"]

        await page.set("Add a box")
        assert await page.until(lambda: pose() is not None)
        assert await page.until(lambda: view.edit._choice.value == "spare")
        near = 1e-3
        assert await page.until(
            lambda: np.allclose(view.edit._place.value, pose()[:3, 3], atol=near)
        )
        place = [-0.6, *view.edit._place.value[1:]]
        assert await page.enter("Place [m]", place, lambda: pose()[0, 3] == -0.6)
        shapes, edges = view.world.objects.shapes, [0.3, 0.2, 0.1]
        assert await page.enter("Edges [m]", edges, lambda: "spare" in shapes)
        turn = [0.0, 0.0, 30.0]
        assert await page.enter("Turn [°]", turn, lambda: pose()[1, 0] > 0.49)
        (name, entry), *_ = view.editor.changes(view.edit._names).items()
        assert (name, entry.size) == ("wall_1", (0.3, 0.2, 0.1))
        assert entry.pose.rpy[2] == pytest.approx(np.deg2rad(30.0))
        assert await page.enter("Undo", True, lambda: view.edit._turn.value[2] == 0.0)
        await page.send("TransformControlsDragStartMessage", name="/edit")
        place = [-0.5, -0.5, 1.2]
        turn = [1, 0, 0, 0]
        kind = "TransformControlsUpdateMessage"
        await page.send(kind, name="/edit", wxyz=turn, position=place)
        await page.send("TransformControlsDragEndMessage", name="/edit")
        assert await page.until(lambda: np.allclose(pose()[:3, 3], place))
        assert await page.enter("Remove", True, lambda: pose() is None)
        assert await page.until(lambda: view.edit._choice.value == "nothing")
        assert await page.enter("Undo", True, lambda: pose() is not None)

    act(edit)
