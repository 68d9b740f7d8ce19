"""The tab to edit by: boxes are added, moved, resized, removed; then the file."""

import html
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.geometry.pose import Pose
from armguard.scene.file_edit import difference, edited, write_checked
from armguard.scene.tables import SceneTables
from armguard.station.view.controls import ask, by_page
from armguard.station.view.cycles import Cycle
from armguard.station.view.drawables import Drawable, pose_of, put
from armguard.station.view.editor import HALF, Editor, Placed
from armguard.station.view.world import World

Floats = NDArray[np.float64]

NOTHING = "nothing"

# Least edge of a box, and step of its edges and of its place [m].
GRAIN = 0.005

COLOURS = {"+": "#d7eefb", "-": "#fbe3d3", "@": "#eceff1"}


class EditTab(Drawable):
    """The controls of the tab, and a handle at the object that is chosen.

    Args:
        world: The scene that is edited.
        editor: Changes objects.
        file: The scene's file; None if it has none that may be written.
    """

    def __init__(self, world: World, editor: Editor, file: Path | None) -> None:
        super().__init__(world)
        self._editor, self._file = editor, file
        self._held = False
        self._names: dict[str, str] = {}
        self._poses: Floats = np.zeros((0, 12))
        gui = self.gui
        self._choice = gui.add_dropdown("Object", (NOTHING,))
        add = gui.add_button("Add a box", icon=viser.Icon.CUBE_PLUS)
        zero = (0.0, 0.0, 0.0)
        with gui.add_folder("Place and size"):
            self._place = gui.add_vector3("Place [m]", zero, step=GRAIN)
            self._turn = gui.add_vector3("Turn [°]", zero, step=1.0)
            self._size = gui.add_vector3(
                "Edges [m]", (2.0 * HALF,) * 3, min=(GRAIN,) * 3, step=GRAIN
            )
            self._name = gui.add_text("In the file", "")
        remove = gui.add_button("Remove", icon=viser.Icon.TRASH)
        undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP)
        write = gui.add_button("Write to the scene file …", icon=viser.Icon.FILE_DIFF)
        self._choice.on_update(by_page(lambda _: self._choose(self._choice.value)))
        add.on_click(lambda event: attempt(event, self._add))
        remove.on_click(lambda _: self._remove())
        undo.on_click(lambda _: editor.undo())
        write.on_click(lambda event: attempt(event, lambda: self._show_diff(event)))
        for box in (self._place, self._turn, self._size):
            box.on_update(by_page(lambda _: self._typed()))

        @self._name.on_update
        @by_page
        def _(_: viser.GuiEvent) -> None:
            self._names[self._choice.value] = self._name.value.strip()

    def draw(self, cycle: Cycle) -> None:
        """Let the choice, the numbers and the handle follow."""
        self._poses = cycle.frame.poses
        movable, name = (NOTHING, *self._editor.movable), self._choice.value
        if movable != self._choice.options:
            self._choice.options = movable
            if name not in movable:
                self._choose(NOTHING)
        name = self._choice.value
        placed = None if name == NOTHING else self._editor.placed(name)
        if placed is None or self._held:
            return
        pose = Pose.from_matrix(placed.T)
        size = self._size.value if placed.half is None else 2.0 * np.array(placed.half)
        for box, value in (
            (self._place, np.array(pose.xyz)),
            (self._turn, np.rad2deg(pose.rpy)),
            (self._size, size),
        ):
            if not np.allclose(box.value, value, atol=1e-4):
                box.value = np.round(value, 4)
        for handle in self.nodes.values():
            if np.abs(handle.position - placed.T[:3, 3]).max() > 1e-4:
                put(handle, placed.T)

    def _add(self) -> None:
        T = np.eye(4)
        T[:3, 3] = free_place(self.tables, self._poses)
        name = self._editor.add(T)
        taken = {*self.world.scene.body_names(), *self._names.values()}
        fresh = next(f"wall_{k}" for k in range(1, 1000) if f"wall_{k}" not in taken)
        self._names.setdefault(name, fresh)
        self._choice.options = (*self._choice.options, name)
        self._choice.value = name
        self._choose(name)

    def _remove(self) -> None:
        if self._choice.value != NOTHING:
            self._editor.put(self._choice.value, None)
            self._choose(NOTHING)

    def _choose(self, name: str) -> None:
        """Put the handle at an object, and its name and size into the controls."""
        self._held = False
        while self.nodes:
            self.nodes.popitem()[1].remove()
        self._choice.value = name
        if name == NOTHING:
            return
        reserved = name in self._editor.reserved
        self._size.disabled = self._name.disabled = not reserved
        self._name.value = self._names.get(name, "") if reserved else name
        handle = self.nodes[name] = self.api.add_transform_controls(
            "/edit", scale=0.35, line_width=3.0, depth_test=False
        )
        placed = self._editor.placed(name)
        if placed is not None:
            put(handle, placed.T)

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            begins = event.phase == "start"
            self._held = event.phase != "end"
            self._editor.drag(name, self._as_typed(name, pose_of(event.target)), begins)

    def _as_typed(self, name: str, T: Floats) -> Placed:
        """An object at a frame, of the size in the controls if it may change."""
        x, y, z = (max(edge, GRAIN) / 2.0 for edge in self._size.value)
        return Placed(T, (x, y, z) if name in self._editor.reserved else None)

    def _typed(self) -> None:
        """Place the object where the numbers say."""
        name = self._choice.value
        if name != NOTHING:
            rpy = tuple(np.deg2rad(self._turn.value).tolist())
            T = Pose(xyz=self._place.value, rpy=rpy).matrix()
            self._editor.put(name, self._as_typed(name, T))

    def _show_diff(self, event: viser.GuiEvent) -> None:
        """Show the changes of the scene file, and ask whether to write them."""
        file = self._file
        if file is None:
            raise ArmguardError(
                "this scene has no file that may be written; start the service with a "
                "scene file of your own"
            )
        before = file.read_text(encoding="utf-8")
        after = edited(before, self._editor.changes(self._names))
        if before == after:
            raise ArmguardError("nothing is otherwise than the file says")
        diff = coloured(difference(before, after, file.name))
        ask(
            event,
            f"Changes of {file.name}",
            lambda gui: gui.add_html(diff),
            ("Write", "green"),
            "Leave the file as it is",
            lambda e: attempt(e, lambda: write_checked(file, before, after)),
        )


