"""The coordination diagram of two plans: which parts may be executed together.

Each plan is at a time of its own. A place of the diagram is free if every pair of links
of both robots is proven to keep its buffer there, wherever following errors and clocks
may have both. What is not proven counts as forbidden.
"""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.maps.cell_plan import joints_of
from armguard.prove.paving import BoxPaving, Paver
from armguard.prove.tile_search import FREE, LABEL, PAIR, PLACE, TOUCHING, UNKNOWN
from armguard.prove.tube import Tube
from armguard.prove.tube_tiles import HIGH, LOW, SPAN
from armguard.scene.restricted import restricted, riders
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Grid = NDArray[np.uint8]

# Tiles are this share of the longer plan, or less, where nothing is decided.
FINEST = 1.0 / 200.0

# Cells of the grid in a tile of that size.
CELLS = 4

# Joints of a plan turn at most this much in all in the first tiles [rad or m].
TURN = 0.4

# Tiles reach this much farther in the grid, for what rounding takes [s].
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """What is known of two plans at every two times.

    Attributes:
        robots: The first and the second robot.
        starts: Time at which each plan begins [s].
        durations: How long each takes [s].
        step: Side of a cell of the grid [s].
        labels: FREE, TOUCHING or UNKNOWN in each cell, shape (k, m): a cell is free if
            all of it is.
        free: Share of the diagram that is free [-].
        touching: Share in which two links are too near [-].
        unknown: Share in which that is not decided [-].
        boxes: Tiles that are not free: both times where they begin and end, (l, 4) [s].
        nearest: Names of the links that decide each of them.
    """

    robots: tuple[str, str]
    starts: tuple[float, float]
    durations: tuple[float, float]
    step: float
    labels: Grid
    free: float
    touching: float
    unknown: float
    boxes: Floats
    nearest: tuple[tuple[str, str], ...]

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Cells that are not free, shape (k, m)."""
        return np.asarray(self.labels != FREE)

    def pair_at(self, cell: tuple[int, int]) -> tuple[str, str]:
        """Links that decide one of the tiles in a cell that is not free."""
        low = np.array(self.starts) + self.step * np.array(cell)
        high = low + self.step
        b = self.boxes
        over = (b[:, 0] < high[0]) & (b[:, 1] > low[0])
        over &= (b[:, 2] < high[1]) & (b[:, 3] > low[1])
        return self.nearest[int(np.argmax(over))]


class DiagramMaker:
    """Makes diagrams of two robots' plans.

    Args:
        tables: The scene.
        robots: The first and the second robot.
        floor: Least distance that links of both have to keep [m].
    """

    def __init__(
        self, tables: SceneTables, robots: tuple[str, str], floor: float
    ) -> None:
        names = [part.name for part in tables.robots]
        both = {names.index(robot) for robot in robots}
        own = restricted(tables, riders(tables), lambda a, b: {a, b} == both, floor)
        self._robots, self._paver = robots, Paver(Checker(own))
        # Joints of other robots follow the first plan, in which they do not move.
        self._owner = joints_of(tables.q_names, robots[1]).astype(np.intp)

    def diagram(self, tubes: tuple[Tube, Tube], resolution: float | None) -> Diagram:
        """The diagram of two plans.

        Args:
            tubes: What holds each robot's joints.
            resolution: Time that is not divided further [s]; by default a share of the
                longer plan.
        """
        starts = tuple(float(tube.times[0]) for tube in tubes)
        durations = tuple(float(tube.times[-1] - tube.times[0]) for tube in tubes)
        finest = FINEST * max(durations) if resolution is None else resolution
        paving = self._paver.pave_box(tubes, self._owner, finest, turn=TURN)
        near = np.flatnonzero(paving.leaves[:, LABEL] != FREE)
        boxes = boxes_of(paving, near, tubes)
        sizes = (boxes[:, 1] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 2])
        whole = durations[0] * durations[1]
        label = paving.leaves[near, LABEL].astype(np.uint8)
        shares = [
            float(sizes[label == one].sum() / whole) for one in (TOUCHING, UNKNOWN)
        ]
        names, pairs = self._paver.links.names, paving.pairs
        step = finest / CELLS
        return Diagram(
            robots=self._robots,
            starts=(starts[0], starts[1]),
            durations=(durations[0], durations[1]),
            step=step,
            labels=grid_of(boxes - np.repeat(starts, 2), label, durations, step),
            free=1.0 - sum(shares),
            touching=shares[0],
            unknown=shares[1],
            boxes=boxes,
            nearest=tuple(
                (names[pairs[k, 0]], names[pairs[k, 1]])
                for k in paving.leaves[near, PAIR].astype(int)
            ),
        )


def boxes_of(
    paving: BoxPaving, chosen: NDArray[np.intp], tubes: tuple[Tube, ...]
) -> Floats:
    """Both times where leaves begin and end, shape (k, 4) [s]."""
    columns = []
    for d, tube in enumerate(tubes):
        own = paving.leaves[chosen, PLACE + SPAN * d : PLACE + SPAN * (d + 1)]
        segment = own[:, 0].astype(np.intp)
        columns += [tube.time(segment, own[:, end]) for end in (LOW, HIGH)]
    return np.column_stack(columns)


def grid_of(
    boxes: Floats, labels: Grid, durations: tuple[float, ...], step: float
) -> Grid:
    """Labels of the cells of a grid: those of the tiles that they meet."""
    counts = [max(ceil(duration / step - ROUNDING), 1) for duration in durations]
    found = np.full(counts, FREE, dtype=np.uint8)
    first = np.floor((boxes[:, ::2] - ROUNDING) / step).astype(int).clip(0)
    end = np.ceil((boxes[:, 1::2] + ROUNDING) / step).astype(int)
    # What surely touches is drawn last.
    for k in np.argsort(-labels.astype(int), kind="stable"):
        found[first[k, 0] : end[k, 0], first[k, 1] : end[k, 1]] = labels[k]
    return found
