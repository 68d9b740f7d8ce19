"""Slows, stops, near misses and closest pairs of a recording."""

from collections import Counter
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from enum import Enum, IntEnum
from typing import Any

import numpy as np

from armguard.guard.answer import Names
from armguard.guard.layout import IN_HEADER, IN_NEAR, NEAR_WIDTH
from armguard.guard.levels import Level, Reason
from armguard.guard.nuisance import Cause
from armguard.guard.sentences import ABOUT_PAIRS
from armguard.guard.verdict import Verdict
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.recording.frames import Frame
from armguard.report.cycles import Block, Rows, least_in_each

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
    listed = isinstance(value, list | tuple)
    return [plain(item) for item in value] if listed else value


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
    why: str  # the verdict's sentence
    distance: float | None = None  # signed distance of the pair; None without one [m]
    needed: float | None = None  # separation the pair had to keep, likewise [m]
    headroom: float | None = None  # distance beyond that, likewise [m]
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
    rows = int(frame.verdict[IN_HEADER.near_count])
    if len(frame.verdict) < names.first_row + rows * NEAR_WIDTH:
        why = fault or f"{reason.sentence} (near pairs are not in the recording)"
        return VerdictText(level, reason, "", why)
    text = VerdictText(level, reason, verdict.subject, verdict.why)
    pair, nuisance = verdict.nearest, verdict.nuisance
    if pair is not None and reason in ABOUT_PAIRS and not fault:
        own = {key: getattr(pair, key) for key in ("distance", "needed", "headroom")}
        budget = "" if verdict.budget is None else verdict.budget.sentence
        text = replace(text, subject=f"{pair.a} – {pair.b}", budget=budget, **own)
    if nuisance is None:
        return text
    sense = sense_of(nuisance.cause, nuisance.deficit)
    return replace(text, **asdict(nuisance), sense=sense)


@dataclass(frozen=True, slots=True)
class Halt:
    """The cycle in which a slow or a stop of robots begins."""

    t: float  # since the first cycle [s]
    cycle: int
    robots: tuple[str, ...]
    stopped: bool  # a stop; else a slow
    order: Reason  # of the verdict
    verdict: VerdictText

    def to_dict(self) -> dict[str, Any]:
        """The halt as plain values."""
        own = plain(self)
        verdict = own.pop("verdict")
        return {**own, **verdict}


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
        own = [halt for halt in halts if halt.verdict.cause is cause]
        stops = [halt for halt in own if halt.stopped]
        if own:
            # A remedy for the greatest deficit is one for the others too.
            worst = max(
                stops or own, key=lambda halt: halt.verdict.deficit or 0.0
            ).verdict
            numbers = len(stops), len(own) - len(stops)
            reasons, lack = Counter(h.order for h in stops), worst.deficit
            counts.append(CauseCount(cause, *numbers, reasons, lack, worst.remedy))
    return sorted(counts, key=lambda count: (-count.stops, -count.slows))


@dataclass(frozen=True, slots=True)
class Closeness:
    """Limits below which a cycle belongs to a near miss; every stop does."""

    headroom: float = 0.0  # [m]
    time_left: float = 0.0  # time until a stop is ordered [s]


@dataclass(frozen=True, slots=True)
class NearMiss:
    """Successive cycles that are stops, or nearer than the limits allow.

    Its main cycle is the first stop, else the one with the least headroom. Times are
    since the first cycle of the recording.
    """

    began: float  # time of its first cycle [s]
    ended: float  # time of its last cycle [s]
    highest_level: Level
    cycle: int  # its main cycle
    t: float  # time of that cycle [s]
    verdict: VerdictText  # verdict of that cycle
    least_headroom: float  # infinite if no pair is near [m]
    nearest_t: float  # its time [s]
    nearest: VerdictText  # verdict of that cycle

    def to_dict(self) -> dict[str, Any]:
        """The near miss as plain values; the key of its verdict is "told"."""
        own = plain(self)
        verdict = own.pop("verdict")
        return {**own, "told": verdict}

    def joined(self, later: "NearMiss") -> "NearMiss":
        """This near miss and a later one as one."""
        near = later if later.least_headroom < self.least_headroom else self
        stops = (miss for miss in (self, later) if miss.highest_level >= Level.STOP)
        return replace(
            next(stops, near),
            began=self.began,
            ended=later.ended,
            highest_level=max(self.highest_level, later.highest_level),
            least_headroom=near.least_headroom,
            nearest_t=near.nearest_t,
            nearest=near.nearest,
        )


