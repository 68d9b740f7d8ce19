"""Objects that somebody at the page moves, and how to take that back."""

import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box
from armguard.scene.tables import SceneTables
from armguard.station.view.editing.scene_text import Entry
from armguard.station.view.placements import Placements

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

# Calls while somebody drags, a second at most.
RATE = 10.0

Call = Callable[..., bool]


@dataclass(frozen=True, slots=True)
class State:
    """How an object stands.

    Attributes:
        T: Its frame in the world, shape (4, 4).
        half: Half extents, of a box that was held ready; else None [m].
    """

    T: Floats
    half: Triple | None = None


class Editor:
    """Places and removes objects in the loop, at once; remembers how it was.

    Attributes:
        spare: Names of the boxes the scene holds ready for what was not foreseen.

    Args:
        tables: The scene.
        placements: Where objects stand, as frames tell.
        call: Calls the service; whether it was done.
        changeable: Names of the objects that the page may change.
    """

    def __init__(
        self,
        tables: SceneTables,
        placements: Placements,
        call: Call,
        *,
        changeable: Collection[str],
    ) -> None:
        self._tables, self._placements, self._call = tables, placements, call
        self._changeable = changeable
        self.spare = tuple(
            name
            for name, thing in tables.standing.items()
            if not thing.present
            and thing.body < 0
            and not thing.surfaces
            and len(thing.shapes) == 1
            and isinstance(thing.shapes[0].shape, Box)
        )
        self._before: list[tuple[str, State | None]] = []
        self._began: dict[str, State | None] = {}
        self._dragged: dict[str, State] = {}
        self._wake, self._stop = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="edit", daemon=True)
        self._thread.start()

    @property
    def movable(self) -> tuple[str, ...]:
        """Objects that stand somewhere, are attached to nothing, and may be changed."""
        standing = self._tables.standing
        return tuple(
            name
            for name, T in self._placements.poses.items()
            if T is not None and standing[name].body < 0 and name in self._changeable
        )

    def state(self, name: str) -> State | None:
        """How an object stands; None if it is not there."""
        T = self._placements.poses[name]
        if T is None:
            return None
        if name not in self.spare:
            return State(T)
        return State(T, self._half(name))

    def add(self, half: Triple, T: Floats) -> str:
        """Put up a box that was held ready; its name in the loop.

        Raises:
            SceneError: None is left.
        """
        free = [n for n in self.spare if self._placements.poses[n] is None]
        if not free:
            raise SceneError(
                "the service holds no box ready any more; remove one, or write these "
                "to the scene file and start the service again"
            )
        self.put(free[0], State(T, half))
        return free[0]

    def put(self, name: str, state: State | None) -> bool:
        """Have an object stand somewhere, or not at all; can be undone."""
        before = self.state(name)
        if not self._do(name, state):
            return False
        self._began.setdefault(name, before)
        self._before.append((name, before))
        return True

    def drag(self, name: str, state: State, begins: bool) -> None:
        """The same for somebody who drags: the newest place counts, others are left."""
        if begins or name not in self._dragged:
            before = self.state(name)
            self._began.setdefault(name, before)
            if begins:
                self._before.append((name, before))
        self._dragged[name] = state
        self._wake.set()

    def undo(self) -> str | None:
        """Take the last change back; the name of what was changed, None of nothing."""
        if not self._before:
            return None
        name, state = self._before.pop()
        self._dragged.pop(name, None)
        self._do(name, state)
        return name

    def changes(self, names: Mapping[str, str]) -> dict[str, Entry | None]:
        """What is otherwise than when the view began, for the scene file.

        Args:
            names: Names that boxes held ready are to have in the file.
        """
        found: dict[str, Entry | None] = {}
        for name, began in self._began.items():
            now = self.state(name)
            spare = name in self.spare
            if spare and now is None:
                continue
            if now is None:
                found[name] = None
            elif began is None or not np.allclose(began.T, now.T) or spare:
                size = None
                if now.half is not None:
                    x, y, z = now.half
                    size = (2.0 * x, 2.0 * y, 2.0 * z)
                key = names.get(name, name) if spare else name
                found[key] = Entry(Pose.from_matrix(now.T), size)
        return found

    def close(self) -> None:
        """Change nothing any more."""
        self._stop.set()
        self._wake.set()
        self._thread.join(timeout=1.0)

    def _half(self, name: str) -> Triple:
        """Half extents that a box which was held ready has now [m]."""
        foreseen = self._tables.standing[name].shapes[0].shape
        shape = self._placements.shapes.get(name, foreseen)
        assert isinstance(shape, Box)
        return shape.half_extents

    def _do(self, name: str, state: State | None) -> bool:
        if state is None:
            return self._call("remove", name=name)
        arguments: dict[str, Any] = {"name": name, "pose": state.T.tolist()}
        if state.half is not None and state.half != self._half(name):
            arguments["shape"] = {"kind": "box", "half_extents": list(state.half)}
        return self._call("place", **arguments)

    def _run(self) -> None:
        while not self._stop.is_set():
            self._wake.wait()
            self._wake.clear()
            for name in tuple(self._dragged):
                state = self._dragged.pop(name, None)
                if state is not None:
                    self._do(name, state)
            self._stop.wait(1.0 / RATE)
