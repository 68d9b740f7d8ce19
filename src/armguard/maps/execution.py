"""Plans executed as a cell controller does it: as fast as interlocks allow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.maps.interlocks import Interlock

Floats = NDArray[np.float64]

# Cycle of the controller [s].
CYCLE = 0.008


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """Where robots were on their plans.

    Attributes:
        robots: The robots.
        times: Of each cycle, shape (k,) [s].
        plan_times: Time on each robot's plan then, shape (k, robots) [s].
        blocked: The interlocks that robots wait for at last, if they wait in a circle.
    """

    robots: tuple[str, ...]
    times: Floats
    plan_times: Floats
    blocked: tuple[Interlock, ...]

    @property
    def finished(self) -> bool:
        """Whether all plans were executed to their ends."""
        return not self.blocked


def executed(
    interlocks: Sequence[Interlock],
    spans: Mapping[str, tuple[float, float]],
    *,
    paces: Mapping[str, float] | None = None,
    cycle: float = CYCLE,
) -> Execution:
    """Execute plans as fast as interlocks allow.

    Each robot goes on at its pace, but not beyond a place at which it waits. A robot
    is seen to have passed a place one cycle after it has.

    Args:
        interlocks: What robots wait for.
        spans: Start and end of each robot's plan [s].
        paces: How fast each robot is, as a share of its plan's pace; 1 by default [-].
        cycle: Cycle of the controller [s].
    """
    names = tuple(spans)
    starts, ends = np.array(list(spans.values())).T
    pace = np.array([1.0 if paces is None else paces.get(name, 1.0) for name in names])
    rules = [
        (names.index(one.waiting.robot), names.index(one.other.robot), one)
        for one in interlocks
    ]
    now, found = starts.copy(), [starts.copy()]
    while (now < ends).any():
        goal = np.minimum(now + cycle * pace, ends)
        for r, s, one in rules:
            if now[s] < one.until and now[r] <= one.at:
                goal[r] = min(goal[r], one.at)
        if (goal == now).all():
            break
        now = goal
        found.append(now)
    waiting = [
        one
        for r, s, one in rules
        if now[s] < one.until and now[r] == one.at and now[r] < ends[r]
    ]
    return Execution(
        robots=names,
        times=cycle * np.arange(len(found), dtype=np.float64),
        plan_times=np.array(found),
        blocked=tuple(waiting) if (now < ends).any() else (),
    )
