"""Interlocks of a schedule: what a cell controller has to wait for, and no more.

A schedule leads past every blocked region on one side. Behind it one robot waits at a
place of its plan until the other has passed one of its own. With these waits alone no
pace of the robots leads into a blocked region. Since some schedule obeys them all, the
robots never wait for each other in a circle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import Segment

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Nodes = NDArray[np.intp]

# A robot waits so much before what is blocked, and the other has to be so far past it;
# times that differ by less are the same [s].
CLEAR = 1e-6


@dataclass(frozen=True, slots=True)
class Axis:
    """A robot's plan on an axis of a grid.

    Attributes:
        robot: The robot.
        start: Time at which its plan begins [s].
        end: Time at which it ends [s].
        step: Side of a cell [s].
        segments: Its named segments.
    """

    robot: str
    start: float
    end: float
    step: float
    segments: tuple[Segment, ...]

    def time(self, node: int) -> float:
        """Time of the plan at a node [s]."""
        return min(self.start + self.step * node, self.end)

    def begun(self, time: float) -> Segment:
        """The segment that a time is in, or that begins there."""
        starts = [one.start for one in self.segments]
        place = int(np.searchsorted(starts, time + 2.0 * CLEAR, side="right")) - 1
        return self.segments[max(place, 0)]

    def passed(self, time: float) -> Segment:
        """The segment that a time is in, or that ends there."""
        ends = [one.end for one in self.segments]
        place = int(np.searchsorted(ends, time - 2.0 * CLEAR))
        return self.segments[min(place, len(ends) - 1)]


@dataclass(frozen=True, slots=True)
class Interlock:
    """A robot waits until another one has passed a place of its plan.

    Attributes:
        waiting: The robot that waits.
        at: Where on its plan, in time of that [s].
        other: The robot that it waits for.
        until: What that has to have passed of its plan [s].
    """

    waiting: Axis
    at: float
    other: Axis
    until: float

    @property
    def sentence(self) -> str:
        """The interlock in words."""
        own, past = self.waiting.begun(self.at), self.other.passed(self.until)
        place, over = f"before `{own.name}`", f"has passed `{past.name}`"
        if self.at > own.start + 2.0 * CLEAR:
            place = f"{self.at - own.start:.3f} s into `{own.name}`"
        if self.until < past.end - 2.0 * CLEAR:
            over = f"is {self.until - past.start:.3f} s into `{past.name}`"
        return f"{self.waiting.robot} waits {place} until {self.other.robot} {over}"

    def keeps_out(self, shape: tuple[int, ...]) -> Bools:
        """Cells that it keeps both robots out of, the other robot's axis first.

        Args:
            shape: Cells of both axes.
        """
        found = np.zeros(shape, dtype=bool)
        step = self.waiting.step
        last = np.ceil((self.until - self.other.start - CLEAR) / step - CLEAR)
        first = np.floor((self.at - self.waiting.start + CLEAR) / step + CLEAR)
        found[: int(last), int(first) :] = True
        return found


@dataclass(frozen=True, slots=True, eq=False)
class PairOfPlans:
    """The diagram of two robots, and a schedule through it.

    Attributes:
        one: The robot on the first axis.
        other: The robot on the second.
        blocked: Cells, shape (k, m).
        way: Nodes of the schedule, each followed by that after one step, shape (n, 2).
        accepts: Whether cells may be blocked that the schedule leads through.
    """

    one: Axis
    other: Axis
    blocked: Bools
    way: Nodes
    accepts: Callable[[Bools], bool]

    def interlocks(self) -> list[Interlock]:
        """The fewest interlocks that can be found."""
        first = waits_for(self.blocked, self.way, self.one, self.other)
        second = waits_for(self.blocked.T, self.way[:, ::-1], self.other, self.one)
        first = self._merged(first, second)
        second = self._merged(second, first)
        found = first + second
        for k, rule in enumerate(found):
            found[k] = self._at_segments(rule, found[:k] + found[k + 1 :])
        for rule in tuple(found):
            others = [one for one in found if one is not rule]
            if not (self.blocked & ~self._kept_out(others)).any():
                found = others
        return found

    def _kept_out(self, rules: Sequence[Interlock]) -> Bools:
        """Cells that interlocks keep both robots out of, shape (k, m)."""
        found = np.zeros_like(self.blocked)
        for rule in rules:
            if rule.waiting is self.other:
                found |= rule.keeps_out(found.shape)
            else:
                found |= rule.keeps_out(found.T.shape).T
        return found

    def _may_have(self, rules: Sequence[Interlock]) -> bool:
        """Whether a schedule that is quick enough obeys some interlocks."""
        return self.accepts(self.blocked | self._kept_out(rules))

    def _merged(
        self, rules: list[Interlock], others: list[Interlock]
    ) -> list[Interlock]:
        """Fewer interlocks of one robot, if these may be stricter.

        Args:
            rules: Its interlocks, in their order.
            others: All others.
        """
        if len(rules) < 2:
            return rules
        whole = replace(rules[0], until=rules[-1].until)
        if self._may_have([whole, *others]):
            return [whole]
        half = len(rules) // 2
        first = self._merged(rules[:half], [*others, *rules[half:]])
        second = self._merged(rules[half:], [*others, *first])
        joined = replace(first[-1], until=second[0].until)
        rest = [*first[:-1], *second[1:]]
        if self._may_have([joined, *rest, *others]):
            return [*first[:-1], joined, *second[1:]]
        return first + second

    def _at_segments(self, rule: Interlock, others: list[Interlock]) -> Interlock:
        """An interlock where segments begin and end, if it may be stricter."""
        early = max(rule.waiting.begun(rule.at).start - CLEAR, rule.waiting.start)
        late = rule.other.passed(rule.until).end
        late = min(late + CLEAR, rule.other.end)
        for at, until in ((early, late), (early, rule.until), (rule.at, late)):
            named = replace(rule, at=at, until=until)
            if self._may_have([named, *others]):
                return named
        return rule


def waits_for(blocked: Bools, way: Nodes, one: Axis, other: Axis) -> list[Interlock]:
    """The fewest interlocks with which the second robot waits and a schedule agrees.

    Args:
        blocked: Cells, shape (k, m).
        way: Nodes of the schedule, shape (n, 2).
        one: The robot on the first axis.
        other: The robot on the second, which waits.
    """
    # Node of the first robot when the second leaves each of its nodes.
    passed = way[np.flatnonzero(np.diff(way[:, 1]) > 0), 0]
    # What the first has to have passed before the second goes on from each node.
    needed = np.maximum.accumulate(last_before(blocked, passed))
    found, done = list[Interlock](), 0
    while needed[-1] > done:
        at = int(np.argmax(needed > done))
        done = int(needed[needed <= passed[at]].max())
        until = min(one.time(done) + CLEAR, one.end)
        found.append(Interlock(other, other.time(at) - CLEAR, one, until))
    return found


def last_before(blocked: Bools, passed: Nodes) -> Nodes:
    """Node behind the last blocked cell of each column before a node, 0 without any.

    Args:
        blocked: Cells, shape (k, m).
        passed: That node of each column, shape (m,).
    """
    k = len(blocked)
    behind = blocked & (np.arange(k)[:, None] < passed)
    found = np.where(behind.any(axis=0), k - np.argmax(behind[::-1], axis=0), 0)
    return np.asarray(found, dtype=np.intp)