class NearMisses:
    """Collects near misses from successive blocks."""

    def __init__(self, names: Names, closeness: Closeness) -> None:
        self._names, self._closeness = names, closeness
        self.found: list[NearMiss] = []

    def add(self, block: Block) -> None:
        """Take in a block."""
        rows, limits = block.rows, self._closeness
        near = (rows.level >= Level.STOP) | (rows.headroom < limits.headroom)
        near |= rows.time_left < limits.time_left
        cycles = np.flatnonzero(near)
        apart = np.flatnonzero(np.diff(rows.t[cycles]) > TOGETHER) + 1
        for own in np.split(cycles, apart) if len(cycles) else ():
            frames = [block.frames[k] for k in own]
            new = near_miss(frames, rows[own], self._names)
            if self.found and new.began - self.found[-1].ended <= TOGETHER:
                new = self.found.pop().joined(new)
            self.found.append(new)


def near_miss(frames: list[Frame], rows: Rows, names: Names) -> NearMiss:
    """Cycles as a near miss; a frame would keep its part of the file in memory."""
    headroom = np.where(np.isnan(rows.headroom), np.inf, rows.headroom)
    least, stops = int(headroom.argmin()), np.flatnonzero(rows.level >= Level.STOP)
    main, t = stops[0] if len(stops) else least, rows.t.tolist()
    of_main, of_least = (text_of(frames[k], names) for k in (main, least))
    span = t[0], t[-1], Level(int(rows.level.max()))
    nearest = float(headroom[least]), t[least], of_least
    return NearMiss(*span, int(rows.cycle[main]), t[main], of_main, *nearest)


@dataclass(frozen=True, slots=True)
class Closest:
    """Two bodies and their least distance, with a contract or without one.

    Two bodies may be listed twice: a contract must not hide their distance without it.
    """

    a: str
    b: str
    distance: float  # least signed distance of their primitives [m]
    at: float  # its time since the first cycle [s]
    cycle: int  # its cycle
    headroom: float  # least one of all cycles [m]
    cycles: int  # recorded cycles in which they were within the margin
    contract: bool  # whether a contract was in force
    unproven: int  # in how many of the cycles nothing was proven for the two


class ClosestPairs:
    """Collects the pairs of bodies that were near from successive blocks."""

    def __init__(self, names: Names) -> None:
        bodies = names.tables.body_names
        self._bodies = list(dict.fromkeys(bodies))
        place = {body: k for k, body in enumerate(self._bodies)}
        self._body_of = np.array([place[body] for body in bodies], np.int64)
        self._found: dict[int, Closest] = {}

    def add(self, block: Block) -> None:
        """Take in a block."""
        near, rows, count = block.near, block.rows, len(self._bodies)
        a = self._body_of[near[:, IN_NEAR.first].astype(np.int64)]
        b = self._body_of[near[:, IN_NEAR.second].astype(np.int64)]
        contract = near[:, IN_NEAR.proof] == ALLOWED
        key = 2 * (np.minimum(a, b) * count + np.maximum(a, b)) + contract
        pairs, of_pair = np.unique(key, return_inverse=True)
        nearest = least_in_each(near[:, IN_NEAR.distance], of_pair)
        headroom = np.full(len(pairs), np.inf)
        np.minimum.at(headroom, of_pair, near[:, IN_NEAR.headroom])
        # A cycle counts once for two bodies, however many of their primitives are near.
        seen = np.unique(of_pair * len(rows) + block.owner) // len(rows)
        cycles = np.bincount(seen, minlength=len(pairs))
        open_ones = near[:, IN_NEAR.proof] == UNPROVEN
        nothing = np.unique(of_pair[open_ones] * len(rows) + block.owner[open_ones])
        unproven = np.bincount(nothing // len(rows), minlength=len(pairs))
        for n, (pair, k) in enumerate(zip(pairs.tolist(), nearest, strict=True)):
            row = rows[block.owner[k]]
            new = Closest(
                *(
                    self._bodies[a[k]],
                    self._bodies[b[k]],
                    float(near[k, IN_NEAR.distance]),
                ),
                *(float(row.t), int(row.cycle), float(headroom[n])),
                *(int(cycles[n]), bool(contract[k]), int(unproven[n])),
            )
            if old := self._found.get(pair):
                new = replace(
                    min(old, new, key=lambda pair: pair.distance),
                    headroom=min(old.headroom, new.headroom),
                    cycles=old.cycles + new.cycles,
                    unproven=old.unproven + new.unproven,
                )
            self._found[pair] = new

    def pairs(self) -> list[Closest]:
        """All pairs that were near, nearest first."""
        return sorted(self._found.values(), key=lambda pair: pair.distance)
