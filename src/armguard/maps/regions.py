"""Regions of space-time: when a robot may be in which cells while it executes a plan.

A plan is cut into tiles. In each, links are where they are in the middle of a box that
holds all joint positions, grown by what the joints may move them from there.
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.cells.occupied import (
    CELL,
    FIRST,
    LAST,
    OUTSIDE,
    SIDE,
    Visits,
    visit_cells,
)
from armguard.geometry.bounds import row_bounds
from armguard.maps.cell_plan import CoordinationError
from armguard.motion.chains import chains
from armguard.plans.coal_world import bodies_above
from armguard.prove.paving import boxes_of
from armguard.prove.tube import Tube, tube_table
from armguard.robot.kinematics import PRISMATIC
from armguard.scene.poses import body_poses
from armguard.scene.restricted import riders
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Edge of a cell [m], and how far primitives are grown at most for the motion within a
# tile, as a share of the edge.
EDGE = 0.03
MOTION = 1.0

# Bits of the number of a cell for each axis, and the number of the cell at the origin.
AXIS_BITS = 16
MIDDLE = 1 << (AXIS_BITS - 1)

# Most cells that a robot may reach, and room for runs of tiles at first [-].
MOST_CELLS = 1 << 25
ROOM = 1 << 17


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Time intervals of cells, which are in ascending order.

    Attributes:
        cells: Number of the cell of each row, shape (k,).
        begins: When its interval begins, shape (k,) [s].
        ends: When that ends [s].
    """

    cells: Longs
    begins: Floats
    ends: Floats

    def chosen(self, kept: NDArray[np.bool_]) -> "Rows":
        """Some of the rows."""
        return Rows(self.cells[kept], self.begins[kept], self.ends[kept])

    def until(self, time: float) -> "Rows":
        """What of the intervals is before a time [s]."""
        kept = self.chosen(self.begins < time)
        return Rows(kept.cells, kept.begins, np.minimum(kept.ends, time))

    def joined(self, other: "Rows") -> "Rows":
        """These rows and others."""
        order = np.argsort(np.append(self.cells, other.cells), kind="stable")
        return Rows(
            np.append(self.cells, other.cells)[order],
            np.append(self.begins, other.begins)[order],
            np.append(self.ends, other.ends)[order],
        )

    def delayed(self, by: float) -> "Rows":
        """The rows, all intervals later [s]."""
        return Rows(self.cells, self.begins + by, self.ends + by)

    def forbids(self, other: "Rows") -> tuple[Floats, Floats, Longs]:
        """Delays of other rows with which an interval overlaps one of the same cell.

        Returns:
            Least and greatest of these delays for each two such intervals, both open
            ends [s], and their cell.
        """
        first = np.searchsorted(self.cells, other.cells, side="left")
        count = np.searchsorted(self.cells, other.cells, side="right") - first
        theirs = np.repeat(np.arange(len(count)), count)
        begin = np.cumsum(count) - count
        own = np.arange(len(theirs)) - begin[theirs] + first[theirs]
        lows = self.begins[own] - other.ends[theirs]
        highs = self.ends[own] - other.begins[theirs]
        return lows, highs, self.cells[own]


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """When a robot may be in which cells while it executes a plan, and after that.

    Attributes:
        robot: The robot.
        first: Joint positions at the start of the plan, shape (n,) [rad or m].
        error: How far each joint may be off them, shape (n,).
        last: Joint positions in which the robot rests at last, shape (n,).
        duration: How long the plan takes [s].
        rows: When it may be in which cell, from the start of the plan on; without end
            for cells in which it rests.
    """

    robot: str
    first: Floats
    error: Floats
    last: Floats
    duration: float
    rows: Rows


