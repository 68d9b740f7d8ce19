"""The views of a map and of a slice: what is free, and the robots there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import joints_of
from armguard.maps.coordination import CoordinationMap
from armguard.maps.diagram import Diagram
from armguard.maps.schedule import Schedule
from armguard.maps.slices import Slice
from armguard.prove.tile_search import FREE
from armguard.recording.frames import Frame
from armguard.scene.scene import Scene
from armguard.view.charts import KINDS, LOCKED, Chart, ChartView, Places

Floats = NDArray[np.float64]


class MappedView(ChartView):
    """Shows the schedule of a map on a time line, and its diagrams.

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
        charts = [chart_of(cell, one, schedule) for one in cell.diagrams]
        length = 0.0 if schedule is None else schedule.makespan
        super().__init__(scene, charts, length, page_port)

    def planned(self, time: float) -> Places:
        """Time on the plan of each robot; where it begins without a schedule [s]."""
        if self._schedule is None:
            return {n: float(p.plan.tube.times[0]) for n, p in self._cell.plans.items()}
        at = self._schedule.at(time).tolist()
        return dict(zip(self._schedule.robots, at, strict=True))

    def rows(self, places: Sequence[Places]) -> Floats:
        """Joint positions at times of the plans, shape (k, n) [rad or m]."""
        q = np.tile(self._scene.home, (len(places), 1))
        for robot, one in self._cell.plans.items():
            own = joints_of(self._scene.q_names, robot)
            times = np.array([each[robot] for each in places])
            q[:, own] = one.plan.tube.at(times)[:, own]
        return q

    def when(self, frame: Frame) -> str:
        """Where robots are on their plans, and whether they may be there together."""
        places = self.places()
        at = ", ".join(f"{robot} at {time:.2f} s" for robot, time in places.items())
        each = zip(self.charts, self._cell.diagrams, strict=True)
        return f"{at} of their plans: " + "; ".join(
            state_of(chart, diagram, places) for chart, diagram in each
        )


class SlicedView(ChartView):
    """Shows a slice of configurations; dragging along it moves both joints.

    Args:
        scene: The scene.
        found: The slice.
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(self, scene: Scene, found: Slice, page_port: int = 8080) -> None:
        self._slice, self._home = found, scene.home
        self._columns = [scene.q_names.index(joint) for joint in found.joints]
        titles = [f"{j} [{u}]" for j, u in zip(found.joints, found.units, strict=True)]
        chart = Chart(
            axes=found.joints,
            titles=(titles[0], titles[1]),
            lower=found.lower,
            upper=found.upper,
            step=found.step,
            labels=found.labels,
            way=np.zeros((0, 2)),
            segments=((), ()),
        )
        super().__init__(scene, [chart], 0.0, page_port)

    def planned(self, time: float) -> Places:
        """Both joints at home [rad or m]."""
        at = self._home[self._columns].tolist()
        return dict(zip(self._slice.joints, at, strict=True))

    def rows(self, places: Sequence[Places]) -> Floats:
        """Joint positions, all other joints at home, shape (k, n) [rad or m]."""
        q = np.tile(self._home, (len(places), 1))
        for column, joint in zip(self._columns, self._slice.joints, strict=True):
            q[:, column] = [each[joint] for each in places]
        return q

    def when(self, frame: Frame) -> str:
        """Where both joints are, and whether the robot may be there."""
        places, units = self.places(), self._slice.units
        each = zip(places.items(), units, strict=True)
        at = ", ".join(f"{joint} at {q:.3f} {unit}" for (joint, q), unit in each)
        label = int(self._slice.labels[self.charts[0].cell(places)])
        state = "free" if label == FREE else KINDS[label][0]
        return f"{at}, {self._slice.others}: {state}"


def chart_of(
    cell: CoordinationMap, diagram: Diagram, schedule: Schedule | None
) -> Chart:
    """A diagram as a chart; places in a deadlock are LOCKED."""
    way = np.zeros((0, 2))
    if schedule is not None:
        own = [schedule.robots.index(robot) for robot in diagram.robots]
        way = schedule.plan_times[:, own]
    (a, b), (start, begin) = diagram.robots, diagram.starts
    one, other = ([(s.name, s.start) for s in cell.segments[r]] for r in (a, b))
    return Chart(
        axes=(a, b),
        titles=(f"time of {a}'s plan [s]", f"time of {b}'s plan [s]"),
        lower=diagram.starts,
        upper=(start + diagram.durations[0], begin + diagram.durations[1]),
        step=diagram.step,
        labels=np.where(cell.deadlocks(diagram), np.uint8(LOCKED), diagram.labels),
        way=way,
        segments=(one, other),
    )


def state_of(chart: Chart, diagram: Diagram, places: Places) -> str:
    """Whether two robots may be at times of their plans together, in words."""
    at = chart.cell(places)
    label = int(chart.labels[at])
    if label in (FREE, LOCKED):
        locked = ", but there is no way out" if label == LOCKED else ""
        return f"{' and '.join(chart.axes)} may be there together{locked}"
    return f"{KINDS[label][0]}: {' and '.join(diagram.pair_at(at))} may be too near"
