"""The tab to edit by: boxes are added, moved, resized, removed; then the file."""

import html
import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from armguard.errors import ArmguardError, SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box
from armguard.scene.file_edit import Entry, difference, edited, write_checked
from armguard.scene.tables import SceneTables
from armguard.view.controls import ask, on_click, on_page
from armguard.view.drawables import Drawable, pose_of, put
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

NOTHING = "nothing"

# Least edge of a box, and step of its edges and of its place [m].
GRAIN = 0.005

# Calls during a drag, a second at most.
RATE = 10.0

# Half edge of a box that was just added [m].
HALF = 0.1

COLOURS = {"+": "#d7eefb", "-": "#fbe3d3", "@": "#eceff1"}


@dataclass(frozen=True, slots=True)
class Placed:
    """An object in the scene.

    Attributes:
        T: Its frame in the world, shape (4, 4).
        half: Half extents of a reserved box; else None [m].
    """

    T: Floats
    half: Triple | None = None


class Editor:
    """Places and removes objects in the loop, at once; remembers how it was.

    Attributes:
        reserved: Names of the boxes that the scene reserves for additions.

    Args:
        world: The scene.
        call: Calls the service; whether it was done.
        changeable: Names of the objects that the page may change.
    """

    def __init__(
        self, world: World, call: Callable[..., bool], changeable: Collection[str]
    ) -> None:
        self._world, self._call, self._changeable = world, call, changeable
        self._standing = world.tables.standing
        self.reserved = tuple(
            name
            for name, item in self._standing.items()
            if not item.present
            and item.body < 0
            and not item.surfaces
            and len(item.shapes) == 1
            and isinstance(item.shapes[0].shape, Box)
        )
        self._undo: list[tuple[str, Placed | None]] = []
        self._began: dict[str, Placed | None] = {}
        self._dragged: dict[str, Placed] = {}
        self._wake, self._stop = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="edit", daemon=True)
        self._thread.start()

    @property
    def movable(self) -> tuple[str, ...]:
        """Objects that are there, attached to nothing, and may be changed."""
        return tuple(
            name
            for name, T in self._world.objects.poses.items()
            if T is not None
            and self._standing[name].body < 0
            and name in self._changeable
        )

    def placed(self, name: str) -> Placed | None:
        """An object as it is now; None if it is absent."""
        T = self._world.objects.poses[name]
        if T is None:
            return None
        return Placed(T, self._half(name) if name in self.reserved else None)

    def add(self, T: Floats) -> str | None:
        """Place a reserved box; its name in the loop, None if the service refuses.

        Raises:
            SceneError: None is left.
        """
        poses = self._world.objects.poses
        free = [name for name in self.reserved if poses[name] is None]
        if not free:
            raise SceneError(
                "the service holds no box ready any more; remove one, or write these "
                "to the scene file and start the service again"
            )
        return free[0] if self.put(free[0], Placed(T, (HALF,) * 3)) else None

    def put(self, name: str, placed: Placed | None) -> bool:
        """Place an object, or remove it; whether it was done. It can be undone."""
        before = self.placed(name)
        done = self._do(name, placed)
        if done:
            self._began.setdefault(name, before)
            self._undo.append((name, before))
        return done

    def drag(self, name: str, placed: Placed, begins: bool) -> None:
        """Place an object during a drag, of whose poses only the newest counts."""
        if begins or name not in self._dragged:
            before = self.placed(name)
            self._began.setdefault(name, before)
            if begins:
                self._undo.append((name, before))
        self._dragged[name] = placed
        self._wake.set()

    def undo(self) -> None:
        """Take the last change back."""
        if self._undo:
            name, placed = self._undo.pop()
            self._dragged.pop(name, None)
            self._do(name, placed)

    def changes(self, names: Mapping[str, str]) -> dict[str, Entry | None]:
        """Changes since the view began, for the scene file.

        Args:
            names: Names of reserved boxes in the file.
        """
        found: dict[str, Entry | None] = {}
        for name, began in self._began.items():
            now, reserved = self.placed(name), name in self.reserved
            if now is None:
                if not reserved:
                    found[name] = None
            elif reserved or began is None or not np.allclose(began.T, now.T):
                size = None
                if now.half is not None:
                    x, y, z = now.half
                    size = (2.0 * x, 2.0 * y, 2.0 * z)
                key = names.get(name, name) if reserved else name
                found[key] = Entry(Pose.from_matrix(now.T), size)
        return found

    def close(self) -> None:
        """Change nothing any more."""
        self._stop.set()
        self._wake.set()
        self._thread.join(timeout=1.0)

    def _half(self, name: str) -> Triple:
        """Half extents that a reserved box has now [m]."""
        shape = self._world.objects.present(name, self._standing[name]).shapes[0].shape
        assert isinstance(shape, Box)
        return shape.half_extents

    def _do(self, name: str, placed: Placed | None) -> bool:
        if placed is None:
            return self._call("remove", name=name)
        arguments: dict[str, Any] = {"name": name, "pose": placed.T.tolist()}
        if placed.half is not None and placed.half != self._half(name):
            arguments["shape"] = {
                "kind": "box",
                "size": [2.0 * half for half in placed.half],
            }
        return self._call("place", **arguments)

    def _run(self) -> None:
        while not self._stop.is_set():
            self._wake.wait()
            self._wake.clear()
            for name in tuple(self._dragged):
                placed = self._dragged.pop(name, None)
                if placed is not None:
                    self._do(name, placed)
            self._stop.wait(1.0 / RATE)


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
        self._added = NOTHING
        self._names: dict[str, str] = {}
        self._poses: Floats = np.zeros((0, 12))
        gui, zero, icon = self.gui, (0.0, 0.0, 0.0), viser.Icon

        def name(_: viser.GuiEvent) -> None:
            self._names[self._choice.value] = self._name.value.strip()

        self._choice = gui.add_dropdown("Object", (NOTHING,))
        on_page(self._choice, lambda _: self._choose(self._choice.value))
        add = gui.add_button("Add a box", icon=icon.CUBE_PLUS)
        add.on_click(lambda event: attempt(event, self._add))
        with gui.add_folder("Place and size"):
            self._place = gui.add_vector3("Place [m]", zero, step=GRAIN)
            self._turn = gui.add_vector3("Turn [°]", zero, step=1.0)
            self._size = gui.add_vector3(
                "Edges [m]", (2.0 * HALF,) * 3, min=(GRAIN,) * 3, step=GRAIN
            )
            self._name = on_page(gui.add_text("In the file", ""), name)
        for box in (self._place, self._turn, self._size):
            on_page(box, lambda _: self._typed())
        on_click(gui.add_button("Remove", icon=icon.TRASH), self._remove)
        on_click(gui.add_button("Undo", icon=icon.ARROW_BACK_UP), editor.undo)
        write = gui.add_button("Write to the scene file …", icon=icon.FILE_DIFF)
        write.on_click(lambda event: attempt(event, lambda: self._show_diff(event)))

    def _draw(self, cycle: Cycle) -> None:
        self._poses = cycle.frame.poses
        movable, name = (NOTHING, *self._editor.movable), self._choice.value
        if self._added in movable:
            self._added = NOTHING
        else:
            # The service has placed it; the recording shows it a few cycles later.
            movable = (*movable, self._added)
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
        if name is None:
            return
        taken = {*self.world.scene.body_names(), *self._names.values()}
        fresh = next(f"wall_{k}" for k in range(1, 1000) if f"wall_{k}" not in taken)
        self._names.setdefault(name, fresh)
        self._added = name
        self._choice.options = tuple(dict.fromkeys((*self._choice.options, name)))
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
                "this scene has no file that may be written; start the service with "
                "your own scene file"
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
    """Do something; show the person in the page why it cannot be done."""
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
    """A diff as HTML; its own markup has no effect."""
    lines = [
        f'<div style="background:{COLOURS.get(line[:1], "none")}">'
        f"{html.escape(line) or '&nbsp;'}</div>"
        for line in diff.splitlines()
    ]
    style = "font: 12px/1.5 monospace; white-space: pre-wrap; overflow-x: auto"
    return f'<div style="{style}">{"".join(lines)}</div>'
