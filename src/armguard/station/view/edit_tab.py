"""The tab to edit by: boxes that come, move, change size and go; then the file."""

import html
from pathlib import Path
from typing import Any

import numpy as np
import viser

from armguard.errors import ArmguardError
from armguard.geometry.pose import Pose
from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame
from armguard.station.view.drawing.frames import Floats, quaternion
from armguard.station.view.drawing.handles import frame_of
from armguard.station.view.editing.editor import Editor, State
from armguard.station.view.editing.scene_text import (
    difference,
    edited,
    write_checked,
)
from armguard.station.view.world import World

NOTHING = "nothing"

# Edge of a box that was just added [m].
EDGE = 0.2


class EditTab:
    """What is in the tab.

    Args:
        server: The page.
        world: What is edited.
        editor: Who edits it.
        file: The scene's file; None if it has none that may be written.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        world: World,
        editor: Editor,
        file: Path | None,
    ) -> None:
        self._server, self._world = server, world
        self._editor, self._file = editor, file
        self._gizmo: Any | None = None
        self._held = False
        self._known: tuple[str, ...] = ()
        self._poses: Floats = np.zeros((0, 12))
        gui = server.gui
        self._choice = gui.add_dropdown("Object", (NOTHING,))
        add = gui.add_button("Add a box", icon=viser.Icon.CUBE_PLUS)
        with gui.add_folder("Place and size"):
            self._place = gui.add_vector3("Place [m]", (0.0, 0.0, 0.0), step=0.005)
            self._turn = gui.add_vector3("Turn [°]", (0.0, 0.0, 0.0), step=1.0)
            self._size = gui.add_vector3(
                "Edges [m]", (EDGE,) * 3, min=(0.005,) * 3, step=0.005
            )
            self._name = gui.add_text("In the file", "")
        remove = gui.add_button("Remove", icon=viser.Icon.TRASH)
        undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP)
        write = gui.add_button("Write to the scene file …", icon=viser.Icon.FILE_DIFF)
        self._names: dict[str, str] = {}

        @self._choice.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self._choose(self._choice.value)

        @add.on_click
        def _(event: viser.GuiEvent) -> None:
            self._say(event, self._add)

        @remove.on_click
        def _(_: viser.GuiEvent) -> None:
            if self._choice.value != NOTHING:
                self._editor.put(self._choice.value, None)
                self._choose(NOTHING)

        @undo.on_click
        def _(_: viser.GuiEvent) -> None:
            self._editor.undo()

        @write.on_click
        def _(event: viser.GuiEvent) -> None:
            self._say(event, lambda: self._show_difference(event))

        for box in (self._place, self._turn, self._size):
            box.on_update(self._typed)

        @self._name.on_update
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self._names[self._choice.value] = self._name.value.strip()

    def show(self, frame: Frame) -> None:
        """Let the choice, the numbers and the handle follow."""
        self._poses = frame.poses
        movable = (NOTHING, *self._editor.movable)
        if movable != self._known:
            self._known = movable
            chosen = self._choice.value
            self._choice.options = movable
            if chosen in movable:
                self._choice.value = chosen
            else:
                self._choose(NOTHING)
        name = self._choice.value
        state = None if name == NOTHING else self._editor.state(name)
        if state is None or self._held:
            return
        pose = Pose.from_matrix(state.T)
        turn = tuple(np.rad2deg(pose.rpy))
        sizes = None if state.half is None else tuple(2.0 * h for h in state.half)
        for box, value in (
            (self._place, pose.xyz),
            (self._turn, turn),
            (self._size, sizes),
        ):
            if value is not None and not np.allclose(box.value, value, atol=1e-4):
                box.value = tuple(float(round(v, 4)) for v in value)
        if self._gizmo is not None:
            off = np.abs(np.asarray(self._gizmo.position) - state.T[:3, 3]).max()
            if off > 1e-4:
                self._gizmo.position = state.T[:3, 3]
                self._gizmo.wxyz = quaternion(state.T[:3, :3])

    def _add(self) -> None:
        T = np.eye(4)
        T[:3, 3] = free_place(self._world.tables, self._poses)
        name = self._editor.add((EDGE / 2.0,) * 3, T)
        self._names.setdefault(name, self._fresh_name())
        self._known = (*self._known, name)
        self._choice.options = self._known
        self._choice.value = name
        self._choose(name)

    def _fresh_name(self) -> str:
        taken = {*self._world.scene.body_names(), *self._names.values()}
        return next(f"wall_{k}" for k in range(1, 1000) if f"wall_{k}" not in taken)

    def _choose(self, name: str) -> None:
        if self._gizmo is not None:
            self._gizmo.remove()
            self._gizmo = None
        self._held = False
        if name == NOTHING:
            if self._choice.value != NOTHING:
                self._choice.value = NOTHING
            return
        spare = name in self._editor.spare
        self._size.disabled = not spare
        self._name.disabled = not spare
        self._name.value = self._names.get(name, "") if spare else name
        state = self._editor.state(name)
        T = np.eye(4) if state is None else state.T
        self._gizmo = self._server.scene.add_transform_controls(
            "/edit",
            scale=0.35,
            line_width=3.0,
            depth_test=False,
            position=T[:3, 3],
            wxyz=quaternion(T[:3, :3]),
        )

        @self._gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            begins = event.phase == "start"
            self._held = event.phase != "end"
            half = tuple(v / 2.0 for v in self._size.value) if spare else None
            self._editor.drag(name, State(frame_of(event.target), half), begins)

    def _typed(self, event: viser.GuiEvent) -> None:
        """Somebody typed a place, a turn or a size."""
        name = self._choice.value
        if event.client is None or name == NOTHING:
            return
        turn = np.deg2rad(self._turn.value)
        T = Pose(xyz=self._place.value, rpy=tuple(turn.tolist())).matrix()
        x, y, z = (max(v, 0.005) / 2.0 for v in self._size.value)
        spare = name in self._editor.spare
        self._editor.put(name, State(T, (x, y, z) if spare else None))

    def _show_difference(self, event: viser.GuiEvent) -> None:
        client, file = event.client, self._file
        if client is None:
            return
        if file is None:
            raise ArmguardError(
                "this scene has no file that may be written; start the service with a "
                "scene file of your own"
            )
        before = file.read_text(encoding="utf-8")
        after = edited(before, self._editor.changes(self._names))
        if before == after:
            raise ArmguardError("nothing is otherwise than the file says")
        with client.gui.add_modal(f"Changes of {file.name}") as modal:
            client.gui.add_html(coloured(difference(before, after, file.name)))
            yes = client.gui.add_button("Write", color="green")
            no = client.gui.add_button("Leave the file as it is")

        @yes.on_click
        def _(answer: viser.GuiEvent) -> None:
            modal.close()
            self._say(answer, lambda: write_checked(file, before, after))

        @no.on_click
        def _(_: viser.GuiEvent) -> None:
            modal.close()

    def _say(self, event: viser.GuiEvent, what: Any) -> None:
        """Do something, and tell who asked for it why it cannot be done."""
        try:
            what()
        except (ArmguardError, OSError) as error:
            if event.client is not None:
                event.client.add_notification("Not done", str(error), color="orange")


def free_place(tables: SceneTables, poses: Floats) -> Floats:
    """A place well away from all bodies, for a box that was just added, shape (3,) [m].

    Args:
        tables: The scene.
        poses: Poses of all bodies, rows of [R | p], shape (b, 12).
    """
    reach = 0.4 * tables.cube_edge
    sides = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (0, 1)]
    )
    places = tables.cube_centre + reach * sides
    bodies = poses[:, [3, 7, 11]]
    gaps = np.linalg.norm(places[:, None] - bodies[None], axis=2)
    return np.asarray(places[int(gaps.min(axis=1, initial=np.inf).argmax())])


def coloured(diff: str) -> str:
    """A diff as HTML; what is in it means nothing there."""
    lines = []
    for line in diff.splitlines():
        colour = {"+": "#d7eefb", "-": "#fbe3d3", "@": "#eceff1"}.get(line[:1], "none")
        lines.append(
            f'<div style="background:{colour}">{html.escape(line) or "&nbsp;"}</div>'
        )
    style = "font: 12px/1.5 monospace; white-space: pre-wrap; overflow-x: auto"
    return f'<div style="{style}">{"".join(lines)}</div>'