class RegionMaker:
    """Makes regions of the robots of a scene.

    Attributes:
        edge: Edge of a cell [m].

    Args:
        tables: The scene.
        edge: See above.
        floor: Least distance that links of two robots have to keep, if their buffer is
            less [m].
    """

    def __init__(self, tables: SceneTables, edge: float, floor: float) -> None:
        self._tables, self.edge = tables, edge
        self._lever = float(chains(tables).levers.max())
        carriers = riders(tables)[: tables.moving_count]
        self._half = 0.5 * max(floor, greatest_buffer(tables, carriers))
        self._carried = {
            part.name: [Carried(int(i), tables) for i in np.flatnonzero(carriers == k)]
            for k, part in enumerate(tables.robots)
        }

    def at_rest(self, robot: str, q: Floats, error: Floats) -> Rows:
        """Cells in which a robot may be at rest, at all times.

        Args:
            robot: The robot.
            q: Positions of all joints, shape (n,) [rad or m].
            error: How far each may be off, shape (n,).

        Raises:
            CoordinationError: The robot reaches too far for these cells.
        """
        cells, _, _ = self._visits(robot, q[None], error[None])
        always = np.full(len(cells), inf)
        return Rows(cells, -always, always)

    def region(self, robot: str, tube: Tube) -> Region:
        """Where a robot may be, and when, if it executes a plan and rests at its end.

        Args:
            robot: The robot.
            tube: What holds its joints at all times of the plan.

        Raises:
            CoordinationError: The robot reaches too far for these cells.
        """
        tiles = tube.tiles(2.0 * MOTION * self.edge / self._lever)
        middles, halves = boxes_of(tiles, tube_table([tube], inf))
        segment = tiles[:, 0].astype(np.intp)
        begins, ends = (tube.time(segment, tiles[:, k]) for k in (1, 2))
        # At last it rests, with its following error.
        last = tube.control[-1, -1]
        middles = np.vstack((middles, last))
        halves = np.vstack((halves, tube.wide[-1]))
        begins, ends = np.append(begins, ends[-1]), np.append(ends, inf)
        cells, first, final = self._visits(robot, middles, halves)
        return Region(
            robot=robot,
            first=tube.control[0, 0],
            error=tube.wide[0],
            last=last,
            duration=float(tube.times[-1] - tube.times[0]),
            rows=Rows(
                cells=cells,
                begins=begins[first] - tube.times[0],
                ends=ends[final] - tube.times[0],
            ),
        )

    def place(self, cell: int) -> tuple[float, float, float]:
        """Middle of a cell [m]."""
        numbers = [int(cell) >> AXIS_BITS * k & 2 * MIDDLE - 1 for k in (2, 1, 0)]
        x, y, z = (self.edge * (number - MIDDLE + 0.5) for number in numbers)
        return x, y, z

    def _visits(
        self, robot: str, middles: Floats, halves: Floats
    ) -> tuple[Longs, Longs, Longs]:
        """Cells in which a robot may be, with runs of tiles.

        Args:
            robot: The robot.
            middles: Middles of the boxes of joint positions, shape (k, n) [rad or m].
            halves: Their half widths, of that shape.

        Returns:
            The cell of each run, in ascending order, its first and last tile, (r,).
        """
        t, own = self._tables, self._carried[robot]
        poses = np.array([body_poses(t, q) for q in middles])
        moved = [one.moved(poses, halves) for one in own]
        growths = self._half + np.column_stack(moved)
        boxes = [one.box(poses, growths[:, k]) for k, one in enumerate(own)]
        low, high = np.array(boxes).transpose(1, 0, 2)
        # Whole cubes, and one more on each side.
        low, high = low.min(axis=0) / self.edge, high.max(axis=0) / self.edge
        far = max(np.abs(low).max(), np.abs(high).max()) >= MIDDLE - 2 * SIDE
        if far or not (high - low + 3 * SIDE).prod() < MOST_CELLS:
            raise CoordinationError(
                f"'{robot}' reaches too far for cells of {self.edge:g} m; choose "
                "larger ones"
            )
        first = (np.floor(low / SIDE).astype(np.int64) - 1) * SIDE
        counts = (np.floor(high / SIDE).astype(np.int64) + 2) * SIDE - first
        numbers = [one.primitive for one in own]
        given = t.kinds[numbers], t.local_rows[numbers], t.bodies[numbers]
        room = ROOM
        while True:
            visits = Visits(
                first=first,
                counts=counts,
                open=np.full(int(counts.prod()), -1, dtype=np.int32),
                runs=np.empty((room, 3), dtype=np.int64),
                size=np.zeros(1, dtype=np.int64),
            )
            lines = Ledger(visits).lines
            for tile, (T_world, growth) in enumerate(zip(poses, growths, strict=True)):
                found = visit_cells(*given, T_world, growth, self.edge, tile, lines)
                if found == OUTSIDE:
                    # A region without these cells would permit contact.
                    raise CoordinationError(
                        f"'{robot}' leaves the box of its cells; report this plan"
                    )
            size = int(visits.size[0])
            if size <= room:
                break
            room = size
        runs = visits.runs[:size]
        z, rest = np.divmod(runs[:, CELL], counts[0] * counts[1])
        y, x = np.divmod(rest, counts[0])
        cells = np.zeros_like(x)
        for axis, place in enumerate((x, y, z)):
            cells = cells << AXIS_BITS | place + first[axis] + MIDDLE
        order = np.argsort(cells, kind="stable")
        return cells[order], runs[order, FIRST], runs[order, LAST]


