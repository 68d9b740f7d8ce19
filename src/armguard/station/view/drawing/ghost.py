"""Where each arm would come to rest if it were stopped now."""

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from armguard.robot.kinematics import forward_kinematics
from armguard.scene.scene import Scene
from armguard.scene.tables import RobotPart, SceneTables
from armguard.station.frames import Frame
from armguard.station.palette import BLUE
from armguard.station.view.drawing.bodies import add_mesh, on_bodies, slug
from armguard.station.view.drawing.frames import Floats, Placer
from armguard.station.view.robot_meshes import plain_meshes
from armguard.station.view.surfaces import Mesh

# A body that would not get farther than this has none [m, or by the turn of its axes].
LEAST = 0.004

# Size of the ghost beside the arm's own [-].
SHARE = 0.97


class Ghost:
    """A second, translucent arm where the declared stop of the present motion ends.

    Args:
        server: The page's scene.
        scene: What is drawn.
        tables: The same as the check has it.
    """

    def __init__(
        self, server: viser.ViserServer, scene: Scene, tables: SceneTables
    ) -> None:
        self._tables = tables
        self._poses = np.zeros((len(tables.parent), 12))
        nodes: list[Any | None] = [None] * len(tables.parent)
        for robot, model in scene.robots.items():
            looks = on_bodies(robot, plain_meshes(model), tables)
            for name, (body, mesh) in looks.items():
                if nodes[body] is None:
                    nodes[body] = server.scene.add_frame(
                        f"/ghost/{body}", show_axes=False, visible=False
                    )
                path = f"/ghost/{body}/{slug(name)}"
                add_mesh(server, path, shrunk(mesh), BLUE, opacity=0.22)
        self._nodes = nodes
        self._placer = Placer(nodes)
        self.shown = True

    def draw(self, frame: Frame) -> None:
        """Draw where a cycle's motion would end."""
        q = resting(frame, self._tables) if self.shown else None
        if q is None:
            self._show(np.zeros(len(self._nodes), dtype=bool))
            return
        tables = self._tables
        forward_kinematics(
            q,
            tables.parent,
            tables.joint_kind,
            tables.q_index,
            tables.gain,
            tables.T_parent_joint,
            tables.axis,
            self._poses,
        )
        far = np.abs(self._poses - frame.poses).max(axis=1)
        self._show(far > LEAST)
        self._placer.move(self._poses)

    def _show(self, wanted: NDArray[np.bool_]) -> None:
        for node, shown in zip(self._nodes, wanted, strict=True):
            if node is not None and node.visible != shown:
                node.visible = bool(shown)


def shrunk(mesh: Mesh) -> Mesh:
    """A mesh a little smaller, so that it hides where the arm itself is."""
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2.0
    return Mesh(middle + SHARE * (mesh.vertices - middle), mesh.faces)


def resting(frame: Frame, tables: SceneTables) -> Floats | None:
    """Joint positions after a stop ordered now, shape (n,); None if unknown.

    The joints go on as they do for as long as an order may take to be obeyed, then
    slow down by the least deceleration that is declared.
    """
    if frame.velocity is None or not np.isfinite(frame.q).all():
        return None
    q = frame.q.copy()
    for part in tables.robots:
        own = slice(part.first_joint, part.first_joint + part.joint_count)
        way = stopping_ways(frame.velocity[own], part, tables.period + tables.late)
        if way is not None:
            q[own] += way
    return np.clip(q, tables.lower, tables.upper)


def stopping_ways(v: Floats, part: RobotPart, cycle: float) -> Floats | None:
    """Way of each joint of a robot from now until it rests, shape (k,) [rad or m].

    Args:
        v: Its velocities, shape (k,).
        part: The robot.
        cycle: Time until the next order [s].
    """
    figures = part.stopping
    if figures is None:
        return None
    speed = np.abs(v)
    way = speed * (figures.sensing + figures.command + cycle)
    for k, s in enumerate(speed):
        table = figures.table_of(k)
        if table is not None:
            way[k] += table.at(float(s))[1]
        else:
            way[k] += ramped_way(float(s), figures.ramp, float(figures.deceleration[k]))
    return np.asarray(np.sign(v) * way)


def ramped_way(v: float, ramp: float, d: float) -> float:
    """Way of a stop whose deceleration rises from nothing within a ramp [rad or m].

    Args:
        v: Speed at its beginning, >= 0 [rad/s or m/s].
        ramp: Time until the deceleration is full [s].
        d: The full one [rad/s² or m/s²].

    Example:
        >>> ramped_way(1.0, 0.0, 2.0)
        0.25
    """
    lost = 0.5 * d * ramp
    if v <= lost:
        # At rest before the deceleration is full: v = d t² / (2 ramp).
        return float(2.0 / 3.0 * v * np.sqrt(2.0 * ramp * v / d)) if d > 0.0 else 0.0
    rising = ramp * v - d * ramp * ramp / 6.0
    return rising + (v - lost) ** 2 / (2.0 * d)