def attempt(event: viser.GuiEvent, does: Callable[[], Any]) -> None:
    """Do something; show the person who asked for it why it cannot be done."""
    try:
        does()
    except (ArmguardError, OSError) as error:
        if event.client is not None:
            event.client.add_notification("Not done", str(error), color="orange")


def free_place(tables: SceneTables, poses: Floats) -> Floats:
    """A place far from all bodies, for a box that was just added, shape (3,) [m].

    Args:
        tables: The scene.
        poses: Poses of all bodies, rows of [R | p], shape (b, 12).
    """
    sides = np.array(
        [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (0, 1)]
    )
    places = tables.cube_centre + 0.4 * tables.cube_edge * sides
    gaps = np.linalg.norm(places[:, None] - poses[None, :, [3, 7, 11]], axis=2)
    return np.asarray(places[int(gaps.min(axis=1, initial=np.inf).argmax())])


def coloured(diff: str) -> str:
    """A diff as HTML; what is in it means nothing there."""
    lines = [
        f'<div style="background:{COLOURS.get(line[:1], "none")}">'
        f"{html.escape(line) or '&nbsp;'}</div>"
        for line in diff.splitlines()
    ]
    style = "font: 12px/1.5 monospace; white-space: pre-wrap; overflow-x: auto"
    return f'<div style="{style}">{"".join(lines)}</div>'
