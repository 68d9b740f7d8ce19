"""The view of a map: robots on its schedule, or where a diagram is dragged to."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import joints_of
from armguard.maps.coordination import CoordinationMap
from armguard.maps.diagram import Diagram, Grid
from armguard.maps.picture import DEADLOCK, WORDS, roomiest
from armguard.maps.schedule import Schedule
from armguard.prove.tile_search import FREE
from armguard.recording.frames import Frame, Kind
from armguard.recording.recorded import judged
from armguard.scene.scene import Scene
from armguard.view.planned_view import RATE, guard_of
from armguard.view.recorded_view import RecordedView

Floats = NDArray[np.float64]

# Label of free cells from which the ends of both plans cannot be reached.
LOCKED = 1 + max(FREE, *WORDS)

# Words and colours of the cells that are not free, or not for long.
KINDS = {LOCKED: ("no way out", DEADLOCK), **WORDS}

# Of several labels that become one on the page the one of the highest rank remains;
# the rank of a rank is the label again.
RANK = np.array([0, 3, 2, 1], dtype=np.uint8)

# A diagram on the page has so many cells along an axis at most.
CELLS = 250


class MappedView(RecordedView):
    """Shows the schedule of a map on a time line, and its diagrams beside the robots.

    Dragging along a diagram moves both of its robots to those times of their plans.

    Args:
        scene: The scene.
        cell: The map.
        schedule: Its schedule; None if there is none.
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self,
        scene: Scene,
        cell: CoordinationMap,
        schedule: Schedule | None,
        page_port: int = 8080,
    ) -> None:
        self._cell, self._schedule, self._scene = cell, schedule, scene
        self._guard = guard_of(scene)
        self._labels = [labels_of(cell, diagram) for diagram in cell.diagrams]
        # Times of the plans that a diagram was dragged to, and the cycle there.
        self._dragged: dict[str, float] | None = None
        self._still: tuple[dict[str, float], Frame] | None = None
        end = 0.0 if schedule is None else schedule.makespan
        times = np.append(np.arange(0.0, end, 1.0 / RATE), end)
        q = self._motion([self._scheduled(time) for time in times.tolist()])
        self._clock = end
        super().__init__(scene, self._cycles(q, times), page_port)
        self.source.go(0.0)
        shown = zip(cell.diagrams, self._labels, strict=True)
        self.page.publish("diagrams", {"each": [self._diagram(*one) for one in shown]})

    def step(self) -> None:
        """Draw the robots where a diagram was dragged to, else on the schedule."""
        dragged = self._dragged
        if dragged is None:
            super().step()
            return
        if self._still is None or self._still[0] != dragged:
            self._clock += 1.0 / RATE
            found = self._cycles(self._motion([dragged]), np.array([self._clock]))
            self._still = dragged, found[-1]
            self.plot.fill([self.world.cycle(found[-1])])
            self._plotted = -inf
        frame = self._still[1]
        self.draw(frame)
        self.place = self.where()
        self.publish(frame, recorded=self.when(frame))

    def when(self, frame: Frame) -> str:
        """Where robots are on their plans, and whether they may be there together."""
        places = self.places()
        at = ", ".join(f"{robot} at {time:.2f} s" for robot, time in places.items())
        each = zip(self._cell.diagrams, self._labels, strict=True)
        return f"{at} of their plans: " + "; ".join(state_of(*e, places) for e in each)

    def where(self) -> dict[str, Any]:
        """Position on the time line, and the time on the plan of each robot."""
        return {**super().where(), "places": self.places()}

    def places(self) -> dict[str, float]:
        """Time on the plan of each robot [s]."""
        return dict(self._dragged or self._scheduled(self.source.position))

    def _scheduled(self, time: float) -> dict[str, float]:
        """The same at a time of the schedule; begins of plans if there is none [s]."""
        if self._schedule is None:
            return {n: float(p.plan.tube.times[0]) for n, p in self._cell.plans.items()}
        at = self._schedule.at(time).tolist()
        return dict(zip(self._schedule.robots, at, strict=True))

    def _received(self, page: str, message: Mapping[str, Any]) -> None:
        """Take a place that a diagram is dragged to, or a message of the time line."""
        if message["type"] != "place":
            if message["type"] in ("play", "seek"):
                self._dragged = None
            super()._received(page, message)
            return
        places = self.places()
        for robot, time in message["places"].items():
            times = self._cell.plans[robot].plan.tube.times
            if not isfinite(time):
                raise ValueError(f"{time} is no time of a plan")
            places[robot] = float(np.clip(time, times[0], times[-1]))
        self.source.play(False)
        self._dragged = places

    def _motion(self, places: Sequence[Mapping[str, float]]) -> Floats:
        """Joint positions at times of the plans, shape (k, n) [rad or m]."""
        q = np.tile(self._scene.home, (len(places), 1))
        for robot, one in self._cell.plans.items():
            own = joints_of(self._scene.q_names, robot)
            times = np.array([each[robot] for each in places])
            q[:, own] = one.plan.tube.at(times)[:, own]
        return q

    def _cycles(self, q: Floats, times: Floats) -> list[Frame]:
        """Cycles of the guard; robots rest behind the last row."""
        speeds = None
        if any(part.mode != "fixed" for part in self._guard.tables.robots):
            speeds = np.diff(q, axis=0, append=q[-1:]) * RATE
        found = judged(self._guard, q, times, speeds)
        return [frame for frame in found if frame.kind is Kind.CYCLE]

    def _diagram(self, diagram: Diagram, labels: Grid) -> dict[str, Any]:
        """A diagram for the page."""
        every = -(-max(labels.shape) // CELLS)
        size, step = np.array(labels.shape), every * diagram.step
        way = np.zeros((0, 2))
        if self._schedule is not None:
            own = [self._schedule.robots.index(robot) for robot in diagram.robots]
            way = self._schedule.plan_times[:, own]
        words = []
        for label, (word, _) in KINDS.items():
            place, has_room = roomiest(labels == label, len(word))
            if has_room:
                words.append([word, *(place / size).tolist()])
        cells = coarser(labels, every)
        segments = (self._cell.segments[robot] for robot in diagram.robots)
        return {
            "robots": diagram.robots,
            "starts": diagram.starts,
            "durations": diagram.durations,
            "step": step,
            "shape": cells.shape,
            "cells": b64encode(cells.tobytes()).decode(),
            "colours": {str(label): colour for label, (_, colour) in KINDS.items()},
            "words": words,
            "way": way.round(3).tolist(),
            "segments": [[[s.name, s.start] for s in own] for own in segments],
        }


def labels_of(cell: CoordinationMap, diagram: Diagram) -> Grid:
    """Labels of a diagram, and LOCKED."""
    return np.where(cell.deadlocks(diagram), np.uint8(LOCKED), diagram.labels)


def coarser(labels: Grid, every: int) -> Grid:
    """One label for so many along each axis; the last ones are repeated."""
    pad = [(0, -size % every) for size in labels.shape]
    ranks = np.pad(RANK[labels], pad, mode="edge")
    k, m = (size // every for size in ranks.shape)
    return np.asarray(RANK[ranks.reshape(k, every, m, every).max(axis=(1, 3))])


def state_of(diagram: Diagram, labels: Grid, places: Mapping[str, float]) -> str:
    """Whether two robots may be at times of their plans together, in words."""
    times = np.array([places[robot] for robot in diagram.robots])
    cell = ((times - diagram.starts) / diagram.step).astype(int)
    i, j = np.minimum(cell, np.array(labels.shape) - 1).tolist()
    if labels[i, j] in (FREE, LOCKED):
        locked = ", but there is no way out" if labels[i, j] == LOCKED else ""
        return f"{' and '.join(diagram.robots)} may be there together{locked}"
    word = KINDS[int(labels[i, j])][0]
    return f"{word}: {' and '.join(diagram.pair_at((i, j)))} may be too near"
