"""Robots and the plans that their jobs use, before jobs arrive."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import CellPlan, CoordinationError, joints_of
from armguard.maps.coordination import Coordinator
from armguard.maps.right_of_way import STEP, Crossing
from armguard.maps.self_motion import SelfMotion
from armguard.scene import Scene
from armguard.scene.meshes import Progress
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Greatest change of a pace [1/s].
RATE = 4.0

# Time that a robot slows down in, and recovers its pace in before it slows down again,
# counted in time of its plan [s].
SPARE = 1.5 / RATE

# Time on the plan in which a robot at rest catches up with an item [s].
RUN_UP = 0.7


# An item is gripped for so long [s].
GRIP = 0.2

# Plans of a robot begin and end so near to each other [rad or m].
JOINED = 1e-3

# Tiles of diagrams are not divided below this, and those of a robot alone [s].
FINEST, ALONE = STEP, 0.01

# Joints of an alternative have so much more room to each side [rad or m].
ROOM = 0.01


@dataclass(frozen=True, slots=True)
class Track:
    """The part of a plan that follows an item on the belt.

    Attributes:
        start: Where it begins, in time of the plan [s].
        end: Where it ends; the item is gripped in its last GRIP seconds [s].
        at: Place of the item on the belt at `start` [m].
        speed: Speed of the belt for which the plan is made [m/s].
    """

    start: float
    end: float
    at: float
    speed: float

    def lag(self, speed: float) -> float:
        """How far an item may be ahead and still be caught in time [s of the plan].

        Args:
            speed: Speed of the belt [m/s].
        """
        return max(self.end - GRIP - self.start, 0.0) * (1.0 - speed / self.speed)


@dataclass(frozen=True, slots=True)
class LinePlan:
    """A plan that jobs use.

    Attributes:
        robot: Its robot.
        plan: What that executes.
        track: The part that follows the belt, if there is one.
        alternatives: How many plans are made at most along which the tool moves the
            same and the elbow elsewhere; only of a redundant robot.
        instead_of: Name of the plan that this is an alternative to; empty if none.
    """

    robot: str
    plan: CellPlan
    track: Track | None = None
    alternatives: int = 0
    instead_of: str = ""

    @property
    def begin(self) -> float:
        """Time of the plan's first row [s]."""
        return float(self.plan.plan.tube.times[0])

    @property
    def reserved(self) -> tuple[float, float] | None:
        """Where the robot cannot wait, from the start of the plan [s]."""
        if self.track is None:
            return None
        start = self.track.start - RUN_UP - self.begin
        return STEP * int(start / STEP), self.track.end + 0.5 / RATE - self.begin


@dataclass(frozen=True, slots=True)
class Conveyor:
    """A belt.

    Attributes:
        slowest: Its least speed [m/s].
        fastest: Its greatest speed [m/s].
    """

    slowest: float
    fastest: float


@dataclass(frozen=True, slots=True)
class Job:
    """A job that has arrived.

    Attributes:
        number: Its number.
        plans: Names of plans that can do it, that which is preferred first.
        offset: Place on the belt at which its item arrived [m].
        travel: How far the belt had moved then [m].
    """

    number: int
    plans: tuple[str, ...]
    offset: float = 0.0
    travel: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class LineCell:
    """What is known of two or more robots before jobs arrive.

    Attributes:
        robots: The robots.
        plans: Plans that jobs use, and their alternatives, by name.
        conveyor: The belt, if there is one.
        crossings: Of each two plans of two robots, the earlier robot's first. Two
            alternatives have none: two robots do not both leave their plans at once.
        q_names: Names of all joints of the scene.
    """

    robots: tuple[str, ...]
    plans: Mapping[str, LinePlan]
    conveyor: Conveyor | None
    crossings: Mapping[tuple[str, str], Crossing]
    q_names: tuple[str, ...]

    def ways(self, plan: str) -> tuple[str, ...]:
        """Names of a plan and of its alternatives."""
        others = (n for n, one in self.plans.items() if one.instead_of == plan)
        return (plan, *others)

    @classmethod
    def of(
        cls,
        scene: Scene | SceneTables,
        plans: Mapping[str, LinePlan],
        *,
        conveyor: Conveyor | None = None,
        floor: float = 0.0,
        progress: Progress | None = None,
    ) -> Self:
        """Prove which parts of plans may be executed together.

        Args:
            scene: The scene, or its tables.
            plans: See `plans`.
            conveyor: See `conveyor`.
            floor: Least distance that links of two robots have to keep [m].
            progress: Called before each diagram, with its plans, its number and how
                many there are.

        Raises:
            CoordinationError: There are fewer than two robots, a plan cannot follow the
                belt, the plans of a robot do not join, one begins or ends where another
                robot passes, or has no alternative though these are required.
            TrajectoryError: A plan is none of its robot.
        """
        robots = tuple(dict.fromkeys(one.robot for one in plans.values()))
        if len(robots) < 2:
            raise CoordinationError(
                f"there are plans of {', '.join(robots) or 'no robot'} alone; "
                "coordination on line is of two robots or more: give another one a plan"
            )
        check_tracks(plans, conveyor)
        coordinator = Coordinator(scene, robots, floor=floor)
        names = coordinator.tables.q_names
        check_joined(plans, names)
        every = dict(plans)
        for name in plans:
            every |= alternatives_of(coordinator, name, plans)
        crossings = crossings_of(coordinator, robots, every, progress)
        return cls(robots, every, conveyor, crossings, names)


