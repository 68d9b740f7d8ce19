"""Right of way of two robots: which of them goes first where their plans cross.

The way through the diagram of two plans begins where both robots can stop, and leads
to both ends. Behind a region that it passes one robot waits until the other has passed,
so robots never wait for each other in a circle, at any pace.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf

import numpy as np
from numpy.typing import NDArray

from armguard.maps.diagram import Diagram
from armguard.maps.interlocks import CLEAR, last_before
from armguard.maps.ways import edges_free, steps_to_end

Bools = NDArray[np.bool_]
Nodes = NDArray[np.intp]

# Side of a cell [s].
STEP = 0.1

# What keeps a robot back by itself: steps before it goes on, a node, steps at that.
Hold = tuple[int, int, int]

# The later robot needs so many steps more than there are cells, at most.
LONGEST = 4


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """Which robot waits where for which.

    Attributes:
        first: Robot that goes first where both arrive together, 0 or 1.
        needs: For the first and the second robot: what the other one has to have passed
            before it leaves each of its nodes, shape (k,).
        tight: Whether it may have both robots slow at once: no other way was found.
    """

    first: int
    needs: tuple[Nodes, Nodes]
    tight: bool

    def limit(self, robot: int, other: float) -> float:
        """Where a robot has to stop, in time from the start of its plan [s].

        Args:
            robot: The robot, 0 or 1.
            other: Where the other one is, in the same way [s].
        """
        passed = int((other - CLEAR) / STEP) if other > CLEAR else 0
        needs = self.needs[robot]
        node = int(needs.searchsorted(passed, side="right"))
        return STEP * node - CLEAR if node < len(needs) else inf

    def steps(
        self,
        nodes: tuple[int, int],
        holds: tuple[Hold, Hold],
        goals: tuple[int, int] | None = None,
    ) -> tuple[int, int]:
        """Steps after which each robot is where it goes, at its plan's pace.

        Args:
            nodes: See `Crossing.order`.
            holds: See `Crossing.order`.
            goals: Where each goes; the end of its plan by default [cells].
        """
        (i, j), one, other = nodes, self.needs[0].tolist(), self.needs[1].tolist()
        k, m = (len(one), len(other)) if goals is None else goals
        (first, at, rest), (second, there, pause) = holds
        ends, most = [0, 0], LONGEST * (len(one) + len(other))
        for t in range(most + first + rest + second + pause):
            a = i < k and t >= first and one[i] <= j
            b = j < m and t >= second and other[j] <= i
            if a and rest and i == at:
                a, rest = False, rest - 1
            if b and pause and j == there:
                b, pause = False, pause - 1
            if b:
                j, ends[1] = j + 1, t + 1
            elif i >= k and j >= m:
                break
            if a:
                i, ends[0] = i + 1, t + 1
        return ends[0], ends[1]

    def delays(
        self, nodes: tuple[int, int], holds: tuple[Hold, Hold]
    ) -> tuple[float, float]:
        """How long each robot is delayed by the other [s]; see `Crossing.order`."""
        late = [
            STEP * max(end - (len(needs) - node + hold[0] + hold[2]), 0)
            for end, needs, node, hold in zip(
                self.steps(nodes, holds), self.needs, nodes, holds, strict=True
            )
        ]
        return late[0], late[1]


class Crossing:
    """The diagram of two plans, on line.

    Attributes:
        blocked: Cells that are not free, shape (k, m).

    Args:
        diagram: The diagram of the whole plans.
        reserved: For each robot the part of its plan in which it cannot wait, from the
            start of the plan, or None [s].
        spare: Time that a robot needs to slow down and to recover its pace [s].
    """

    def __init__(
        self,
        diagram: Diagram,
        reserved: Sequence[tuple[float, float] | None],
        spare: float,
    ) -> None:
        self.blocked = blocked = coarser(diagram)
        for grid, span in zip((blocked, blocked.T), reserved, strict=True):
            if span is not None:
                part = grid[int(span[0] / STEP) : ceil(span[1] / STEP)]
                part |= part.any(axis=0)
        more = ceil(0.5 * spare / STEP)
        self._safe = [
            Safe(grown(grown(blocked, more, 0), more, 1)),
            Safe(blocked),
        ]

    def order(
        self, nodes: tuple[int, int], holds: tuple[Hold, Hold], first: int
    ) -> Order | None:
        """The order in which both go as soon as they can; None if there is no way.

        Args:
            nodes: Where each can stop [cells].
            holds: What keeps each back by itself.
            first: Robot that goes first where both arrive together.
        """
        for tight, safe in enumerate(self._safe):
            way = safe.way(nodes, holds, first)
            if way is not None:
                needs = needs_of(self.blocked.T, way[:, ::-1], nodes[::-1])
                others = needs_of(self.blocked, way, nodes)
                return Order(first, (needs, others), bool(tight))
        return None


class Safe:
    """Nodes from which both ends can be reached, and free steps between nodes.

    Args:
        blocked: Cells that no way leads through, shape (k, m).
    """

    def __init__(self, blocked: Bools) -> None:
        self._shape = blocked.shape
        safe = steps_to_end(blocked) < inf
        one, other = edges_free(blocked)
        # Whether each step may be taken, by node; as bytes, which are quick to read.
        ways = np.zeros((3, *safe.shape), dtype=bool)
        ways[0, :-1, :-1] = ~blocked & safe[1:, 1:]
        ways[1, :-1] = one & safe[1:]
        ways[2, :, :-1] = other & safe[:, 1:]
        self._both, self._one, self._other = (way.tobytes() for way in ways)
        self._safe, self._width = safe.tobytes(), safe.shape[1]

    def reaches(self, i: int, j: int) -> bool:
        """Whether both ends can be reached from a node."""
        return bool(self._safe[i * self._width + j])

    def way(
        self, nodes: tuple[int, int], holds: tuple[Hold, Hold], first: int
    ) -> Nodes | None:
        """Nodes of the way on which both go whenever the ends can still be reached.

        See `Crossing.order`.
        """
        (i, j), (k, m), width = nodes, self._shape, self._width
        if not self.reaches(i, j):
            return None
        found, at = [(i, j)], i * width + j
        both, one, other = self._both, self._one, self._other
        (late, node, rest), (later, there, pause) = holds
        for t in range(LONGEST * (k + m) + late + rest + later + pause):
            if i == k and j == m:
                return np.array(found, dtype=np.intp)
            goes, follows = t >= late, t >= later
            if goes and rest and i == node:
                goes, rest = False, rest - 1
            if follows and pause and j == there:
                follows, pause = False, pause - 1
            a, b = goes and one[at], follows and other[at]
            if goes and follows and both[at]:
                a = b = True
            elif a and b:
                a, b = first == 0, first == 1
            elif not (a or b):
                continue
            i, j, at = i + bool(a), j + bool(b), at + width * bool(a) + bool(b)
            found.append((i, j))
        return None


def needs_of(blocked: Bools, way: Nodes, nodes: tuple[int, int]) -> Nodes:
    """What the first robot has to have passed before the second leaves its nodes.

    Args:
        blocked: Cells, shape (k, m).
        way: Nodes from where both can stop, shape (n, 2).
        nodes: Where that is; what is behind it is past.
    """
    i, j = nodes
    passed = np.full(blocked.shape[1], i)
    passed[j:] = way[np.flatnonzero(np.diff(way[:, 1]) > 0), 0]
    last = last_before(blocked, passed)
    last[:j] = 0
    return np.maximum.accumulate(last)


def coarser(diagram: Diagram) -> Bools:
    """Cells of side STEP that are not free, shape (k, m)."""
    count = round(STEP / diagram.step)
    blocked = diagram.blocked
    pad = [(0, -size % count) for size in blocked.shape]
    whole = np.pad(blocked, pad, mode="edge")
    k, m = (size // count for size in whole.shape)
    return np.asarray(whole.reshape(k, count, m, count).any(axis=(1, 3)))


def grown(blocked: Bools, cells: int, axis: int) -> Bools:
    """Blocked cells, and those at most so many cells beside them along an axis."""
    pad = [(0, 0), (0, 0)]
    pad[axis] = (cells, cells)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(blocked, pad), 2 * cells + 1, axis=axis
    )
    return np.asarray(windows.any(axis=-1))
