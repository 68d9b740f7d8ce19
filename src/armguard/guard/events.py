"""Events: episodes of a level, with the pair or the fault that decided it."""

from dataclasses import asdict, dataclass
from math import isfinite, nan

from armguard.guard.levels import Level, Reason
from armguard.guard.sentences import ABOUT_PAIRS
from armguard.guard.verdict import Verdict, finite

# Reasons of a stop that was ordered in an earlier cycle.
AFTERWARDS = (Reason.STOPPING, Reason.RESTING, Reason.UNPROVEN)

# Time below an event's level after which the event is over [s]. An event that is
# younger when the level rises is raised to the new level.
PAUSE = 0.5


@dataclass(slots=True)
class Event:
    """Episode at one level, from its first to its last cycle at that level.

    Shorter times below the level do not divide it. `STOP` and all levels above count
    as one level, so a stop is one event until it is over.

    Attributes:
        first: Its first cycle, counted from 0.
        last: Its last cycle.
        began: Stamp of its first cycle [s]; NaN if the cycles have no stamps.
        ended: Stamp of its last cycle [s], or NaN.
        level: Highest level in it; a rest after a stop is not higher than the stop.
        reason: Reason of that level; of a stop, the reason of its order.
        a: Body A of the worst pair, or the subject of a fault, or "".
        b: Body B, or "".
        least_headroom: Least headroom of that pair at that level [m]; NaN for a
            fault, or where the pair is beyond the margin.
        distance: Signed distance in the cycle of the least headroom [m], or NaN.
        at: The cycle of the least headroom.
        stamp: Stamp of that cycle [s], or None.
        why: Sentence of the verdict of the worst cycle; of a stop, of its order.
    """

    first: int
    last: int
    began: float
    ended: float
    level: Level
    reason: Reason
    a: str
    b: str
    least_headroom: float
    distance: float
    at: int
    stamp: float | None
    why: str

    @property
    def seconds(self) -> float:
        """Its duration [s]; NaN if the cycles have no stamps."""
        return self.ended - self.began

    @property
    def rank(self) -> Level:
        """Its level; `STOP` for all levels above."""
        return min(self.level, Level.STOP)

    def absorb(self, other: "Event") -> None:
        """Extend it to the end of a later one, whose cause it takes over if worse."""
        self.last, self.ended = other.last, other.ended
        follows = other.reason in AFTERWARDS and self.level >= Level.STOP
        worse = severity(other.level) > severity(self.level) or (
            self.reason in AFTERWARDS and not follows and other.rank == self.rank
        )
        beyond = self.reason in ABOUT_PAIRS and not isfinite(self.least_headroom)
        nearer = other.level == self.level and (
            other.least_headroom < self.least_headroom
            or (beyond and isfinite(other.least_headroom))
        )
        if follows and (other.a, other.b) != (self.a, self.b):
            return
        if worse:
            self.level = other.level
        if worse or nearer or (follows and other.least_headroom < self.least_headroom):
            self.least_headroom, self.distance = other.least_headroom, other.distance
            self.at, self.stamp = other.at, other.stamp
            if not follows:
                self.reason, self.why = other.reason, other.why
                self.a, self.b = other.a, other.b

    def to_dict(self) -> dict[str, object]:
        """The event as plain numbers and strings, ready for JSON."""
        answer = {
            **asdict(self),
            "seconds": self.seconds,
            "level": self.level.name,
            "reason": self.reason.name,
        }
        return {key: finite(value) for key, value in answer.items()}


def severity(level: Level) -> int:
    """Rank of a level among events: a rest after a stop is below the stop."""
    return Level.STOP - 1 if level is Level.RECOVER else level


class EventLog:
    """Collects the events of a run.

    Cycles may be left out where the level does not change.

    Attributes:
        events: Events so far; the last may not have ended.
        open: Event that has not ended; None if there is none.
        levels: Count of cycles at each level.
        faults: Count of cycles whose input could not be judged.
        least_headroom: Least headroom of all cycles [m]; inf if no pair was near.
        start: Stamp of the first cycle [s]; NaN if it has none.

    Args:
        least: Level from which a cycle belongs to an event.
    """

    def __init__(self, least: Level = Level.CAUTION) -> None:
        self.events: list[Event] = []
        self.open: Event | None = None
        self.levels = dict.fromkeys(Level, 0)
        self.faults = 0
        self.least_headroom = float("inf")
        self.start = nan
        self._least = least
        self._cycle = -1
        # While the level is below that of the open event: since when, and what may
        # become the next event.
        self._fell: float | None = None
        self._lower: Event | None = None

    def add(self, verdict: Verdict) -> Event | None:
        """Add the verdict of the next cycle.

        Returns:
            The event that has ended, which is known `PAUSE` after its end; None if
            none has.
        """
        self._cycle += 1
        level, stamp = verdict.level, nan if verdict.stamp is None else verdict.stamp
        if not self._cycle:
            self.start = stamp
        self.levels[level] += 1
        cycle = self._event_of(verdict, stamp) if level > Level.CLEAR else None
        if cycle is not None and level < self._least:
            cycle = None
        before, rank = self.open, Level.CLEAR if cycle is None else cycle.rank
        if before is None:
            return self._go_on(cycle)
        if rank < before.rank:
            self._fell = stamp if self._fell is None else self._fell
            if self._lower is None:
                self._lower = cycle
            elif cycle is not None:
                self._lower.absorb(cycle)
            return None if stamp - self._fell < PAUSE else self._go_on(self._lower)
        assert cycle is not None
        if rank > before.rank and not stamp - before.began < PAUSE:
            return self._go_on(cycle)
        self._fell = self._lower = None
        before.absorb(cycle)
        return None

    def finish(self) -> Event | None:
        """End the open event.

        Returns:
            The event; None if none is open.
        """
        return self._go_on(None)

    def _go_on(self, after: Event | None) -> Event | None:
        """End the open event, and open another one."""
        before, self.open = self.open, after
        self._fell = self._lower = None
        if after is not None:
            self.events.append(after)
        return before

    def _event_of(self, verdict: Verdict, stamp: float) -> Event:
        """A cycle above `Level.CLEAR` as an event; counts its fault or headroom."""
        reason, nearest = verdict.reason, verdict.nearest
        self.faults += reason >= Reason.NOT_FINITE
        a, b = verdict.subject, ""
        headroom = distance = nan
        if reason in ABOUT_PAIRS and nearest is not None:
            a, b = nearest.a, nearest.b
            headroom, distance = nearest.headroom, nearest.distance
            self.least_headroom = min(self.least_headroom, headroom)
        return Event(
            first=self._cycle,
            last=self._cycle,
            began=stamp,
            ended=stamp,
            level=verdict.level,
            reason=reason,
            a=a,
            b=b,
            least_headroom=headroom,
            distance=distance,
            at=self._cycle,
            stamp=verdict.stamp,
            why=verdict.why,
        )
