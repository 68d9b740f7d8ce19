"""A way from one configuration to another that the guard certifies, if one is found."""

from collections.abc import Callable

import numpy as np

from arrays import Floats

# Longest edge of a tree, in shares of what the joints can do [-].
EDGE = 0.25

# Two ends of edges that are so near are the same [rad or m].
SAME = 1e-9


class Tree:
    """Configurations, and which each was reached from."""

    def __init__(self, root: Floats) -> None:
        self.nodes = [root]
        self.parents = [-1]

    def nearest(self, q: Floats, room: Floats) -> int:
        """The node nearest to a configuration, joints in shares of their room."""
        away = (np.array(self.nodes) - q) / room
        return int(np.argmin((away * away).sum(axis=1)))

    def add(self, q: Floats, parent: int) -> int:
        """A new node; its number."""
        self.nodes.append(q)
        self.parents.append(parent)
        return len(self.nodes) - 1

    def way_to(self, node: int) -> list[Floats]:
        """Configurations from the root to a node."""
        way = []
        while node >= 0:
            way.append(self.nodes[node])
            node = self.parents[node]
        return way[::-1]


def find_way(
    start: Floats,
    goal: Floats,
    low: Floats,
    high: Floats,
    is_clear: Callable[[Floats, Floats], bool],
    rng: np.random.Generator,
    edges: int,
) -> list[Floats] | None:
    """A way of straight lines in joint space, each of them clear; shortened.

    Args:
        start: First configuration, shape (n,).
        goal: Last configuration, shape (n,).
        low: Least positions that are tried, shape (n,).
        high: Greatest; joints with no room between stay, shape (n,).
        is_clear: Whether the straight line between two configurations is certified.
        rng: Where random configurations come from.
        edges: How many lines may be judged.

    Returns:
        Configurations from start to goal; None if none was found.

    References:
        Kuffner and LaValle, RRT-connect: an efficient approach to single-query path
        planning, 2000.
    """
    room = np.maximum(high - low, 1e-6)
    ours, theirs = Tree(start), Tree(goal)
    spent = 0
    while spent < edges:
        aim = rng.uniform(low, high)
        spent += 1
        node = extend(ours, aim, room, is_clear)
        if node is not None:
            met: int | None = 0
            while met is not None and spent < edges:
                spent += 1
                met = extend(theirs, ours.nodes[node], room, is_clear)
                if met is not None and same(theirs.nodes[met], ours.nodes[node]):
                    way = ours.way_to(node) + theirs.way_to(met)[::-1][1:]
                    if way[0] is not start:
                        way = way[::-1]
                    return shortened(way, is_clear, rng, edges // 4)
        ours, theirs = theirs, ours
    return None


def extend(
    tree: Tree, aim: Floats, room: Floats, is_clear: Callable[[Floats, Floats], bool]
) -> int | None:
    """Grow a tree towards a configuration by an edge; the new node, if it is clear."""
    near = tree.nearest(aim, room)
    step = aim - tree.nodes[near]
    length = float(np.sqrt(((step / room) ** 2).mean()))
    q = aim if length <= EDGE else tree.nodes[near] + step * EDGE / length
    return tree.add(q, near) if is_clear(tree.nodes[near], q) else None


def same(a: Floats, b: Floats) -> bool:
    """Whether two configurations are one."""
    return bool((np.abs(a - b) <= SAME).all())


def shortened(
    way: list[Floats],
    is_clear: Callable[[Floats, Floats], bool],
    rng: np.random.Generator,
    tries: int,
) -> list[Floats]:
    """A way with corners cut off where that is clear."""
    for _ in range(tries):
        if len(way) < 3:
            break
        i, k = sorted(rng.choice(len(way), 2, replace=False).tolist())
        if k - i > 1 and is_clear(way[i], way[k]):
            way = way[: i + 1] + way[k:]
    return way
