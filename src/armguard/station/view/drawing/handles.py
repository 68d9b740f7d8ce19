"""A handle at each tool, to drag it by."""

from typing import Any

import numpy as np
import viser

from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame
from armguard.station.view.drawing.frames import Floats, quaternion
from armguard.station.view.driving.driver import Driver
from armguard.station.view.driving.wishes import tool_frame
from armguard.station.view.scene_port import page_of

# A handle that nobody holds is put back to its tool when it is this far off.
ASIDE = 2e-3


class Handles:
    """Handles at all tools; the guard's own inverse kinematics follow them.

    Attributes:
        shown: Whether there are any at present.

    Args:
        server: The page's scene.
        tables: The scene.
        driver: Who leads the tools.
    """

    def __init__(
        self, server: viser.ViserServer, tables: SceneTables, driver: Driver
    ) -> None:
        self._server, self._tables, self._driver = server, tables, driver
        self._handles: dict[str, Any] = {}

    @property
    def shown(self) -> bool:
        """Whether there are any at present."""
        return bool(self._handles)

    def show(self, shown: bool) -> None:
        """Put handles up, or take them away."""
        if shown == self.shown:
            return
        if shown:
            for part in self._tables.robots:
                self._handles[part.name] = self._handle(part.name)
            return
        for name, handle in self._handles.items():
            self._driver.lead_tool(name, None)
            handle.remove()
        self._handles.clear()

    def move(self, frame: Frame) -> None:
        """Keep the handles that nobody holds at their tools."""
        for part in self._tables.robots:
            handle = self._handles.get(part.name)
            if handle is None or self._driver.leads_tool(part.name):
                continue
            T = tool_frame(self._tables, part, frame.poses)
            q = quaternion(T[:3, :3])
            off = np.abs(np.asarray(handle.position) - T[:3, 3]).max()
            # Quaternions of opposite signs are one rotation.
            turned = 1.0 - abs(float(np.asarray(handle.wxyz) @ q))
            if off > ASIDE or turned > ASIDE**2:
                handle.position, handle.wxyz = T[:3, 3], q

    def _handle(self, name: str) -> Any:
        handle = self._server.scene.add_transform_controls(
            f"/handles/{name}", scale=0.28, line_width=3.0, depth_test=False
        )

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            if event.phase == "end":
                self._driver.lead_tool(name, None)
                return
            page = page_of(self._server, event.client_id)
            self._driver.lead_tool(name, frame_of(event.target), page)

        return handle


def frame_of(node: Any) -> Floats:
    """Frame of a node in the world, shape (4, 4)."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    w, x, y, z = np.asarray(node.wxyz, dtype=np.float64)
    T[:3, :3] = Rotation.from_quat([x, y, z, w]).as_matrix()
    T[:3, 3] = node.position
    return T
