"""Charts beside the robots: dragging along one moves the robots to that place."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.maps.diagram import Grid
from armguard.maps.picture import DEADLOCK, WORDS, roomiest
from armguard.prove.tile_search import FREE
from armguard.recording.frames import Frame, Kind
from armguard.recording.recorded import judged
from armguard.scene.scene import Scene
from armguard.view.planned_view import RATE, guard_of
from armguard.view.recorded_view import RecordedView

Floats = NDArray[np.float64]

# Where the robots are, by the names of axes: time of a plan [s], position of a joint
# [rad or m].
Places = Mapping[str, float]

# Label of free cells from which the ends of both plans cannot be reached.
LOCKED = 1 + max(FREE, *WORDS)

# Words and colours of the cells that are not free, or not for long.
KINDS = {LOCKED: ("no way out", DEADLOCK), **WORDS}

# Of several labels that become one on the page the one of the highest rank remains;
# the rank of a rank is the label again.
RANK = np.array([0, 3, 2, 1], dtype=np.uint8)

# A chart on the page has so many cells along an axis at most.
CELLS = 250


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """What is known at every place of two axes.

    Attributes:
        axes: Names of both axes.
        titles: Both in words, with their units.
        lower: Where the axes begin.
        upper: Where they end.
        step: Side of a cell.
        labels: FREE, a key of `KINDS` otherwise, of each cell, shape (k, m).
        way: Places of a schedule, shape (n, 2).
        segments: Named parts of both axes, each with where it begins.
    """

    axes: tuple[str, str]
    titles: tuple[str, str]
    lower: tuple[float, float]
    upper: tuple[float, float]
    step: float
    labels: Grid
    way: Floats
    segments: tuple[Sequence[tuple[str, float]], Sequence[tuple[str, float]]]

    def cell(self, places: Places) -> tuple[int, int]:
        """The cell of a place."""
        at = np.array([places[axis] for axis in self.axes]) - self.lower
        last = np.array(self.labels.shape) - 1
        i, j = np.minimum((at / self.step).astype(int), last).tolist()
        return i, j

    def message(self) -> dict[str, Any]:
        """The chart for the page."""
        every = -(-max(self.labels.shape) // CELLS)
        cells, words = coarser(self.labels, every), []
        for label, (word, _) in KINDS.items():
            place, has_room = roomiest(self.labels == label, len(word))
            if has_room:
                words.append([word, *(place / self.labels.shape).tolist()])
        return {
            "axes": self.axes,
            "titles": self.titles,
            "lower": self.lower,
            "upper": self.upper,
            "step": every * self.step,
            "shape": cells.shape,
            "cells": b64encode(cells.tobytes()).decode(),
            "colours": {str(label): colour for label, (_, colour) in KINDS.items()},
            "words": words,
            "way": self.way.round(3).tolist(),
            "segments": self.segments,
        }


class ChartView(RecordedView):
    """Shows robots on a time line, or where a chart was dragged to.

    Attributes:
        charts: The charts.

    Args:
        scene: The scene.
        charts: See the attribute.
        length: Length of the time line [s].
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self, scene: Scene, charts: Sequence[Chart], length: float, page_port: int
    ) -> None:
        self.charts, self._guard, self._clock = charts, guard_of(scene), length
        self._ends: dict[str, tuple[float, float]] = {}
        for one in charts:
            ends = zip(one.lower, one.upper, strict=True)
            self._ends |= dict(zip(one.axes, ends, strict=True))
        # Where a chart was dragged to, and the cycle there.
        self._dragged: Places | None = None
        self._still: tuple[Places, Frame] | None = None
        times = np.append(np.arange(0.0, length, 1.0 / RATE), length)
        q = self.rows([self.planned(time) for time in times.tolist()])
        super().__init__(scene, self._cycles(q, times), page_port)
        self.source.go(0.0)
        self.page.publish("charts", {"charts": [one.message() for one in charts]})

    def planned(self, time: float) -> Places:
        """Where the robots are at a time of the time line [s]."""
        raise NotImplementedError

    def rows(self, places: Sequence[Places]) -> Floats:
        """Joint positions of all robots there, shape (k, n) [rad or m]."""
        raise NotImplementedError

    def step(self) -> None:
        """Draw the robots where a chart was dragged to, else on the time line."""
        dragged = self._dragged
        if dragged is None:
            super().step()
            return
        if self._still is None or self._still[0] != dragged:
            self._clock += 1.0 / RATE
            found = self._cycles(self.rows([dragged]), np.array([self._clock]))
            self._still = dragged, found[-1]
            self.plot.fill([self.world.cycle(found[-1])])
            self._plotted = -inf
        frame = self._still[1]
        self.draw(frame)
        self.place = self.where()
        self.publish(frame, recorded=self.when(frame))

    def where(self) -> dict[str, Any]:
        """Position on the time line, and on the axes."""
        return {**super().where(), "places": self.places()}

    def places(self) -> dict[str, float]:
        """Where the robots are now."""
        return dict(self._dragged or self.planned(self.source.position))

    def _received(self, page: str, message: Mapping[str, Any]) -> None:
        """Take a place that a chart is dragged to, or a message of the time line."""
        if message["type"] != "place":
            if message["type"] in ("play", "seek"):
                self._dragged = None
            super()._received(page, message)
            return
        places = self.places()
        for axis, at in message["places"].items():
            if not isfinite(at):
                raise ValueError(f"{at} is no place of '{axis}'")
            places[axis] = float(np.clip(at, *self._ends[axis]))
        self.source.play(False)
        self._dragged = places

    def _cycles(self, q: Floats, times: Floats) -> list[Frame]:
        """Cycles of the guard; robots rest behind the last row."""
        speeds = None
        if any(part.mode != "fixed" for part in self._guard.tables.robots):
            speeds = np.diff(q, axis=0, append=q[-1:]) * RATE
        found = judged(self._guard, q, times, speeds)
        return [frame for frame in found if frame.kind is Kind.CYCLE]


def coarser(labels: Grid, every: int) -> Grid:
    """One label for so many along each axis; the last ones are repeated."""
    pad = [(0, -size % every) for size in labels.shape]
    ranks = np.pad(RANK[labels], pad, mode="edge")
    k, m = (size // every for size in ranks.shape)
    return np.asarray(RANK[ranks.reshape(k, every, m, every).max(axis=(1, 3))])
