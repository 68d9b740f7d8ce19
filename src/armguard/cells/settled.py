"""Claims that follow from frames: cells are settled, sent, withdrawn and forgotten."""

from collections import deque
from collections.abc import Iterator
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.arrival import expire_words, raise_arrivals
from armguard.cells.deltas import Delta, take_deltas
from armguard.cells.evidence import settle, withdraw, withdraw_all
from armguard.cells.forgetting import forget_cells
from armguard.cells.given import check_frame, check_size, check_source, rays_of
from armguard.cells.state import (
    ARRIVAL_SIDE,
    EVERY_MEMBER,
    NO_SENSOR,
    Words,
    empty_evidence,
    empty_look,
)
from armguard.cells.view import CellView, arrays_of
from armguard.errors import CellMapError
from armguard.record import Records, records
from armguard.table import IntVector, Ledger

Floats = NDArray[np.float64]

# Frames of a sensor of which the passed cells are kept, for `withdraw`.
KEPT_FRAMES = 4


class SettledCells(CellView):
    """A view whose claims follow from the frames of a `CellMap`.

    Attributes:
        intruder_speed: See `CellMap`.
        settles: See `CellMap`.
        evidence: State: see `armguard.cells.state.Evidence`.

    Args:
        centre: See `CellMap`.
        cell: See `CellMap`.
        size: See `CellMap`.
        intruder_speed: See `CellMap`.
        settles: See `CellMap`.

    Raises:
        CellMapError: A number is out of its range.
    """

    def __init__(
        self, centre: ArrayLike, cell: float, size: int, *,
        intruder_speed: float | None, settles: float,
    ) -> None:  # fmt: skip
        super().__init__(centre, cell, size)
        check_size("intruder_speed", intruder_speed or 0.0, "m/s")
        check_size("settles", settles, "s")
        self.intruder_speed, self.settles = intruder_speed, float(settles)
        words = len(self.claims.stamp)
        blocks = 0 if intruder_speed is None else words // 8
        self.evidence = empty_evidence(words, blocks)
        self._look = empty_look(self.claims.lattice, words, blocks)
        self._evidence, self._frame = Ledger(self.evidence), Ledger(self._look)
        self._passed: dict[int, deque[tuple[IntVector, Words]]] = {}

    def take_deltas(self, most: int = 512) -> Records[Delta]:
        """Changes since they were last taken, for `CellView.apply`.

        Words with new occupied cells come first. Once none is left, a view that took
        all of them has the cells of this map to the bit.

        Args:
            most: Greatest count of changes.
        """
        out = records(most, Delta)
        count = take_deltas(self._claims.lines, self._evidence.lines, out)
        changes: Records[Delta] = out[:count]
        return changes

    def arrivals(self) -> Floats:
        """Time before which nothing can be in each block of 8³ cells.

        Returns:
            Shape (size / 8,) · 3, by x, y, z; minus infinity where something may be at
            any time [s].

        Raises:
            CellMapError: The map has no intruder speed.
        """
        if self.intruder_speed is None:
            raise CellMapError("a map without intruder_speed has no arrival times")
        side = self.size // ARRIVAL_SIDE
        return self.evidence.arrival.reshape((side,) * 3).transpose().copy()

    def expire(self, stamp: float) -> None:
        """Forget known free cells into which an intruder may have come by a time.

        A block of 8³ cells that no frame has wholly seen free is forgotten too.

        Args:
            stamp: The time, at which all claims hold then [s].

        Raises:
            CellMapError: The map has no intruder speed, or the stamp is not finite.
        """
        if self.intruder_speed is None:
            raise CellMapError("a map without intruder_speed forgets nothing")
        check_frame(stamp, inf, 0.0)
        lines = self._frame.lines, self._evidence.lines, self._claims.lines
        expire_words(float(stamp), *lines)

    def forget(self, middle: ArrayLike, radius: float, stamp: float) -> None:
        """Forget known free cells of a ball: something is in it, at no known place.

        Args:
            middle: Middle of the ball, world, shape (3,) [m].
            radius: Its radius [m].
            stamp: When something was in it; cells that were seen later stay [s].

        Raises:
            CellMapError: A number is negative or not finite.
        """
        check_frame(stamp, inf, radius)
        _, ball = rays_of(np.zeros((0, 3)), middle)
        lines = self._evidence.lines, self._claims.lines
        forget_cells(ball, float(radius), float(stamp), *lines)

    def withdraw(self, source: int, *, all_frames: bool = False) -> None:
        """Make the cells unknown again that a sensor has freed.

        Those of its last four frames, but for words that another sensor has wholly
        looked at since: what the sensor saw before stays. Or all words that it was the
        last to look at, or one of the last. Cells of own links, see `own`, keep what
        they have.

        Args:
            source: Number that was given to `depth`, 1 to 254.
            all_frames: Whether all of its frames count.

        Raises:
            CellMapError: It is no such number.
        """
        check_source(source)
        lines = self._frame.lines, self._evidence.lines, self._claims.lines
        for words, passes in self._passed.pop(source, ()):
            withdraw(int(source), words, passes, *lines)
        if all_frames:
            withdraw_all(int(source), *lines)

    def apply(self, deltas: Records[Delta]) -> None:
        """Take over changes of another map, see `CellView.apply`."""
        super().apply(deltas)
        self._look.opened[:] = EVERY_MEMBER

    def restore(self, data: bytes) -> None:
        """Continue from a checkpoint of another map, see `CellView.restore`."""
        super().restore(data)
        self._look.opened[:] = EVERY_MEMBER

    def _arrays(self) -> Iterator[NDArray[Any]]:
        """Arrays of the state; the first one is the lattice."""
        yield from super()._arrays()
        yield from arrays_of(self.evidence)

    def _settle(self, stamp: float, error: float, source: int = NO_SENSOR) -> None:
        """Turn a frame into claims."""
        if source != NO_SENSOR:
            check_source(source)
            notes: Any = self._look.notes
            words = self._look.touched[: int(notes["touched"])].copy()
            kept = self._passed.setdefault(source, deque(maxlen=KEPT_FRAMES))
            kept.append((words, self._look.passes[words]))
        # Rounded up: a claim must not be better than its pose.
        above = np.nextafter(np.float32(error), np.float32(inf))
        settle(
            float(stamp), float(above if error > 0.0 else 0.0), self.settles, source,
            self._frame.lines, self._evidence.lines, self._claims.lines,
        )  # fmt: skip
        if self.intruder_speed is not None:
            edge = ARRIVAL_SIDE * self.cell
            edge_time = edge / self.intruder_speed if self.intruder_speed else inf
            raise_arrivals(
                float(stamp), edge_time, self._frame.lines, self._evidence.lines
            )
