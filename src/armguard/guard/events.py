"""Events: sequences of cycles in which one pair, or one fault, decided the level."""

from dataclasses import asdict, dataclass

from armguard.guard.levels import Level, Reason
from armguard.guard.sentences import ABOUT_PAIRS
from armguard.guard.verdict import Verdict, finite

# Reasons of a stop that was ordered in an earlier cycle.
AFTERWARDS = (Reason.STOPPING, Reason.RESTING, Reason.UNPROVEN)


@dataclass(slots=True)
class Event:
    """A sequence of cycles above `Level.CLEAR` with one cause.

    Attributes:
        first: Its first cycle, counted from 0.
        last: Its last cycle.
        level: Highest level in it.
        reason: Reason of that level; of a stop, the reason of its order.
        a: Body A of the deciding pair, or the subject of a fault, or "".
        b: Body B, or "".
        least_clearance: Least clearance in it [m]; NaN for a fault, or where the pair
            is beyond the margin.
        distance: Signed distance in the cycle of the least clearance [m], or NaN.
        at: The cycle of the least clearance.
        stamp: Stamp of that cycle [s], or None.
        why: Sentence of the verdict of that cycle.
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
        events: Events so far; the last may not have ended.
        levels: Count of cycles at each level.
        faults: Count of cycles whose input could not be judged.
        least_clearance: Least clearance of all cycles [m]; inf if no pair was near.
    """

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.levels = dict.fromkeys(Level, 0)
        self.faults = 0
        self.least_clearance = float("inf")
        self._cycle = -1

    def add(self, verdict: Verdict) -> Event | None:
        """Add the verdict of the next cycle.

        Returns:
            The event that this cycle opens or raises to a higher level, else None.
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
            # In this form the first clearance replaces a NaN.
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

        The cycles of an ordered stop belong to the event that it was ordered for.
        """
        if event.last != self._cycle - 1:
            return False
        if reason in AFTERWARDS and event.level >= Level.STOP:
            return True
        same_kind = (event.reason >= Reason.NOT_FINITE) == (reason >= Reason.NOT_FINITE)
        return (event.a, event.b) == sides and same_kind
