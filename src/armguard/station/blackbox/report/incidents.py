"""Slows, stops and near misses of a recording, with their causes."""

from collections import Counter
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum, IntEnum
from typing import Any

import numpy as np

from armguard.guard.answer import Names
from armguard.guard.layout import NEAR_COUNT, NEAR_WIDTH
from armguard.guard.levels import SENTENCES, Level, Reason
from armguard.guard.nuisance import Cause
from armguard.guard.sentences import ABOUT_PAIRS
from armguard.guard.verdict import Verdict
from armguard.station.blackbox.report.cycles import Block, Rows
from armguard.station.frames import Frame

# Name for all robots of a scene in which every mode is "fixed".
EVERYONE = "all"

# Spans of closeness that are no farther apart than this are one near miss [s].
TOGETHER = 1.0


def plain(value: Any) -> Any:
    """Dataclasses, enums and mappings as values that JSON has."""
    if isinstance(value, Enum):
        return value.name if isinstance(value, IntEnum) else value.value
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, dict):
        return {plain(key): plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple) else value


class Sense(Enum):
    """Whether a slow or a stop was needed, as far as its cycle shows."""

    NEEDED = "needed"
    EARLY = "early"
    NEEDLESS = "needless"
    ORDERED = "ordered"
    UNKNOWN = "not known"


def sense_of(cause: Cause | None, deficit: float | None) -> Sense:
    """Whether a slow or a stop was needed, by its cause and deficit [m].

    A stop is ordered in the first cycle with a deficit, so that deficits are small: a
    length that would have let that cycle pass does not make the stop needless.
    """
    if cause is None:
        return Sense.UNKNOWN
    if cause is Cause.ORDERED:
        return Sense.ORDERED
    if cause in (Cause.TRUE_NEED, Cause.FIGURES):
        return Sense.NEEDED
    return Sense.NEEDLESS if deficit is None else Sense.EARLY


@dataclass(frozen=True, slots=True)
class VerdictText:
    """A verdict in words."""

    level: Level
    reason: Reason
    subject: str  # the pair, or the joint or robot with a fault; "" for all
    distance: float | None  # signed distance of the pair; None without one [m]
    needed: float | None  # separation the pair had to keep, likewise [m]
    clearance: float | None  # distance beyond that, likewise [m]
    why: str  # the verdict's sentence
    budget: str = ""  # terms of the needed separation; "" if they are not known
    cause: Cause | None = None  # None if there is none, or it is not recorded
    deficit: float | None = None  # what the pair lacked [m]
    remedy: str = ""  # what would have let the cycle pass
    sense: Sense = Sense.UNKNOWN


def text_of(frame: Frame, names: Names) -> VerdictText:
    """The verdict of a cycle in words; shorter if its near pairs are not recorded."""
    fault = str(frame.text.get("fault", ""))
    verdict = Verdict(frame.verdict, names, None, frame.cycle_time, fault)
    reason, level = verdict.reason, verdict.level
    rows = int(frame.verdict[NEAR_COUNT])
    if len(frame.verdict) < names.first_row + rows * NEAR_WIDTH:
        why = fault or f"{SENTENCES[reason]} (near pairs are not in the recording)"
        return VerdictText(level, reason, "", None, None, None, why)
    text = VerdictText(level, reason, verdict.subject, None, None, None, verdict.why)
    pair, nuisance = verdict.nearest, verdict.nuisance
    if pair is not None and reason in ABOUT_PAIRS and not fault:
        lengths = pair.distance, pair.needed, pair.clearance
        budget = "" if verdict.budget is None else verdict.budget.sentence
        subject = f"{pair.a} – {pair.b}"
        text = VerdictText(level, reason, subject, *lengths, verdict.why, budget)
    if nuisance is None:
        return text
    cause, deficit, remedy = nuisance.cause, nuisance.deficit, nuisance.remedy
    sense = sense_of(cause, deficit)
    return replace(text, cause=cause, deficit=deficit, remedy=remedy, sense=sense)


@dataclass(frozen=True, slots=True)
class Halt:
    """The cycle in which a slow or a stop of robots begins."""

    at: float  # on the monotonic clock [s]
    cycle: int
    robots: tuple[str, ...]
    stopped: bool  # a stop; else a slow
    order: Reason  # of the verdict
    told: VerdictText

    def to_dict(self, begin: float) -> dict[str, object]:
        """The halt as plain values, its time since the first cycle."""
        own = plain(self)
        told = own.pop("told")
        return {"t": own.pop("at") - begin, **own, **told}


class Halts:
    """Collects the beginnings of slows and stops from successive blocks."""

    def __init__(self, names: Names) -> None:
        self._names, self._robots = names, tuple(names.robots) or (EVERYONE,)
        self._last = np.zeros((1, len(self._robots)), dtype=np.int64)
        self.found: list[Halt] = []

    def add(self, block: Block) -> None:
        """Take in a block."""
        rows = block.rows
        levels = rows.levels if self._names.robots else rows.level[:, None]
        before = np.concatenate([self._last, levels[:-1]])
        self._last = levels[-1:]
        stops = (levels >= Level.STOP) & (before < Level.STOP)
        slows = (levels == Level.SLOW) & (before < Level.SLOW)
        for risen, stopped in ((slows, False), (stops, True)):
            for k in np.flatnonzero(risen.any(axis=1)).tolist():
                own = zip(self._robots, risen[k], strict=True)
                robots, row = tuple(name for name, rose in own if rose), rows[k]
                text = text_of(block.frames[k], self._names)
                begin, order = (float(row.t), int(row.cycle)), Reason(int(row.reason))
                self.found.append(Halt(*begin, robots, stopped, order, text))


