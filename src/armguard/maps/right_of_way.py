"""Right of way of robots: which of them goes first where their plans cross.

The way through the diagram of two plans begins where both robots can stop, and leads
to both ends. Behind a region that it passes one robot waits until the other has passed,
so two robots never wait for each other, at any pace. The ways of every two robots are
taken only if they let all robots together reach their ends.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, inf

import numpy as np
from numpy.typing import NDArray

from armguard.maps.diagram import Diagram
from armguard.maps.interlocks import CLEAR
from armguard.maps.ways import edges_free, steps_to_end

Bools = NDArray[np.bool_]
Nodes = NDArray[np.intp]

# Side of a cell [s].
STEP = 0.1

# What keeps a robot back by itself: steps before it goes on, a node, steps at that.
Hold = tuple[int, int, int]

# A node that a robot leaves only once the other one has passed so many cells.
Gate = tuple[int, int]

# Numbers of two robots, the lower one first.
Pair = tuple[int, int]

# The later robot needs so many steps more than there are cells, at most.
LONGEST = 4


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """Which of two robots waits where for the other one.

    Attributes:
        gates: Of the first and of the second robot, by node; cells ascend as well.
        tight: Whether it may have both robots slow at once: no other way was found.
    """

    gates: tuple[tuple[Gate, ...], tuple[Gate, ...]]
    tight: bool

    def gate(self, robot: int, other: float) -> Gate | None:
        """The gate at which a robot has to wait now; None without any.

        Args:
            robot: The robot, 0 or 1.
            other: Where the other one is, in time from the start of its plan [s].
        """
        passed = int((other - CLEAR) / STEP) if other > CLEAR else 0
        return next((gate for gate in self.gates[robot] if gate[1] > passed), None)


class Passage:
    """In which steps a robot passes the nodes of its plan.

    Args:
        node: Where it can stop now.
        late: Steps before it goes on.
    """

    __slots__ = ("_legs", "_start")

    def __init__(self, node: int, late: int) -> None:
        # Nodes at which it was kept back, and steps after which it leaves them.
        self._start, self._legs = node, [(node, late)]

    def arrives(self, node: int) -> int:
        """Steps after which it is at a node; 0 if that is past."""
        if node <= self._start:
            return 0
        for at, leaves in reversed(self._legs):
            if at < node:
                return leaves + node - at
        return 0

    def wait(self, node: int, until: int, rest: int = 0) -> None:
        """Keep it back at a node, at or behind the last one at which it was.

        Args:
            node: The node.
            until: Steps before which it does not leave it.
            rest: Steps that it stays there after that.
        """
        at, leaves = self._legs[-1]
        if node > at:
            at, leaves = node, leaves + node - at
            self._legs.append((at, leaves))
        self._legs[-1] = at, max(leaves, until) + rest


class RightOfWay:
    """Which of several robots waits where for which.

    Attributes:
        orders: Of every two robots.

    Args:
        orders: See above.
        count: How many robots there are.
    """

    def __init__(self, orders: Mapping[Pair, Order], count: int) -> None:
        self.orders = orders
        # Per robot and other robot: that one, the order, and which of its two it is.
        self._own: list[list[tuple[int, Order, int]]] = [[] for _ in range(count)]
        for (a, b), order in orders.items():
            self._own[a].append((b, order, 0))
            self._own[b].append((a, order, 1))
        # Per robot: node, whether it rests there by itself, other robot, and cells.
        self._gates = [
            [
                (at, False, other, cells)
                for other, order, side in own
                for at, cells in order.gates[side]
            ]
            for own in self._own
        ]

    def gate(self, robot: int, other: int, place: float) -> Gate | None:
        """The gate at which a robot has to wait for another one; None without any.

        Args:
            robot: The robot.
            other: The other one.
            place: Where that is, in time from the start of its plan [s].
        """
        order = self.orders[min(robot, other), max(robot, other)]
        return order.gate(int(robot > other), place)

    def limit(self, robot: int, places: Sequence[float]) -> tuple[float, int]:
        """Where a robot has to stop, and for which other one.

        Args:
            robot: The robot.
            places: Where each robot is, in time from the start of its plan [s].

        Returns:
            Time from the start of its plan, infinite if it need not stop [s], and the
            other robot.
        """
        found = []
        for other, order, side in self._own[robot]:
            gate = order.gate(side, places[other])
            found.append((inf if gate is None else STEP * gate[0] - CLEAR, other))
        return min(found)

    def passages(
        self, nodes: Sequence[int], holds: Sequence[Hold]
    ) -> list[Passage] | None:
        """How all robots together go on as soon as they may; None if they never end.

        Each robot passes its nodes in sequence, and a gate lets it pass one only behind
        another robot's passing of one. Where one execution passes all nodes, none waits
        for itself: at any pace the first node of that execution which is not passed yet
        may be passed, so robots never wait for each other in a circle.

        Args:
            nodes: Where each can stop [cells].
            holds: What keeps each back by itself.
        """
        found = [Passage(n, hold[0]) for n, hold in zip(nodes, holds, strict=True)]
        # Gates by node, a rest behind those of its node; the next one is the last.
        todo = []
        for k, (gates, (_, node, rest)) in enumerate(
            zip(self._gates, holds, strict=True)
        ):
            waits = [gate for gate in gates if gate[3] > nodes[gate[2]]]
            if rest and node >= nodes[k]:
                waits.append((node, True, k, rest))
            todo.append(sorted(waits, reverse=True))
        goes = True
        while goes:
            goes = False
            for passage, waits in zip(found, todo, strict=True):
                while waits:
                    node, rests, other, cells = waits[-1]
                    if rests:
                        passage.wait(node, 0, cells)
                    # So far the other one goes before it has to wait.
                    elif todo[other] and cells > max(nodes[other], todo[other][-1][0]):
                        break
                    else:
                        passage.wait(node, found[other].arrives(cells))
                    waits.pop()
                    goes = True
        return None if any(todo) else found


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
        self._behind = last_blocked(blocked.T), last_blocked(blocked)
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
                both = (
                    needs_of(self._behind[0], way[:, ::-1], nodes[::-1]),
                    needs_of(self._behind[1], way, nodes),
                )
                return Order((gates_of(both[0]), gates_of(both[1])), bool(tight))
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


def last_blocked(blocked: Bools) -> Nodes:
    """Node behind the last blocked cell before each node of the first plan; else 0.

    Args:
        blocked: Cells, shape (k, m).

    Returns:
        That node in each column of cells, shape (k + 1, m).
    """
    behind = np.where(blocked, np.arange(1, len(blocked) + 1)[:, None], 0)
    return np.pad(np.maximum.accumulate(behind), ((1, 0), (0, 0)))


def needs_of(behind: Nodes, way: Nodes, nodes: tuple[int, int]) -> Nodes:
    """What the first robot has to have passed before the second leaves its nodes.

    Args:
        behind: See `last_blocked`.
        way: Nodes from where both can stop, shape (n, 2).
        nodes: Where that is; what is behind it is past.
    """
    j = nodes[1]
    passed = np.zeros(behind.shape[1], dtype=np.intp)
    passed[j:] = way[:-1][way[1:, 1] > way[:-1, 1], 0]
    return np.maximum.accumulate(behind[passed, np.arange(len(passed))])


def gates_of(needs: Nodes) -> tuple[Gate, ...]:
    """Nodes at which more is needed than before, and what, see `needs_of`."""
    rises = np.flatnonzero(needs[1:] > needs[:-1]) + 1
    if needs[0]:
        rises = np.append(0, rises)
    return tuple(zip(rises.tolist(), needs[rises].tolist(), strict=True))


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
