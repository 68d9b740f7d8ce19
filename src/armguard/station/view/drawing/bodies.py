"""Robots and objects where the check had them, and the primitives it measured."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser

from armguard.geometry.shapes import Shape, shape_row
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame
from armguard.station.palette import (
    BLUE,
    FIXTURE,
    GRASPABLE,
    PLACED,
    ROBOT_TINTS,
    Rgb,
)
from armguard.station.view.drawing.frames import Placer, quaternion
from armguard.station.view.placements import Placements
from armguard.station.view.robot_meshes import link_meshes, placed
from armguard.station.view.surfaces import Mesh, joined, mesh_of


class Bodies:
    """Nodes of all bodies.

    Args:
        server: The page's scene.
        scene: What is drawn.
        tables: The same as the check has it.
    """

    def __init__(
        self, server: viser.ViserServer, scene: Scene, tables: SceneTables
    ) -> None:
        self._server, self._tables = server, tables
        self._primitives: list[Any] = []
        self._standing: dict[str, Any] = {}
        self._shapes: dict[str, Shape] = {}
        self._seen = -1
        nodes: list[Any | None] = [None] * len(tables.parent)
        for k in range(len(tables.parent)):
            nodes[k] = server.scene.add_frame(f"/bodies/{k}", show_axes=False)
        self._placer = Placer(nodes)
        for r, (robot, model) in enumerate(scene.robots.items()):
            tint = ROBOT_TINTS[r % len(ROBOT_TINTS)]
            looks = on_bodies(robot, link_meshes(model), tables)
            for name, (body, mesh) in looks.items():
                add_mesh(server, f"/bodies/{body}/{slug(name)}", mesh, tint)
        self._add_carried(scene)
        self._add_standing()

    def move(self, frame: Frame, placements: Placements) -> None:
        """Put everything where a cycle had it."""
        self._placer.move(frame.poses)
        if placements.changes != self._seen:
            self._seen = placements.changes
            self._place(placements)

    def show_primitives(self, shown: bool) -> None:
        """Show or hide the primitives that moving bodies are measured by."""
        if shown and not self._primitives:
            self._primitives = [
                add_mesh(
                    self._server,
                    f"/bodies/{body}/primitive_{i}",
                    mesh_of(self._tables.kinds[i], self._tables.local_rows[i], 1e-3),
                    BLUE,
                    opacity=0.35,
                )
                for i, body in enumerate(
                    self._tables.bodies[: self._tables.moving_count]
                )
            ]
        for node in self._primitives:
            node.visible = shown

    def _add_carried(self, scene: Scene) -> None:
        """Objects that ride on links."""
        tables = self._tables
        names = np.array(list(tables.body_names)[: tables.moving_count])
        for name, thing in scene.objects.items():
            if thing.attached_to is None:
                continue
            own = np.flatnonzero(names == name)
            rows = [mesh_of(tables.kinds[i], tables.local_rows[i]) for i in own]
            body = int(tables.bodies[own[0]])
            path = f"/bodies/{body}/{slug(name)}"
            add_mesh(self._server, path, joined(rows), GRASPABLE)

    def _add_standing(self) -> None:
        """Objects that stand still, may come and go, or may be gripped."""
        for name, thing in self._tables.standing.items():
            colour = FIXTURE if thing.present else PLACED
            path = f"/objects/{slug(name)}"
            if thing.body >= 0:
                path, colour = f"/bodies/{thing.body}/{slug(name)}", GRASPABLE
            rows = thing.rows(np.eye(4))
            kinds = self._tables.kinds[thing.first : thing.first + thing.count]
            parts = [mesh_of(k, row) for k, row in zip(kinds, rows, strict=True)]
            self._standing[name] = add_mesh(self._server, path, joined(parts), colour)

    def _place(self, placements: Placements) -> None:
        for name, T in placements.poses.items():
            node = self._standing[name]
            node.visible = T is not None
            if T is None or self._tables.standing[name].body >= 0:
                continue
            node.position, node.wxyz = T[:3, 3], quaternion(T[:3, :3])
            shape = placements.shapes.get(name)
            if shape is not None and self._shapes.get(name) != shape:
                self._shapes[name] = shape
                T_own = self._tables.standing[name].shapes[0].pose.matrix()
                mesh = mesh_of(shape.kind, shape_row(shape, T_own))
                node.vertices = np.asarray(mesh.vertices, dtype=np.float32)
                node.faces = np.asarray(mesh.faces, dtype=np.uint32)


def on_bodies(
    robot: str, meshes: Mapping[str, Mesh], tables: SceneTables
) -> dict[str, tuple[int, Mesh]]:
    """Body of each link of a robot, and its triangles there, by 'robot/link'."""
    found = {}
    for link, mesh in meshes.items():
        at = tables.links[f"{robot}/{link}"]
        found[f"{robot}/{link}"] = at.body, placed(mesh, at.T_body_link)
    return found


def add_mesh(
    server: viser.ViserServer,
    path: str,
    mesh: Mesh,
    colour: Rgb,
    opacity: float | None = None,
) -> Any:
    """A node of triangles."""
    return server.scene.add_mesh_simple(
        path,
        np.asarray(mesh.vertices, dtype=np.float32),
        np.asarray(mesh.faces, dtype=np.uint32),
        color=colour,
        opacity=opacity,
        side="double" if opacity is not None else "front",
        cast_shadow=opacity is None,
        receive_shadow=opacity is None,
    )


def slug(name: str) -> str:
    """A name as part of a path of nodes."""
    return name.replace("/", "|")