def crossings_of(
    coordinator: Coordinator,
    robots: Sequence[str],
    plans: Mapping[str, LinePlan],
    progress: Progress | None,
) -> dict[tuple[str, str], Crossing]:
    """See `LineCell.crossings`.

    Raises:
        CoordinationError: A plan begins or ends where another robot passes.
    """
    tubes = {
        n: one.plan.tube(coordinator.tables, one.robot) for n, one in plans.items()
    }
    pairs = [
        (a, b)
        for robot, other in combinations(robots, 2)
        for a, one in plans.items()
        for b, two in plans.items()
        if (one.robot, two.robot) == (robot, other)
        and not (one.instead_of and two.instead_of)
    ]
    crossings = {}
    for number, (a, b) in enumerate(pairs, 1):
        if progress is not None:
            progress(f"diagram of '{a}' and '{b}'", number, len(pairs))
        both = plans[a], plans[b]
        near = {plans[name].robot: tubes[name] for name in (a, b)}
        (diagram,) = coordinator.diagrams(near, FINEST)
        crossing = Crossing(diagram, [one.reserved for one in both], SPARE)
        blocked = blocked_end(crossing, a, b)
        if not blocked:
            crossings[a, b] = crossing
        elif not any(one.instead_of for one in both):
            raise CoordinationError(blocked)
    return crossings


def alternatives_of(
    coordinator: Coordinator, name: str, plans: Mapping[str, LinePlan]
) -> dict[str, LinePlan]:
    """Alternatives to a plan, by name; none if none are required.

    Raises:
        CoordinationError: The robot is not redundant, or none is proven to keep clear
            of the robot itself and of the still world.
    """
    one, found = plans[name], dict[str, LinePlan]()
    if not one.alternatives:
        return found
    tables, given = coordinator.tables, one.plan.plan
    for tube in SelfMotion(tables, one.robot, given.tube).tubes():
        label = f"{name}, alternative {len(found) + 1}"
        plan = replace(given, source=label, tube=tube, interpolation="cubic")
        cell_plan = replace(one.plan, plan=plan, names={})
        # With room, so that the guard need not slow down the elbow.
        wide = cell_plan.tube(tables, one.robot).widened(np.array(ROOM))
        if not coordinator.is_clear(one.robot, wide, ALONE):
            continue
        found[label] = replace(one, plan=cell_plan, alternatives=0, instead_of=name)
        if len(found) == one.alternatives:
            break
    if not found or found.keys() & plans.keys():
        raise CoordinationError(
            f"plan '{name}' has no alternative: joint limits, links of the robot or "
            "the still world leave no room for its elbow, or a plan is named so; "
            "leave out its `alternatives`"
        )
    return found


def blocked_end(crossing: Crossing, a: str, b: str) -> str:
    """Which of two plans begins or ends where the other robot passes; empty if none."""
    for axis, (name, other) in enumerate(((a, b), (b, a))):
        grid = crossing.blocked if axis == 0 else crossing.blocked.T
        for end, where in ((0, "begins"), (-1, "ends")):
            if grid[end].any():
                return (
                    f"plan '{name}' {where} where plan '{other}' passes; let it "
                    f"{where.removesuffix('s')} clear of the other robot"
                )
    return ""


def check_tracks(plans: Mapping[str, LinePlan], conveyor: Conveyor | None) -> None:
    """Refuse plans that cannot follow the belt.

    Raises:
        CoordinationError: A part that follows it is none, or no belt is declared.
    """
    for name, one in plans.items():
        track = one.track
        if track is None:
            continue
        if conveyor is None:
            raise CoordinationError(
                f"plan '{name}' follows a belt, but there is no conveyor; declare it"
            )
        first, last = one.plan.plan.tube.times[[0, -1]]
        if not first + RUN_UP <= track.start < track.end - GRIP or track.end > last:
            raise CoordinationError(
                f"plan '{name}': it follows the belt from {track.start:g} s to "
                f"{track.end:g} s; it must begin {RUN_UP:g} s after the plan, take "
                f"more than {GRIP:g} s, and end within it"
            )
        if not track.speed > conveyor.fastest:
            raise CoordinationError(
                f"plan '{name}': it is made for {track.speed:g} m/s, the belt moves at "
                f"up to {conveyor.fastest:g} m/s; make it for a faster belt, so that "
                "the robot can catch up"
            )


def check_joined(plans: Mapping[str, LinePlan], names: Sequence[str]) -> None:
    """Refuse plans of a robot that do not begin where the others end.

    Raises:
        CoordinationError: They do not.
    """
    ends: dict[str, tuple[str, Floats]] = {}
    for name, one in plans.items():
        tube, own = one.plan.plan.tube, joints_of(tuple(names), one.robot)
        for q in tube.at(tube.times[[0, -1]])[:, own]:
            other, known = ends.setdefault(one.robot, (name, q))
            off = float(np.abs(q - known).max())
            if off > JOINED:
                raise CoordinationError(
                    f"plan '{name}' of {one.robot} begins or ends {off:.3f} rad or m "
                    f"from where '{other}' begins; give both the same rest position"
                )
