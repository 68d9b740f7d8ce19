"""A robot's plan in a cell: its errors, its segments by name, and its priority."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError, TrajectoryError
from armguard.plans.plan import ByName, Plan
from armguard.prove.tube import Tube
from armguard.scene import Scene, SceneTables

# A plan without names has a segment for each of up to so many rows, else equal parts.
MOST_ROWS = 40
PARTS = 16

# A spline through equal positions leaves them by less than this [rad or m].
STILL = 1e-9

# Chords that replace rows are this near to them [rad or m].
THINNED = 2e-3


class CoordinationError(ArmguardError, ValueError):
    """Plans of a cell cannot be coordinated."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A named part of a plan.

    Attributes:
        name: Its name.
        start: Where it begins, in time of the plan [s].
        end: Where it ends [s].
    """

    name: str
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class CellPlan:
    """What one robot of a cell executes.

    Attributes:
        plan: The plan; it moves joints of this robot only.
        following_error: How far a joint may be off its curve, for all or by name of
            'robot/joint' [rad or m].
        skew: How far the clock that executes the plan may be off [s].
        names: Name of the segment that begins at each row, by its number from 0.
        priority: Robots with a higher one wait less.
    """

    plan: Plan
    following_error: ByName = 0.0
    skew: float = 0.0
    names: Mapping[int, str] = field(default_factory=dict)
    priority: int = 1

    def tube(self, scene: Scene | SceneTables, robot: str) -> Tube:
        """What holds the robot's joints, at all times of the plan.

        Raises:
            TrajectoryError: The plan has no times, moves a joint of another robot, or
                a figure is no such figure.
        """
        plan, own = self.plan, joints_of(scene.q_names, robot)
        if not plan.timed:
            raise TrajectoryError(
                f"{plan.source}: it has no times, which a map needs: give each row one"
            )
        others = np.ptp(plan.tube.control[:, :, ~own], axis=(0, 1))
        if others.max(initial=0.0) > STILL:
            name = np.array(scene.q_names)[~own][int(np.argmax(others))]
            raise TrajectoryError(
                f"{plan.source}: the plan of '{robot}' moves '{name}'; give each robot "
                "a separate plan"
            )
        skew = {robot: self.skew}
        return plan.widened(scene, self.following_error, skew).thinned(THINNED)

    def segments(self) -> tuple[Segment, ...]:
        """Named parts of the plan, in order.

        Raises:
            CoordinationError: A row that has a name does not exist.
        """
        times = self.plan.tube.times
        last = len(times) - 1
        if self.names:
            rows = sorted({0, *self.names})
            if rows[0] < 0 or rows[-1] >= last:
                wrong = rows[0] if rows[0] < 0 else rows[-1]
                raise CoordinationError(
                    f"{self.plan.source}: names: row {wrong} begins no segment; give "
                    f"rows from 0 to {last - 1}"
                )
            names = [self.names.get(row, "start") for row in rows]
            ends = times[[*rows, last]]
        elif last <= MOST_ROWS:
            names, ends = [f"row {k + 1}" for k in range(last)], times
        else:
            names = [f"part {k + 1}" for k in range(PARTS)]
            ends = np.linspace(times[0], times[-1], PARTS + 1)
        return tuple(
            Segment(name, float(start), float(end))
            for name, start, end in zip(names, ends[:-1], ends[1:], strict=True)
        )


def joints_of(q_names: tuple[str, ...], robot: str) -> NDArray[np.bool_]:
    """Which joints of a scene are those of a robot, shape (n,)."""
    return np.array([name.split("/", 1)[0] == robot for name in q_names])
