"""Causes of slowing and stopping, and the remedy that would have avoided it.

A pair that slows or stops a robot has a negative headroom: the *deficit*. Each cause
is a length too, and explains the stop if it is at least the deficit. If several do, the
first of this order is named, since it needs the smallest remedy:

1. `FIGURES`: a stop or a brake differed from the declared figures.
2. `ORDERED`: a person, a program or the service ordered the stop.
   `DATA`: the input was implausible. A measurement older than its limit is `STALE`.
3. `LIMITS`: the guard's own budget or tables were used up.
4. `STALE`: the travel in the part of the ages beyond the declared delay of
   measurements.
5. `ENVELOPE`: how far the measured shapes may reach beyond the real surfaces; where
   primitives were judged and the exact shapes are known, up to the distance of these.
6. `LATENCY`: the whole travel until a stop takes effect.
7. `TRUE_NEED`: none of these.

Travel grows at least in proportion to time, so the share of a time is at most the
share of the travel: "3 ms sooner" is not said too early.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from armguard.guard.answer import Answer
from armguard.guard.levels import ORDERED, Level, Reason
from armguard.guard.near_pair import NearPair
from armguard.guard.watch import RESTING


class Cause(Enum):
    """Cause of slowing or stopping."""

    TRUE_NEED = "true need"
    ENVELOPE = "envelope"
    LATENCY = "latency"
    STALE = "stale"
    DATA = "data"
    FIGURES = "figures"
    LIMITS = "limits"
    ORDERED = "ordered"


# Remedies that would have avoided an ordered stop; the other ones have none.
REMEDIES = {
    Reason.RESTARTED: "find out from its log why the service was killed",
    Reason.DEADLINE_MISSED: "use a less busy computer, or declare a larger --late",
    Reason.SERVICE_FAULT: "remove the fault that the service's log names",
}

# Reasons that name the guard's own limits.
LIMITING = (Reason.BUDGET_SPENT, Reason.CAPACITY)


@dataclass(frozen=True, slots=True)
class Nuisance:
    """Cause and remedy of slowing or stopping.

    Attributes:
        cause: The cause.
        deficit: Deficit of the deciding pair [m]; None if no pair decided.
        remedy: Change that would have avoided it, in words; empty if there is none.
    """

    cause: Cause
    deficit: float | None
    remedy: str

    @property
    def sentence(self) -> str:
        """Cause, deficit and remedy in words."""
        lacks = "" if self.deficit is None else f", lacks {self.deficit * 1e3:.1f} mm"
        return f"{self.cause.value}{lacks}" + (
            f": {self.remedy}" if self.remedy else ""
        )


@dataclass(frozen=True, slots=True)
class Delayed:
    """Travel of one side of a pair before its stop takes effect.

    Attributes:
        robot: Robot of that side.
        way: Greatest travel before the stop takes effect [m].
        time: Time from the measurement until then [s].
        excess: The part of that time that is age beyond the declared delay [s].
    """

    robot: str
    way: float
    time: float
    excess: float

    @property
    def stale_way(self) -> float:
        """Lower bound of the travel in the excess age [m]."""
        return self.way * self.excess / self.time if self.time > 0.0 else 0.0


@dataclass(frozen=True, slots=True)
class Lack:
    """Deficit of the deciding pair, and the part of each cause in it.

    Attributes:
        deficit: Negative headroom of the pair, or length its time is short by [m].
        envelope: How much farther apart the real surfaces may be than was judged [m].
        delays: Travel of its sides due to delays; empty if unknown.
    """

    deficit: float
    envelope: float
    delays: Sequence[Delayed]


def classify(level: Level, reason: Reason, lack: Lack | None) -> Nuisance | None:
    """Classify why a verdict slows or stops.

    Args:
        level: Level of the verdict.
        reason: Its reason.
        lack: Deficit of the deciding pair; None if no near pair has one.

    Returns:
        The first cause of the order above. None where nothing slows or stops, and in
        later cycles of a stop that have no deficit any more.
    """
    if level < Level.SLOW:
        return None
    deficit = None if lack is None else lack.deficit
    if level >= Level.BRAKE:
        return Nuisance(
            Cause.FIGURES, deficit, "declare figures that the arm keeps when it stops"
        )
    if reason in ORDERED:
        return Nuisance(Cause.ORDERED, None, REMEDIES.get(reason, ""))
    if reason is Reason.CYCLE_LATE:
        return Nuisance(
            Cause.DATA, None, "run cycles within the declared period and late"
        )
    if reason is Reason.STATE_STALE:
        return Nuisance(
            Cause.STALE, None, "deliver measurements within their greatest age"
        )
    if reason in LIMITING:
        return Nuisance(Cause.LIMITS, deficit, "give the guard a larger budget")
    if reason >= Reason.NOT_FINITE:
        return Nuisance(
            Cause.DATA, None, "fix the input (NaN, missing, stale or jumping)"
        )
    if lack is None:
        return unannounced(reason)
    return by_length(lack)


def unannounced(reason: Reason) -> Nuisance | None:
    """Classification where no near pair has a deficit."""
    if reason in (Reason.STOPPING, Reason.RESTING, Reason.UNPROVEN):
        return None
    if reason is Reason.MOVED_AT_REST:
        return Nuisance(Cause.DATA, None, "keep the arm at rest until it is engaged")
    return Nuisance(
        Cause.TRUE_NEED, None, "raise the margin, so that the pair is reported"
    )


def by_length(lack: Lack) -> Nuisance:
    """Classification by the first cause that is at least as long as the deficit."""
    deficit, delays = lack.deficit, lack.delays
    stale = sum(side.stale_way for side in delays)
    if deficit <= stale:
        late = [side for side in delays if side.stale_way > 0.0]
        longest = max(late, key=lambda side: side.excess)
        whose = f" of '{longest.robot}'" if len(late) == 1 else ""
        time = deficit / stale * longest.excess
        return Nuisance(
            Cause.STALE,
            deficit,
            f"deliver measurements{whose} {milliseconds(time)} sooner",
        )
    if deficit <= lack.envelope:
        return Nuisance(
            Cause.ENVELOPE,
            deficit,
            f"fit the links {deficit * 1e3:.1f} mm more closely: their surfaces may be "
            f"{lack.envelope * 1e3:.1f} mm farther apart than measured",
        )
    reaction = sum(side.way for side in delays)
    if deficit <= reaction:
        time = deficit / reaction * max(side.time for side in delays)
        return Nuisance(
            Cause.LATENCY,
            deficit,
            f"react {milliseconds(time)} faster: period, late, or delays",
        )
    return Nuisance(
        Cause.TRUE_NEED,
        deficit,
        f"keep {deficit * 1e3:.1f} mm more distance, or move more slowly",
    )


def milliseconds(time: float) -> str:
    """A time [s] as text in milliseconds, rounded up to a tenth."""
    return f"{time * 1e3 + 0.05:.1f} ms"


def lack_of(reason: Reason, answer: Answer) -> Lack | None:
    """Deficit of the deciding pair, with its causes; None if no near pair has one."""
    k = answer.deciding(reason)
    if k < 0:
        return None
    pair = answer.pair(k)
    deficit = -pair.headroom
    if reason is Reason.SHORT_TIME:
        deficit = pair.short_by
    if not deficit > 0.0:
        return None
    return Lack(deficit, envelope_of(k, pair, reason, answer), delays_of(k, answer))


def envelope_of(k: int, pair: NearPair, reason: Reason, answer: Answer) -> float:
    """How much farther apart a pair's surfaces may be than was judged [m]."""
    names, tables = answer.names, answer.names.tables
    if not names.robots:
        return pair.model_error
    modes = [tables.robots[r].mode for r in answer.robots_of(k) if r >= 0]
    proven = reason is not Reason.SHORT_TIME and "speed" not in modes
    if not proven or not pair.primitive_distance > 0.0:
        # The primitives were judged, even if exact shapes are known.
        return pair.distance + pair.model_error - pair.primitive_distance
    # The proof uses the exact shapes too, where a link has some.
    has_exact = tables.exact.of_primitive[:, 1] > 0
    return sum(
        float((tables.exact.errors if has_exact[i] else tables.model_errors)[i])
        for i in answer.primitives(k)
    )


def delays_of(k: int, answer: Answer) -> tuple[Delayed, ...]:
    """Travel of a pair's sides due to delays; empty for any but the nearest pair."""
    tables, budget = answer.names.tables, answer.budget
    if budget is None or k != answer.nearest:
        return ()
    delays = []
    ways = (budget.reaction_a, budget.reaction_b)
    for r, way in zip(answer.robots_of(k), ways, strict=True):
        figures = None if r < 0 else tables.robots[r].stopping
        if figures is None:
            continue
        row = answer.robots[r]
        age, resting = float(row["age"]), row["phase"] == RESTING
        cycles = (2.0 if resting else 1.0) * (tables.period + tables.late)
        delays.append(
            Delayed(
                robot=tables.robots[r].name,
                way=way,
                time=age + figures.command + cycles,
                excess=max(age - figures.sensing, 0.0),
            )
        )
    return tuple(delays)
