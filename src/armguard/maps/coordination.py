"""Maps of cells: plans of two or more robots that share a space."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.maps.cell_plan import CellPlan, CoordinationError, Segment
from armguard.maps.diagram import FINEST, Diagram, DiagramMaker
from armguard.maps.execution import Execution, executed
from armguard.maps.interlocks import Axis, Interlock, PairOfPlans
from armguard.maps.schedule import Grids, Schedule, quickest_schedule
from armguard.maps.ways import crosses, steps_from_start, steps_to_end
from armguard.plans.plan import Plan
from armguard.plans.verify import RESOLUTION
from armguard.prove.paving import NearInterval, Paver
from armguard.prove.tile_search import FREE, LABEL
from armguard.prove.tube import Tube
from armguard.scene import Scene, Trajectory
from armguard.scene.compile import compile_scene
from armguard.scene.restricted import WORLD, restricted, riders
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Nodes = NDArray[np.intp]

# A schedule may take so much longer if it needs fewer waits [-].
SLACK = 0.05


class LookUp:
    """Answers whether two plans may be at two times together.

    Args:
        diagram: Their diagram.
    """

    __slots__ = ("_first", "_free", "_last", "_per_second", "_rows")

    def __init__(self, diagram: Diagram) -> None:
        free = np.pad(~diagram.blocked, ((0, 1), (0, 1)), mode="edge")
        self._free: bytes = free.tobytes()
        self._rows: int = free.shape[1]
        self._first = diagram.starts
        self._last = tuple(
            start + time
            for start, time in zip(diagram.starts, diagram.durations, strict=True)
        )
        self._per_second = 1.0 / diagram.step

    def __call__(self, one: float, other: float) -> bool:
        """Whether every pair of both robots keeps its buffer; False outside."""
        first, second = self._first
        end, last = self._last
        if not (first <= one <= end and second <= other <= last):
            return False
        at = int((one - first) * self._per_second) * self._rows
        return self._free[at + int((other - second) * self._per_second)] == 1


@dataclass(frozen=True, slots=True, eq=False)
class CoordinationMap:
    """Which parts of robots' plans may be executed together.

    Attributes:
        robots: The robots, in the order in which they were given.
        plans: What each executes.
        segments: Named parts of each robot's plan.
        diagrams: Of every two robots.
        alone: Intervals of each plan in which links of its robot may be too near each
            other or the still world; no diagram has them.
        allowed: For two robots, `allowed(a, b)` says whether they may be at those times
            of their plans together, with all errors.
    """

    robots: tuple[str, ...]
    plans: dict[str, CellPlan]
    segments: dict[str, tuple[Segment, ...]]
    diagrams: tuple[Diagram, ...]
    alone: dict[str, tuple[NearInterval, ...]]
    allowed: LookUp = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "allowed", LookUp(self.diagrams[0]))

    @property
    def free(self) -> float:
        """Share of the diagrams that is free [-]."""
        return float(np.mean([one.free for one in self.diagrams]))

    @property
    def touching(self) -> float:
        """Share of the diagrams in which two robots are too near [-]."""
        return float(np.mean([one.touching for one in self.diagrams]))

    @property
    def unknown(self) -> float:
        """Share of the diagrams in which neither is proven; it counts as too near."""
        return float(np.mean([one.unknown for one in self.diagrams]))

    def deadlocks(self, diagram: Diagram) -> NDArray[np.bool_]:
        """Cells that can be reached, but from which the ends cannot, shape (k, m)."""
        blocked = diagram.blocked
        enter = steps_from_start(blocked)[:-1, :-1] < inf
        leave = steps_to_end(blocked)[1:, 1:] < inf
        return np.asarray(~blocked & enter & ~leave)

    def schedule(self) -> Schedule:
        """The quickest schedule; of robots with a higher priority, they wait least.

        Raises:
            CoordinationError: There is no way, and what blocks it.
        """
        priorities = tuple(self.plans[name].priority for name in self.robots)
        return quickest_schedule(self.diagrams, self.robots, priorities)

    def interlocks(
        self, schedule: Schedule | None = None, *, slack: float = SLACK
    ) -> tuple[Interlock, ...]:
        """The fewest waits that keep the robots apart at any pace.

        Args:
            schedule: The schedule that they allow; the quickest by default.
            slack: How much longer two robots may take if that needs fewer waits, or
                waits at the ends of segments, as a share of the time; three and more
                keep to the schedule [-].

        Raises:
            CoordinationError: There is no schedule.
        """
        schedule = self.schedule() if schedule is None else schedule
        grids, axes = Grids(self.diagrams, self.robots), self._axes()
        most = (1.0 + slack) * (len(schedule.nodes) - 1)
        found = list[Interlock]()
        for r, s in combinations(range(len(self.robots)), 2):
            way = schedule.nodes[:, [r, s]]

            def accepts(blocked: NDArray[np.bool_], way: Nodes = way) -> bool:
                if not crosses(way, blocked):
                    return True
                return len(self.robots) == 2 and steps_to_end(blocked)[0, 0] <= most

            pair = PairOfPlans(axes[r], axes[s], grids.blocked(r, s), way, accepts)
            found += pair.interlocks()
        return tuple(sorted(found, key=lambda one: (one.waiting.robot, one.at)))

    def execute(self, interlocks: Sequence[Interlock], **given: Any) -> Execution:
        """Execute the plans as a cell controller does, see `executed`."""
        spans = {axis.robot: (axis.start, axis.end) for axis in self._axes()}
        return executed(interlocks, spans, **given)

    @property
    def one_after_another(self) -> float:
        """How long the plans take if only one robot moves at a time [s]."""
        return sum(plan.plan.duration for plan in self.plans.values())

    @property
    def without_interference(self) -> float:
        """How long the longest plan takes by itself [s]."""
        return max(plan.plan.duration for plan in self.plans.values())

    @property
    def sentence(self) -> str:
        """The map in one sentence; a second one for what plans do by themselves."""
        parts = [
            f"{percent(self.free)} free, {percent(self.touching)} forbidden, "
            f"{percent(self.unknown)} unknown"
        ]
        locks = [float(self.deadlocks(one).mean()) for one in self.diagrams]
        lost = float(np.mean(locks))
        parts[0] += ", no deadlock" if not lost else f", {percent(lost)} in deadlock"
        try:
            together = f"{self.schedule().makespan:.1f} s together"
        except CoordinationError as error:
            together = str(error)
        parts.append(
            f"{together}, {self.one_after_another:.1f} s one after the other, "
            f"{self.without_interference:.1f} s if neither were there"
        )
        return "; ".join(parts)

    def _axes(self) -> list[Axis]:
        grids = Grids(self.diagrams, self.robots)
        return [
            Axis(name, start, start + duration, grids.step, self.segments[name])
            for name, start, duration in zip(
                self.robots, grids.starts, grids.durations, strict=True
            )
        ]


class Coordinator:
    """Makes maps in one scene.

    Attributes:
        tables: The scene.

    Args:
        scene: The scene, or its tables.
        robots: The robots that move, two or more.
        floor: Least distance that links of two robots have to keep, if their buffer is
            less [m].

    Raises:
        SceneError: The scene contradicts itself.
        CoordinationError: There are fewer than two robots, or one is not in the scene.
    """

    def __init__(
        self, scene: Scene | SceneTables, robots: Sequence[str], *, floor: float = 0.0
    ) -> None:
        tables = compile_scene(scene) if isinstance(scene, Scene) else scene
        names = [part.name for part in tables.robots]
        unknown = [robot for robot in robots if robot not in names]
        if unknown or len(set(robots)) < 2:
            wrong = f"'{unknown[0]}' is no robot" if unknown else "give two robots"
            raise CoordinationError(f"{wrong}; the scene has {', '.join(names)}")
        self.tables, self._robots = tables, tuple(robots)
        self._makers = [
            DiagramMaker(tables, both, floor) for both in combinations(robots, 2)
        ]
        self._alone = {
            robot: Paver(
                Checker(
                    restricted(tables, riders(tables), own_pairs(names.index(robot)))
                )
            )
            for robot in robots
        }

    def map(
        self, plans: dict[str, CellPlan], *, resolution: float | None = None
    ) -> CoordinationMap:
        """The map of the robots' plans.

        Args:
            plans: Plan of each robot by its name.
            resolution: Part of a plan that is not divided further [s]; by default a
                share of the longest.

        Raises:
            CoordinationError: A robot has no plan, or a row that has a name is none.
            TrajectoryError: A plan is none of its robot, or a figure is no such figure.
        """
        for robot in self._robots:
            if robot not in plans:
                raise CoordinationError(f"'{robot}' has no plan; give one")
        tubes = {robot: plans[robot].tube(self.tables, robot) for robot in self._robots}
        if resolution is None:
            resolution = FINEST * max(float(np.ptp(t.times)) for t in tubes.values())
        segments = {robot: plans[robot].segments() for robot in self._robots}
        diagrams = self.diagrams(tubes, resolution)
        alone = {}
        for robot, paver in self._alone.items():
            tube = tubes[robot]
            paving = paver.pave(tube, RESOLUTION)
            alone[robot] = tuple(paver.intervals(paving, tube, RESOLUTION))
        return CoordinationMap(
            robots=self._robots,
            plans={robot: plans[robot] for robot in self._robots},
            segments=segments,
            diagrams=diagrams,
            alone=alone,
        )

    def diagrams(
        self, tubes: Mapping[str, Tube], resolution: float
    ) -> tuple[Diagram, ...]:
        """The diagrams of every two robots of which tubes are given.

        Args:
            tubes: What holds the joints of each robot, see `CellPlan.tube`.
            resolution: See `map` [s].
        """
        both = zip(self._makers, combinations(self._robots, 2), strict=True)
        return tuple(
            maker.diagram((tubes[a], tubes[b]), resolution)
            for maker, (a, b) in both
            if a in tubes and b in tubes
        )

    def is_clear(self, robot: str, tube: Tube, resolution: float) -> bool:
        """Whether a robot is proven to keep clear of itself and of the still world.

        Args:
            robot: The robot.
            tube: What holds its joints.
            resolution: Part of it that is not divided further [s].
        """
        leaves = self._alone[robot].pave(tube, resolution).leaves
        return bool((leaves[:, LABEL] == FREE).all())


def coordination_map(
    scene: Scene, *, floor: float = 0.0, **plans: CellPlan | Plan | Trajectory
) -> CoordinationMap:
    """Which parts of robots' plans may be executed together, and when.

    A `Coordinator` is faster for several maps of one scene.

    Args:
        scene: The scene.
        floor: Least distance that links of two robots have to keep, if their buffer is
            less [m].
        **plans: The plan of each robot, by its name, two or more. A plan without errors
            need not be a `CellPlan`.

    Raises:
        CoordinationError: See `Coordinator.map`.
        TrajectoryError: See `Coordinator.map`.
        SceneError: The scene contradicts itself.
    """
    given = {
        robot: one if isinstance(one, CellPlan) else CellPlan(plan_of(one, scene))
        for robot, one in plans.items()
    }
    return Coordinator(scene, tuple(given), floor=floor).map(given)


def plan_of(given: Plan | Trajectory, scene: Scene) -> Plan:
    """A plan; waypoints may leave out the joints of other robots."""
    if isinstance(given, Plan):
        return given
    return Plan.of(given, scene, hold_home=True)


def own_pairs(robot: int) -> Any:
    """Which pairs concern a robot and nothing else that moves, see `restricted`."""
    return lambda a, b: robot in (a, b) and {a, b} <= {robot, WORLD}


def percent(share: float) -> str:
    """A share in words."""
    number = 100.0 * share
    return f"{number:.1f} %" if number >= 0.1 or number == 0.0 else f"{number:.1g} %"