@dataclass(frozen=True, slots=True)
class CauseCount:
    """Slows and stops of one cause."""

    cause: Cause | None  # None if it is not known
    stops: int
    slows: int
    reasons: Counter[Reason]  # of the stops
    most_deficit: float | None  # greatest one of the stops; None if none is known [m]
    remedy: str  # what would have let the stop with that deficit pass


def by_cause(halts: list[Halt]) -> list[CauseCount]:
    """Slows and stops by cause, most stops first."""
    counts = []
    for cause in (*Cause, None):
        own = [halt for halt in halts if halt.told.cause is cause]
        stops = [halt for halt in own if halt.stopped]
        if own:
            # A remedy for the greatest deficit is one for the others too.
            worst = max(stops or own, key=lambda halt: halt.told.deficit or 0.0).told
            numbers = len(stops), len(own) - len(stops)
            reasons = Counter(halt.order for halt in stops)
            found = CauseCount(cause, *numbers, reasons, worst.deficit, worst.remedy)
            counts.append(found)
    return sorted(counts, key=lambda count: (-count.stops, -count.slows))


@dataclass(frozen=True, slots=True)
class Closeness:
    """Limits below which a cycle belongs to a near miss; every stop does."""

    clearance: float = 0.0  # [m]
    slack: float = 0.0  # time until a stop is ordered [s]


@dataclass(slots=True)
class Span:
    """Successive cycles of a near miss; see `NearMiss`."""

    began: float
    ended: float
    level: int
    clearance: float
    stop: Frame | None  # its first one
    nearest: Frame


@dataclass(frozen=True, slots=True)
class NearMiss:
    """A near miss; times are on the monotonic clock."""

    began: float  # time of its first cycle [s]
    ended: float  # time of its last cycle [s]
    cycle: int  # its main cycle: the first stop, else the least clearance
    at: float  # time of that cycle [s]
    level: Level  # highest one
    clearance: float  # least one; infinite if no pair is near [m]
    nearest_at: float  # time of the least clearance [s]
    told: VerdictText  # verdict of the main cycle
    nearest: VerdictText  # verdict at the least clearance

    def to_dict(self, begin: float) -> dict[str, object]:
        """The near miss as plain values, times since the first cycle."""
        return {
            "began": self.began - begin,
            "ended": self.ended - begin,
            "cycle": self.cycle,
            "t": self.at - begin,
            "highest_level": self.level.name,
            "least_clearance": self.clearance,
            "nearest_t": self.nearest_at - begin,
            "told": plain(self.told),
            "nearest": plain(self.nearest),
        }


class NearMisses:
    """Collects near misses from successive blocks."""

    def __init__(self, names: Names, closeness: Closeness) -> None:
        self._names, self._closeness = names, closeness
        self._span: Span | None = None
        self._found: list[NearMiss] = []

    def add(self, block: Block) -> None:
        """Take in a block."""
        rows, limits = block.rows, self._closeness
        near = (rows.level >= Level.STOP) | (rows.clearance < limits.clearance)
        near |= rows.slack < limits.slack
        edges = np.flatnonzero(np.diff(np.concatenate([[0], near, [0]])))
        for start, end in edges.reshape(-1, 2).tolist():
            new = span_of(block.frames[start:end], rows[start:end])
            old = self._span
            if old is None or new.began - old.ended > TOGETHER:
                self.near_misses()
                self._span = new
                continue
            old.ended, old.level = new.ended, max(old.level, new.level)
            old.stop = old.stop or new.stop
            if new.clearance < old.clearance:
                old.clearance, old.nearest = new.clearance, new.nearest

    def near_misses(self) -> list[NearMiss]:
        """All of them in their order; the last one ends."""
        span, self._span = self._span, None
        if span is not None:
            # As words: a frame would keep its part of the file in memory.
            main, near = span.stop or span.nearest, span.nearest
            of_main, of_near = (text_of(frame, self._names) for frame in (main, near))
            times, level = (main.cycle, main.monotonic), Level(span.level)
            least, texts = (span.clearance, near.monotonic), (of_main, of_near)
            miss = NearMiss(span.began, span.ended, *times, level, *least, *texts)
            self._found.append(miss)
        return self._found


def span_of(frames: list[Frame], rows: Rows) -> Span:
    """Successive cycles of a near miss."""
    clearance = np.where(np.isnan(rows.clearance), np.inf, rows.clearance)
    least, stops = int(clearance.argmin()), np.flatnonzero(rows.level >= Level.STOP)
    began, ended, level = float(rows.t[0]), float(rows.t[-1]), int(rows.level.max())
    stop, nearest = frames[stops[0]] if len(stops) else None, frames[least]
    return Span(began, ended, level, float(clearance[least]), stop, nearest)
