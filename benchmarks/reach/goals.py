"""What an operator of a trial wants: drawn at random, with a way that is certified."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from arrays import Floats
from reach.arena import Arena
from reach.operators import Joints, Operator, Tools

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


# Configurations tried for a start or a goal that keeps every buffer.
TRIES = 4000

# What every pair has left at a start: at no start is a robot held because errors of
# measurement may hide that it is too near [m].
START_ROOM = 0.02

# Lines judged before a goal counts as one without a way.
EDGES = 120

# Shares of the top speeds operators use [-].
SHARES = (0.2, 0.6)

# Goals in turns: of joints, of joints, of tools.
TURNS = ("joints", "joints", "tools")

# Tools are sent no farther than this from where they are, by each joint [rad].
NEARBY = 1.0

# Step in which an unobstructed tool is followed [s], and where its way is judged.
STEP = 0.01
SAMPLE = 5


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal and how to get there.

    Attributes:
        seed: Its number.
        kind: "joints" or "tools".
        start: Where the robots are at first, shape (n,).
        q: A configuration of the goal, shape (n,).
        share: Share of the top speeds the operator uses [-].
        road: "straight" if the operator's own way is certified, "bends" if another one
            is, "none" if none was found, "out of reach" if nothing was in the way and
            the tools did not get there all the same.
        way: Configurations of the certified way, the start left out.
    """

    seed: int
    kind: str
    start: Floats
    q: Floats
    share: float
    road: str
    way: tuple[Floats, ...]

    def operator(self, arena: Arena, led: bool) -> Operator:
        """The operator with this goal.

        Args:
            arena: Where.
            led: Whether to follow the certified way, not a straight line to the goal.
        """
        if led:
            return Joints(arena, self.way, self.share).start(self.start)
        if self.kind == "joints":
            return Joints(arena, [self.q], self.share).start(self.start)
        return Tools(arena, arena.tool_poses(self.q), self.share).start(self.start)


def draw_goal(arena: Arena, seed: int) -> Goal:
    """The goal of a trial; the same number is the same goal."""
    rng = np.random.default_rng([seed, 2026])
    kind = TURNS[seed % len(TURNS)]
    start = free_state(arena, rng, arena.lower, arena.upper, START_ROOM)
    low, high = arena.lower, arena.upper
    if kind == "tools":
        low, high = np.maximum(low, start - NEARBY), np.minimum(high, start + NEARBY)
    q = free_state(arena, rng, low, high)
    share = float(rng.uniform(*SHARES))
    goal = Goal(seed, kind, start, q, share, "none", ())
    if kind == "tools":
        followed = unobstructed(arena, goal)
        if followed is None:
            return replace(goal, road="out of reach")
        if arena.checker.check_path(followed).clear:
            return replace(goal, road="straight", way=tuple(followed[1:]))
    elif arena.is_clear(start, q):
        return replace(goal, road="straight", way=(q,))
    if kind == "tools" and arena.is_clear(start, q):
        return replace(goal, road="bends", way=(q,))
    low = np.where(arena.driven, arena.lower, arena.home)
    high = np.where(arena.driven, arena.upper, arena.home)
    way = find_way(start, q, low, high, arena.is_clear, rng, EDGES)
    return goal if way is None else replace(goal, road="bends", way=tuple(way[1:]))


def free_state(
    arena: Arena,
    rng: np.random.Generator,
    low: Floats,
    high: Floats,
    room: float = 0.0,
) -> Floats:
    """A random configuration that keeps every buffer, shape (n,).

    Args:
        arena: Where.
        rng: Where it comes from.
        low: Least positions, shape (n,).
        high: Greatest positions, shape (n,).
        room: What every pair has left there [m].

    Raises:
        RuntimeError: None was found.
    """
    for _ in range(TRIES):
        q = arena.home.copy()
        drawn = rng.uniform(low, high)
        q[arena.driven] = drawn[arena.driven]
        if not arena.checker.check_path([q]).clear:
            continue
        nearest = arena.checker.judge_at_rest(q).nearest
        if nearest is None or nearest.headroom >= room:
            return q
    raise RuntimeError(f"no configuration keeps its buffers in {TRIES} tries")


def unobstructed(arena: Arena, goal: Goal) -> list[Floats] | None:
    """Where a tool's operator would lead robots that nothing hinders; None if nowhere.

    Joints stop at their limits.
    """
    operator = goal.operator(arena, led=False)
    q = goal.start.copy()
    found = [q.copy()]
    for k in range(int(2.0 * operator.nominal / STEP) + 100):
        v = operator.ask(q, STEP).joints
        v = v / max(1.0, float((np.abs(v) / arena.velocity).max()))
        q = np.clip(q + STEP * v, arena.lower, arena.upper)
        if k % SAMPLE == 0:
            found.append(q.copy())
        if operator.left(q) < 0.3:
            return [*found, q.copy()]
    return None
