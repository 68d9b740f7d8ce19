"""True distances of the gantry and of what it carries, by closed forms."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from arrays import Floats
from gripping.gantry import BELOW, CLOSED, FINGER, HAND
from gripping.workplace import Solid, Workplace, box, gaps

PARTS = ("hand", "left", "right")
FINGERS = ("left", "right")

# The part of the arm that is what it holds.
HELD = "held"

Pair = tuple[str, str]


@dataclass
class Findings:
    """What an episode came to.

    Attributes:
        touched: Unintended contacts: part of the arm, what it touched, and the cycle.
        least: Least distance of what is not intended to touch [m].
        depth: Greatest overlap of what is intended to touch [m].
        speed: Greatest closing speed of an intended contact when it begins [m/s].
        intended: Contacts that were intended and happened.
        slipped: How far a finger moved while the gripper held something [m].
    """

    touched: list[tuple[str, str, int]] = field(default_factory=list)
    least: float = np.inf
    depth: float = 0.0
    speed: float = 0.0
    intended: set[Pair] = field(default_factory=set)
    slipped: float = 0.0

    def figures(self, *names: str) -> dict[str, Any]:
        """The figures of every kind of episodes, and those of these names."""
        names = ("touched", "least", "depth", "speed", *names)
        return {name: getattr(self, name) for name in names}


class Judge:
    """Looks at true states, one stretch of time after the other.

    Attributes:
        findings: What was found so far.
        solids: What is where, by name.
        held: Name of what is carried, None if nothing is.

    Args:
        place: The workplace.
        period: Time from one row to the next [s].
    """

    def __init__(self, place: Workplace, period: float) -> None:
        self.solids = {**place.fixtures, **place.objects}
        self.period = period
        self.findings = Findings()
        self.held: str | None = None
        self._offset = np.zeros(3)
        self._fingers = np.zeros(2)
        self._seen = 0

    def grasp(self, q: Floats, name: str) -> None:
        """From now on something is carried."""
        self.held = name
        self._offset = self.solids[name].at - q[:3]
        self._fingers = q[3:]

    def release(self, q: Floats) -> None:
        """From now on it stays where it is."""
        if self.held is not None:
            solid = self.solids[self.held]
            self.solids[self.held] = solid.moved_to(q[:3] + self._offset)
            self.held = None

    def gap(self, q: Floats, part: str, other: str) -> float:
        """True distance of a part of the arm and something else [m]."""
        return float(gaps(self._arm(q)[part], self.solids[other]))

    def look(self, rows: list[Floats], may_touch: set[Pair]) -> None:
        """Judge the rows that are new; the same is carried and intended in all of them.

        Args:
            rows: True positions of all cycles so far, shape (5,) each [m].
            may_touch: Contacts that are intended: part of the arm, and what it touches.
        """
        if len(rows) == self._seen:
            return
        # The last row that was judged is where contacts of the next one begin.
        begin = max(self._seen - 1, 0)
        new = np.array(rows[begin:])
        self._seen = len(rows)
        if self.held is not None:
            fingers = new[:, -len(self._fingers) :]
            slipped = float(np.abs(fingers - self._fingers).max())
            self.findings.slipped = max(self.findings.slipped, slipped)
        for pair, found in self._distances(new):
            if pair in may_touch:
                self._intended(pair, found)
            else:
                self._unintended(pair, found, begin)

    def _distances(self, q: Floats) -> Iterator[tuple[Pair, Floats]]:
        """True distances of each pair in rows of positions, shape (n,) [m]."""
        for part, solid in self._arm(q).items():
            for name, other in self.solids.items():
                # What is gripped presses against its gripper, and that is no contact.
                if name != self.held:
                    yield (part, name), gaps(solid, other)

    def _arm(self, q: Floats) -> dict[str, Solid]:
        """Bodies of the arm, and what it holds, at rows or at one."""
        hand = q[..., :3]
        found = {"hand": box(HAND, hand)}
        for part, joint, side in (("left", 3, 1.0), ("right", 4, -1.0)):
            middle = hand + np.array([0.0, 0.0, -BELOW])
            middle[..., 1] += side * (CLOSED + q[..., joint])
            found[part] = box(FINGER, middle)
        if self.held is not None:
            found[HELD] = self.solids[self.held].moved_to(hand + self._offset)
        return found

    def _intended(self, pair: Pair, found: Floats) -> None:
        """Note depth and speed of a contact that is intended."""
        out = self.findings
        least = float(found.min())
        if least > 0.0:
            return
        out.intended.add(pair)
        out.depth = max(out.depth, -least)
        begins = (found[:-1] > 0.0) & (found[1:] <= 0.0)
        closing = (found[:-1] - found[1:]) / self.period
        out.speed = max(out.speed, float(closing[begins].max(initial=0.0)))

    def _unintended(self, pair: Pair, found: Floats, begin: int) -> None:
        """Note how near something came that is not intended."""
        out = self.findings
        k = int(np.argmin(found))
        out.least = min(out.least, float(found[k]))
        if not found[k] > 0.0:
            out.touched.append((*pair, begin + k))
