"""A coordination on line on the page: items at the belt, and which robot yields."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.creation import box

from armguard.recording.palette import GRASPABLE, ROBOT_TINTS, hexadecimal
from armguard.view.drawables import Drawable
from armguard.view.world import Cycle, World, tool_pose

Floats = NDArray[np.float64]

# Time between two questions, and time without an answer after which the coordination
# counts as ended [s].
ASKS, ENDED = 0.2, 2.0

# Size of the box that is drawn for an item, and its middle below the tool that grips it
# near its top [m]. Jobs have no sizes of items.
SIZE, BELOW = (0.05, 0.05, 0.13), np.array([0.0, 0.0, -0.055])

# Labels are so far above middles of items, and above tools of robots that yield [m].
ABOVE, OVER = np.array([0.0, 0.0, 0.09]), np.array([0.0, 0.0, 0.2])


class LineItems(Drawable):
    """What `armguard coordinate` executes on the robots of the service.

    Args:
        world: The scene.
        ask: Asks the coordination for its state, see `LineState`; None where there is
            none.
        publish: Sends the page the state in words.
    """

    def __init__(
        self,
        world: World,
        ask: Callable[[], dict[str, Any] | None],
        publish: Callable[[Mapping[str, Any]], None],
    ) -> None:
        super().__init__(world)
        self._ask, self._publish = ask, publish
        self._asked = self._heard = -np.inf
        self._state: dict[str, Any] | None = None
        self._publish({"robots": []})

    def _draw(self, cycle: Cycle) -> None:
        now = time.monotonic()
        if now - self._asked >= ASKS:
            self._asked = now
            self._take(self._ask(), now)
        state: dict[str, Any] = {"items": [], "robots": []}
        if self._state is not None and now - self._heard <= ENDED:
            state = self._state
        tools = {
            part.name: tool_pose(self.tables, part, cycle.frame.poses)[:3, 3]
            for part in self.tables.robots
        }
        seen = set()
        for item in state["items"]:
            at = np.array(item["xyz"]) + np.array(item["moves"]) * (now - self._heard)
            if item["held"]:
                at = tools.get(item["robot"], at)
            seen |= self._item(item, at + BELOW)
        for robot in state["robots"]:
            if robot["yields"] and robot["name"] in tools:
                words = f"{robot['name']} yields"
                seen.add(self._label(robot["name"], words, tools[robot["name"]] + OVER))
        for key in self.nodes.keys() - seen:
            self.nodes.pop(key).remove()

    def _take(self, state: dict[str, Any] | None, now: float) -> None:
        """Take in an answer; the words of one that has ended stay on the page."""
        if state is not None:
            self._state, self._heard = state, now
        shown, ended = self._state, now - self._heard > ENDED
        if shown is None:
            return
        names = [part.name for part in self.tables.robots]
        robots = [
            {**robot, "colour": hexadecimal(tint_of(names.index(robot["name"])))}
            for robot in shown["robots"]
            if robot["name"] in names
        ]
        self._publish({**shown, "robots": robots, "ended": ended})

    def _item(self, item: Mapping[str, Any], at: Floats) -> set[Any]:
        """Draw an item; its nodes."""
        job = item["job"]
        if job not in self.nodes:
            mesh = box(extents=SIZE)
            self.nodes[job] = self.mesh(f"/line/item_{job}", mesh, GRASPABLE)
        self.nodes[job].position = at
        whose = f" for {item['robot']}" if item["robot"] else ""
        words = f"item {job}{whose}"
        return {job, self._label(f"item {job}", words, at + ABOVE)}

    def _label(self, key: str, words: str, at: Floats) -> str:
        """Draw a label; the key of its node."""
        if key not in self.nodes:
            path = f"/line/label_{len(self.nodes)}_{key.replace(' ', '_')}"
            self.nodes[key] = self.api.add_label(path, words, anchor="bottom-center")
        self.nodes[key].text, self.nodes[key].position = words, at
        return key


def tint_of(k: int) -> tuple[int, int, int]:
    """Tint of a robot by its number."""
    return ROBOT_TINTS[k % len(ROBOT_TINTS)]
