"""What an operator of a trial wants: drawn at random, with a way that is certified."""

from dataclasses import dataclass, replace

import numpy as np

from arrays import Floats
from reach.arena import Arena
from reach.operators import Joints, Operator, Tools
from reach.ways import find_way

# Configurations tried for a start or a goal that keeps every buffer.
TRIES = 4000

# What every pair has left at a start: no start is where he is held since errors of
# measurement may hide that he is too near [m].
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
        """Who wants it.

        Args:
            arena: Where.
            led: Whether he follows the certified way; else he steers straight at it.
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
        if nearest is None or nearest.clearance >= room:
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
