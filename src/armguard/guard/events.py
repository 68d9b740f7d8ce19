"""Events: spans of cycles in which one pair, or one fault, decided the level."""

from dataclasses import dataclass

from armguard.guard.levels import Level, Reason
from armguard.guard.verdict import Verdict


@dataclass(slots=True)
class Event:
    """A span of cycles above `Level.CLEAR` with one cause.

    Attributes:
        first: Its first cycle, counted from 0.
        last: Its last cycle.
        level: Highest level in it.
        reason: Reason of the worst cycle.
        a: Body A of the deciding pair, or the joint a fault is about, or "".
        b: Body B, or "".
        least_clearance: Least clearance in it [m]; NaN for a fault.
        distance: Signed distance at that cycle [m]; NaN for a fault.
        at: The cycle of the least clearance.
        stamp: Its stamp [s], or None.
        why: What the verdict said then.
    """

    first: int
    last: int
    level: Level
    reason: Reason
    a: str
    b: str
    least_clearance: float
    distance: float
    at: int
    stamp: float | None
    why: str

    def to_dict(self) -> dict[str, object]:
        """The event as plain numbers and strings, ready for JSON."""
        return {
            "first": self.first,
            "last": self.last,
            "level": self.level.name,
            "reason": self.reason.name,
            "a": self.a,
            "b": self.b,
            "least_clearance": finite_or_none(self.least_clearance),
            "distance": finite_or_none(self.distance),
            "at": self.at,
            "stamp": self.stamp,
            "why": self.why,
        }


def finite_or_none(value: float) -> float | None:
    """A number JSON can hold."""
    return value if value == value else None


class EventLog:
    """Collects the events of a run.

    Attributes:
        events: Events so far; the last may still be going on.
        levels: Cycles at each level.
        faults: Cycles whose input could not be judged.
        least_clearance: Least clearance of all cycles [m]; inf if no pair was near.
    """

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.levels = dict.fromkeys(Level, 0)
        self.faults = 0
        self.least_clearance = float("inf")
        self._cycle = -1

    def add(self, verdict: Verdict) -> Event | None:
        """Take in the next cycle.

        Returns:
            The event this cycle opens or raises to a stop, None if nothing is new.
        """
        self._cycle += 1
        level, reason = verdict.level, verdict.reason
        self.levels[level] += 1
        if level is Level.CLEAR:
            return None
        nearest = verdict.nearest
        if reason in (Reason.NEAR, Reason.TOO_CLOSE) and nearest is not None:
            a, b = nearest.a, nearest.b
            clearance, distance = nearest.clearance, nearest.distance
            self.least_clearance = min(self.least_clearance, clearance)
        else:
            self.faults += 1
            a, b = verdict.joint or "", ""
            clearance = distance = float("nan")
        open_event = self.events[-1] if self.events else None
        if (
            open_event is not None
            and open_event.last == self._cycle - 1
            and (open_event.a, open_event.b) == (a, b)
            and (open_event.reason >= Reason.NOT_FINITE)
            == (reason >= Reason.NOT_FINITE)
        ):
            raised = level > open_event.level
            open_event.last = self._cycle
            open_event.level = max(open_event.level, level)
            open_event.reason = max(open_event.reason, reason)
            if clearance < open_event.least_clearance:
                open_event.least_clearance = clearance
                open_event.distance = distance
                open_event.at = self._cycle
                open_event.stamp = verdict.stamp
                open_event.why = verdict.why
            return open_event if raised else None
        event = Event(
            first=self._cycle,
            last=self._cycle,
            level=level,
            reason=reason,
            a=a,
            b=b,
            least_clearance=clearance,
            distance=distance,
            at=self._cycle,
            stamp=verdict.stamp,
            why=verdict.why,
        )
        self.events.append(event)
        return event
