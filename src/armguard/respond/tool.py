"""Tools: links whose motion operators may request, found by name."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armguard.errors import known_names
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tool:
    """Link whose velocity or pose an operator may request.

    Attributes:
        link: Name of the link, 'robot/link'.
        robot: Index of its robot.
        own: Range of its robot's joints in q.
        body: Index of the body of the link.
        p_body: Origin of the link in the frame of the body, shape (3,) [m].
        R_body: Rotation of the link in that frame, shape (3, 3) [-].
        tables: The scene.
    """

    link: str
    robot: int
    own: slice
    body: int
    p_body: Floats
    R_body: Floats
    tables: SceneTables

    def point(self, T_world: Floats) -> Floats:
        """Origin of the tool in the world, shape (3,) [m].

        Args:
            T_world: Poses of all bodies, rows of [R | p], shape (b, 12).
        """
        T = T_world[self.body].reshape(3, 4)
        p: Floats = T[:, :3] @ self.p_body + T[:, 3]
        return p


def tool_of(tables: SceneTables, name: str) -> Tool:
    """Tool of a robot, or one of its other links.

    Args:
        tables: The scene.
        name: Name of a robot, or 'robot/link'.
    """
    robot = name.split("/", 1)[0]
    r, part = next((r, p) for r, p in enumerate(tables.robots) if p.name == robot)
    link = part.tool if name == robot else name
    frame = tables.links[link]
    return Tool(
        link=link,
        robot=r,
        own=slice(part.first_joint, part.first_joint + part.joint_count),
        body=frame.body,
        p_body=frame.T_body_link[:3, 3],
        R_body=frame.T_body_link[:3, :3],
        tables=tables,
    )


@dataclass(frozen=True, slots=True)
class Tools:
    """Tools of a scene: the tool of each robot, and its other links.

    Attributes:
        tables: The scene.
        found: Tools that were requested so far, by name.
    """

    tables: SceneTables
    found: dict[str, Tool] = field(default_factory=dict)

    def named(self, name: str) -> Tool | None:
        """Tool of a robot, or the link 'robot/link'; None if there is none."""
        if name not in self.found:
            if name not in self.names:
                return None
            self.found[name] = tool_of(self.tables, name)
        return self.found[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of robots and links."""
        return (*(part.name for part in self.tables.robots), *self.tables.links)

    def near(self, name: object) -> str:
        """Names similar to an unknown name, in words."""
        return known_names(self.names, 12)
