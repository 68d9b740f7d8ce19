"""Reservations: which robot may be in which part of space, and when.

Space is divided into cells. A region is the time intervals in which links of a robot,
with its errors and half the distance to another robot, may be in each cell. Two robots
that are nearer to each other than that distance are both in the cell with the point in
the middle between them. So regions that share no cell at any time keep robots apart.

A robot rests where its last plan ends, or at home, and its cells stay reserved. From
the cells that a plan shares with reserved ones follow all starts that are forbidden.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.errors import did_you_mean
from armguard.maps.cell_plan import STILL, CellPlan, CoordinationError, joints_of
from armguard.maps.regions import EDGE, Region, RegionMaker, Rows
from armguard.scene import Scene, SceneTables, compile_scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Blocker:
    """What forbids a start.

    Attributes:
        robot: The robot that has reserved a cell.
        place: Middle of the cell, shape (3,) [m].
    """

    robot: str
    place: tuple[float, float, float]

    @property
    def sentence(self) -> str:
        """The robot and the place in words."""
        x, y, z = self.place
        return f"'{self.robot}' near ({x:.2f}, {y:.2f}, {z:.2f})"


@dataclass(frozen=True, slots=True)
class Starts:
    """Times at which a plan may start.

    Attributes:
        lows: Begins of forbidden intervals, ascending, which are open [s].
        highs: Their ends [s]; no two intervals overlap.
        blockers: What forbids a start just before each end.
    """

    lows: tuple[float, ...]
    highs: tuple[float, ...]
    blockers: tuple[Blocker, ...]

    def allowed(self, start: float) -> bool:
        """Whether the plan may start at a time [s]."""
        return self.earliest(start) == start

    def earliest(self, after: float) -> float:
        """Earliest start, not before a time; infinite if there is none [s]."""
        k = bisect_left(self.lows, after) - 1
        return self.highs[k] if k >= 0 and after < self.highs[k] else after

    def blocker(self, after: float) -> Blocker | None:
        """What forbids starts from a time until the earliest one; None if nothing."""
        start = self.earliest(after)
        if start == after:
            return None
        return self.blockers[bisect_right(self.highs, start) - 1]


@dataclass(frozen=True, slots=True)
class Booking:
    """A plan that has been given its start.

    Attributes:
        robot: The robot.
        start: When the plan starts [s].
        end: When it ends [s].
        blocker: What forbids an earlier start; None if nothing does.
    """

    robot: str
    start: float
    end: float
    blocker: Blocker | None

    @property
    def sentence(self) -> str:
        """Start and end, and what the robot waits for, in words."""
        waits = "" if self.blocker is None else f"; until then {self.blocker.sentence}"
        return (
            f"'{self.robot}' starts at {self.start:.2f} s and ends at {self.end:.2f} s"
            f"{waits}{' has reserved a cell' if waits else ''}"
        )


class Reservations:
    """Cells of a shared space, and the times for which robots have reserved them.

    At first all robots rest at home, for ever.

    Attributes:
        tables: The scene.

    Args:
        scene: The scene, or its tables.
        edge: Edge of a cell [m].
        floor: Least distance that links of two robots have to keep, if their buffer is
            less [m].

    Raises:
        SceneError: The scene contradicts itself.
        CoordinationError: The edge is not positive, or a robot reaches too far for it.
    """

    def __init__(
        self, scene: Scene | SceneTables, *, edge: float = EDGE, floor: float = 0.0
    ) -> None:
        if not 0.0 < edge < inf:
            raise CoordinationError(f"edge is {edge}; it must be positive [m]")
        self.tables = compile_scene(scene) if isinstance(scene, Scene) else scene
        self._names = tuple(part.name for part in self.tables.robots)
        self._maker = RegionMaker(self.tables, edge, floor)
        self._rows = dict[str, Rows]()
        self._rests = dict[str, Floats]()
        self._free_from = dict[str, float]()
        for name in self._names:
            self.rest(name, self.tables.home)

    def rest(self, robot: str, q: Floats, error: float | Floats = 0.0) -> None:
        """Replace all that a robot has reserved: it rests, at all times.

        Plans of other robots that are reserved already may pass there: that is not
        checked.

        Args:
            robot: The robot.
            q: Positions of all joints, shape (n,) [rad or m].
            error: How far each joint may be off, shape (n,), or one number for all.

        Raises:
            CoordinationError: There is no such robot.
        """
        self._check(robot)
        halves = np.broadcast_to(np.asarray(error, dtype=np.float64), q.shape)
        self._rows[robot] = self._maker.at_rest(robot, q, halves)
        self._rests[robot], self._free_from[robot] = q, -inf

    def region(self, robot: str, plan: CellPlan) -> Region:
        """Where a robot may be, and when, if it executes a plan.

        Raises:
            CoordinationError: There is no such robot, or it reaches too far for
                these cells.
            TrajectoryError: See `CellPlan.tube`.
        """
        self._check(robot)
        return self._maker.region(robot, plan.tube(self.tables, robot))

    def starts(self, region: Region) -> Starts:
        """When a plan may start, by what other robots have reserved.

        Raises:
            CoordinationError: The plan does not begin where its robot rests.
        """
        self._check_rest(region)
        others = [name for name in self._rows if name != region.robot]
        if not others:
            return Starts((), (), ())
        each = [self._rows[name].forbids(region.rows) for name in others]
        lows, highs, cells = map(np.concatenate, zip(*each, strict=True))
        owners = np.repeat(np.arange(len(others)), [len(low) for low, _, _ in each])
        order = np.argsort(lows, kind="stable")
        lows, highs = lows[order], highs[order]
        # An interval that begins beyond all ends before it is no part of those.
        reach = np.maximum.accumulate(highs)
        begins = np.flatnonzero(lows >= np.append(-inf, reach[:-1]))
        last = [
            order[k + int(np.argmax(part))]
            for k, part in zip(begins, np.split(highs, begins)[1:], strict=True)
        ]
        return Starts(
            tuple(lows[begins].tolist()),
            tuple(np.maximum.reduceat(highs, begins).tolist()) if len(begins) else (),
            tuple(
                Blocker(others[owners[k]], self._maker.place(cells[k])) for k in last
            ),
        )

    def reserve(self, region: Region, start: float) -> None:
        """Reserve what a plan needs; its robot waits where it rests until it starts.

        Args:
            region: What the plan needs.
            start: When it starts [s].

        Raises:
            CoordinationError: Another robot has reserved a cell, the robot has not
                ended its last plan by then, or the plan does not begin where it rests.
        """
        found, before = self.starts(region), self._free_from[region.robot]
        if not before <= start < inf:
            raise CoordinationError(
                f"'{region.robot}' cannot start at {start:g} s; a start is "
                f"finite, and not before its last plan ends, at {before:g} s"
            )
        blocker = found.blocker(start)
        if blocker is not None:
            raise CoordinationError(
                f"'{region.robot}' cannot start at {start:g} s: {blocker.sentence} has "
                f"reserved a cell; the earliest start is {found.earliest(start):g} s"
            )
        kept = self._rows[region.robot].until(start)
        self._rows[region.robot] = kept.joined(region.rows.delayed(start))
        self._rests[region.robot] = region.last
        self._free_from[region.robot] = start + region.duration

    def in_turn(
        self, regions: Iterable[Region], after: float = 0.0
    ) -> tuple[Booking, ...]:
        """Reserve plans one after another, each as early as the ones before it permit.

        A robot that has reserved nothing waits where its first plan begins. A plan that
        must pass where another robot rests is given its start after that one's plan.

        Args:
            regions: What the plans need, that which is preferred first.
            after: Time before which no plan starts [s].

        Raises:
            CoordinationError: No plan of those left can start, and what blocks each;
                or a robot would wait where a plan is reserved already.
        """
        left, found = list(regions), list[Booking]()
        for one in reversed(left):
            if self._free_from[one.robot] == -inf:
                self._check_wait(one)
                self.rest(one.robot, one.first, one.error)
        while left:
            # Of each robot its next plan.
            ahead = {one.robot: one for one in reversed(left)}
            asked = [(one, self.starts(one)) for one in left if one in ahead.values()]
            for one, starts in asked:
                first = max(after, self._free_from[one.robot])
                start = starts.earliest(first)
                if start < inf:
                    break
            else:
                reasons = [
                    f"{blocker.sentence} blocks '{one.robot}'"
                    for one, starts in asked
                    if (blocker := starts.blocker(after)) is not None
                ]
                raise CoordinationError(
                    f"no plan can start: {', '.join(reasons)}, where they rest; give "
                    "one of them another plan first, which makes room"
                )
            end = start + one.duration
            found.append(Booking(one.robot, start, end, starts.blocker(first)))
            self.reserve(one, start)
            left.remove(one)
        return tuple(found)

    def forget(self, before: float) -> None:
        """Drop what was reserved until a time [s]."""
        for name, rows in self._rows.items():
            self._rows[name] = rows.chosen(rows.ends > before)

    def _check(self, robot: str) -> None:
        """Refuse a robot that the scene has not."""
        if robot not in self._names:
            near = did_you_mean(robot, self._names)
            raise CoordinationError(f"'{robot}' is no robot of the scene; {near}")

    def _check_wait(self, region: Region) -> None:
        """Refuse a robot that would wait where a plan of another one is reserved."""
        waits = self._maker.at_rest(region.robot, region.first, region.error)
        for name, rows in self._rows.items():
            planned = name != region.robot and self._free_from[name] > -inf
            if planned and np.isin(rows.cells, waits.cells).any():
                raise CoordinationError(
                    f"'{region.robot}' would wait where '{name}' has reserved a cell; "
                    "forget past reservations, or plan from elsewhere"
                )

    def _check_rest(self, region: Region) -> None:
        """Refuse a plan that does not begin where its robot rests."""
        own = joints_of(self.tables.q_names, region.robot)
        apart = np.where(own, np.abs(region.first - self._rests[region.robot]), 0.0)
        if apart.max() > STILL:
            joint = int(np.argmax(apart))
            raise CoordinationError(
                f"the plan of '{region.robot}' begins {apart[joint]:.3g} from where "
                f"'{self.tables.q_names[joint]}' rests; plan from there, or say by "
                "'rest' where the robot is"
            )