def greatest_buffer(tables: SceneTables, carriers: NDArray[np.intp]) -> float:
    """Greatest buffer of links of two robots [m].

    Args:
        tables: The scene.
        carriers: Robot of each moving primitive, shape (m,).
    """
    groups = tables.groups[: len(carriers)]
    buffers = tables.buffers[np.ix_(groups, groups)]
    return float(buffers.max(where=carriers[:, None] != carriers, initial=0.0))


class Carried:
    """A primitive, the joints that carry it, and a ball round it.

    Attributes:
        primitive: Its number.

    Args:
        primitive: Its number.
        tables: The scene.
    """

    def __init__(self, primitive: int, tables: SceneTables) -> None:
        self.primitive, self._tables = primitive, tables
        self._body = int(tables.bodies[primitive])
        self._joints = list(bodies_above(tables, self._body))
        box = np.zeros(6)
        row_bounds(tables.kinds[primitive], tables.local_rows[primitive], 0.0, box)
        self._centre, self._reach = (
            0.5 * (box[:3] + box[3:]),
            0.5 * float(np.linalg.norm(box[3:] - box[:3])),
        )

    def moved(self, poses: Floats, halves: Floats) -> Floats:
        """How far it may be from where it is in the middle of boxes, shape (k,) [m].

        A joint moves it by no more than its distance from the axis, where joints nearer
        to it may have moved it already.

        Args:
            poses: Poses of all bodies in the middles, shape (k, b, 12).
            halves: Half widths of the boxes, shape (k, n) [rad or m].
        """
        t, T = self._tables, poses.reshape(len(poses), -1, 3, 4)
        middle = self._middles(poses)
        found = np.zeros(len(poses))
        for body in self._joints:
            way = abs(float(t.gain[body, 0])) * halves[:, t.q_index[body]]
            if t.joint_kind[body] != PRISMATIC:
                axes = T[:, body, :, :3] @ t.axis[body]
                apart = np.cross(axes, middle - T[:, body, :, 3])
                way = way * (np.linalg.norm(apart, axis=1) + self._reach + found)
            found += way
        return found

    def box(self, poses: Floats, growth: Floats) -> tuple[Floats, Floats]:
        """Lower and upper corner of a box that holds it in all poses [m].

        Args:
            poses: Poses of all bodies, shape (k, b, 12).
            growth: How far it is grown in each, shape (k,) [m].
        """
        middles, reach = self._middles(poses), (self._reach + growth)[:, None]
        return (middles - reach).min(axis=0), (middles + reach).max(axis=0)

    def _middles(self, poses: Floats) -> Floats:
        """Middle of its ball in each pose, shape (k, 3) [m]."""
        T = poses.reshape(len(poses), -1, 3, 4)[:, self._body]
        return np.asarray(T[:, :, :3] @ self._centre + T[:, :, 3])
