"""Objects that are moved, added and removed from the page, and how to undo that."""

import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box
from armguard.scene.file_edit import Entry
from armguard.station.view.world import World

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

# Calls during a drag, a second at most.
RATE = 10.0

# Half edge of a box that was just added [m].
HALF = 0.1


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

    def add(self, T: Floats) -> str:
        """Place a reserved box; its name in the loop.

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
        self.put(free[0], Placed(T, (HALF,) * 3))
        return free[0]

    def put(self, name: str, placed: Placed | None) -> None:
        """Place an object, or remove it; can be undone."""
        before = self.placed(name)
        if self._do(name, placed):
            self._began.setdefault(name, before)
            self._undo.append((name, before))

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
            arguments["shape"] = {"kind": "box", "half_extents": list(placed.half)}
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
