"""Events: spans of cycles in which one pair, or one fault, decided the level."""

from dataclasses import asdict, dataclass

from armguard.guard.levels import Level, Reason
from armguard.guard.sentences import ABOUT_PAIRS
from armguard.guard.verdict import Verdict, finite

# Reasons of a stop that was ordered in an earlier cycle.
AFTERWARDS = (Reason.STOPPING, Reason.RESTING, Reason.UNPROVEN)


@dataclass(slots=True)
class Event:
    """A span of cycles above `Level.CLEAR` with one cause.

    Attributes:
        first: Its first cycle, counted from 0.
        last: Its last cycle.
        level: Highest level in it.
        reason: Why it got as far as that level; of a stop, why it was ordered.
        a: Body A of the deciding pair, or who a fault is about, or "".
        b: Body B, or "".
        least_clearance: Least clearance in it [m]; NaN for a fault, or where the pair
            is beyond the margin.
        distance: Signed distance at that cycle [m]; NaN likewise.
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
        answer = {
            **asdict(self),
            "level": self.level.name,
            "reason": self.reason.name,
        }
        return {key: finite(value) for key, value in answer.items()}


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
            The event this cycle opens or raises to a higher level, None if nothing is
            new.
        """
        self._cycle += 1
        level, reason = verdict.level, verdict.reason
        self.levels[level] += 1
        if level is Level.CLEAR:
            return None
        self.faults += reason >= Reason.NOT_FINITE
        nearest = verdict.nearest
        a, b = verdict.subject, ""
        clearance = distance = float("nan")
        if reason in ABOUT_PAIRS and nearest is not None:
            a, b = nearest.a, nearest.b
            clearance, distance = nearest.clearance, nearest.distance
            self.least_clearance = min(self.least_clearance, clearance)
        last = self.events[-1] if self.events else None
        if last is not None and self._goes_on(last, reason, (a, b)):
            raised = level > last.level
            if raised and reason not in AFTERWARDS:
                last.reason = reason
            last.last = self._cycle
            last.level = max(last.level, level)
            # Written so that the first clearance replaces a NaN.
            nearer = not last.least_clearance <= clearance
            if (a, b) == (last.a, last.b) and clearance == clearance and nearer:
                last.least_clearance = clearance
                last.distance = distance
                last.at = self._cycle
                last.stamp = verdict.stamp
                last.why = verdict.why
            return last if raised else None
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

    def _goes_on(self, event: Event, reason: Reason, sides: tuple[str, str]) -> bool:
        """Whether this cycle belongs to the last event.

        What an ordered stop takes belongs to what it was ordered for.
        """
        if event.last != self._cycle - 1:
            return False
        if reason in AFTERWARDS and event.level >= Level.STOP:
            return True
        same_kind = (event.reason >= Reason.NOT_FINITE) == (reason >= Reason.NOT_FINITE)
        return (event.a, event.b) == sides and same_kind
