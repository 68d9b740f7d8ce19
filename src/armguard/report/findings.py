"""All contents of a report, as numbers and names."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from math import isnan, nan
from typing import Any

import numpy as np

from armguard.guard.answer import Names, names_of
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.recording.frames import Frame, Kind
from armguard.recording.palette import State
from armguard.recording.recording import Recording, reading
from armguard.report.cycles import (
    Distribution,
    Series,
    block_of,
    distribution,
    joined,
    on_one_clock,
    row_type,
)
from armguard.report.incidents import (
    CauseCount,
    Closeness,
    Closest,
    ClosestPairs,
    Halt,
    Halts,
    NearMiss,
    NearMisses,
    Sense,
    by_cause,
    plain,
)
from armguard.report.model import model_facts
from armguard.scene.compile import compile_scene

# Cycles of a block.
BLOCK = 2048

# Findings that are in the JSON as they are.
PLAIN = (
    *("source", "info", "faults", "causes", "closeness", "closest"),
    *("deadline", "problems", "model"),
)

# Reasons as verdicts hold them.
KNOWN = frozenset(float(reason) for reason in Reason)


@dataclass(frozen=True, slots=True)
class Event:
    """A call or a note between two cycles."""

    t: float  # since the first cycle [s]
    kind: Kind
    text: Mapping[str, Any]  # its name and arguments


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """The contents of a recording."""

    source: str = ""  # name of the file
    info: Mapping[str, Any] = field(default_factory=dict)  # version, hashes, settings
    robots: tuple[str, ...]  # names; none where all modes are "fixed"
    everyone: tuple[str, ...]  # names of all robots of the scene
    wall: float  # time of the first cycle [s since 1970]; NaN without one
    series: Series  # every cycle
    halts: Sequence[Halt]  # beginnings of slows and stops
    near_misses: Sequence[NearMiss]
    closeness: Closeness  # limits of a near miss
    closest: Sequence[Closest]  # pairs that were near, nearest first
    events: Sequence[Event]
    problems: Sequence[str]  # deficiencies of the file, one sentence each
    model: Mapping[str, Any] | None = None  # see `model_facts`; None if not known
    sensing: tuple[float, ...]  # declared delay of each robot; NaN without figures [s]

    @property
    def whole(self) -> int:
        """Number of cycles whose near pairs are all recorded."""
        return int(self.series.whole.sum())

    @property
    def stops(self) -> list[Halt]:
        """Beginnings of stops."""
        return [halt for halt in self.halts if halt.stopped]

    def stops_that_were(self, sense: Sense) -> list[Halt]:
        """Stops of one class."""
        return [halt for halt in self.stops if halt.verdict.sense is sense]

    @property
    def causes(self) -> list[CauseCount]:
        """Slows and stops by cause."""
        return by_cause(list(self.halts))

    @property
    def free(self) -> list[Closest]:
        """Pairs that were near without a contract."""
        return [pair for pair in self.closest if not pair.contract]

    @property
    def contracts(self) -> list[Closest]:
        """Pairs that were near under a contract."""
        return [pair for pair in self.closest if pair.contract]

    @property
    def deadline(self) -> float:
        """Time from a message to the end of its cycle that is allowed [s]."""
        late = 0.0 if self.model is None else float(self.model["late"])
        return self.series.period + late

    @property
    def misses(self) -> int:
        """Cycles that took longer, from their message where its time is known."""
        took = np.fmax(self.series.answer, self.series.cycle_time)
        return int((took > self.deadline).sum())

    @property
    def reasons(self) -> Counter[Reason]:
        """Number of cycles of each reason."""
        found = zip(*np.unique(self.series.reason, return_counts=True), strict=True)
        return Counter({Reason(int(reason)): int(n) for reason, n in found})

    @property
    def faults(self) -> int:
        """Cycles with implausible input."""
        return int((self.series.reason >= Reason.NOT_FINITE).sum())

    @property
    def time_in(self) -> list[tuple[str, dict[State, float]]]:
        """Time in each state: of all robots together, then of each [s]."""
        series = self.series
        own = zip(self.robots, series.states.T, strict=True)
        return [
            ("all together", series.time_in(series.state)),
            *((name, series.time_in(states)) for name, states in own),
        ]

    def ages(self) -> dict[str, Distribution | None]:
        """Ages of the measurements of each robot [s]."""
        own = zip(self.robots, self.series.ages.T, strict=True)
        return {name: distribution(ages) for name, ages in own}

    def to_dict(self) -> dict[str, Any]:
        """All findings as plain values; of the cycles only sums."""
        series, halts = self.series, self.halts
        (_, together), *own = self.time_in
        gaps = [(float(series.t[k]), float(series.t[k + 1])) for k in series.gaps]
        return {
            **{name: plain(getattr(self, name)) for name in PLAIN},
            "begin_wall": self.wall,
            "duration": series.duration,
            "judged": series.judged,
            "cycles": len(series.t),
            "cycles_missing": series.missing,
            "gaps": [{"t": start, "length": end - start} for start, end in gaps],
            "time_in": plain(together),
            "time_in_by_robot": plain(dict(own)),
            "cycles_by_reason": plain(self.reasons),
            "near_misses": [miss.to_dict() for miss in self.near_misses],
            "stops": [halt.to_dict() for halt in self.stops],
            "slows": [halt.to_dict() for halt in halts if not halt.stopped],
            "stops_by_sense": {s.value: len(self.stops_that_were(s)) for s in Sense},
            "cycles_with_all_near_pairs": self.whole,
            "cycle_time": plain(distribution(series.cycle_time)),
            "answer_time": plain(distribution(series.answer)),
            "deadline_misses": self.misses,
            "ages": plain(self.ages()),
            "events": [
                {"t": event.t, "kind": event.kind.name, **event.text}
                for event in self.events
            ],
        }


def gather(
    frames: Iterable[Frame],
    names: Names,
    closeness: Closeness | None = None,
    progress: Callable[[int], None] | None = None,
) -> Findings:
    """Read all frames of a recording once.

    Args:
        frames: Frames in their order.
        names: Names of the scene of their verdicts.
        closeness: Limits of a near miss.
        progress: Called with the number of cycles read since the last call.
    """
    tables = names.tables
    closeness = closeness or Closeness()
    halts, closest = Halts(names), ClosestPairs(names)
    near = NearMisses(names, closeness)
    rows = [np.empty(0, row_type(len(names.robots)))]
    events: list[Event] = []
    problems: list[str] = []
    begin = wall = nan
    cycles = own_cycles(on_one_clock(frames, problems), names, events, problems)
    while taken := list(islice(cycles, BLOCK)):
        if isnan(begin):
            begin, wall = taken[0].monotonic, taken[0].wall
        block = block_of(taken, names, begin)
        rows.append(block.rows.astype(rows[0].dtype))
        for part in (halts, closest, near):
            part.add(block)
        if progress is not None:
            progress(len(taken))
    if isnan(begin):
        problems.append("there is no cycle in it")
    figures = [robot.stopping for robot in tables.robots]
    return Findings(
        robots=tuple(names.robots),
        everyone=tuple(robot.name for robot in tables.robots),
        wall=wall,
        series=Series(joined(rows), tables.period),
        halts=sorted(halts.found, key=lambda halt: halt.cycle),
        near_misses=near.found,
        closeness=closeness,
        closest=closest.pairs(),
        events=[replace(event, t=event.t - begin) for event in events],
        problems=problems,
        sensing=tuple(nan if own is None else own.sensing for own in figures),
    )


def own_cycles(
    frames: Iterable[Frame], names: Names, events: list[Event], problems: list[str]
) -> Iterator[Frame]:
    """Cycles of the scene of the names.

    Args:
        frames: Frames in their order.
        names: Names of the scene.
        events: Receives the other frames, at their times on the monotonic clock, but
            scenes and checkpoints, which every recording repeats.
        problems: Receives which cycles are left out, when all frames were read.
    """
    foreign = unknown = 0
    for frame in frames:
        if frame.kind is not Kind.CYCLE:
            # The text alone is kept, since data can be large.
            if frame.kind is not Kind.CHECKPOINT and frame.text.get("note") != "scene":
                events.append(Event(frame.monotonic, frame.kind, frame.text))
        elif (
            len(frame.q) != len(names.tables.q_names)
            or len(frame.verdict) < names.first_row
        ):
            foreign += 1
        elif frame.verdict[IN_HEADER.reason] not in KNOWN:
            unknown += 1
        else:
            yield frame
    if foreign:
        text = f"left out, since not of the scene in the file: {foreign} cycles"
        problems.append(text)
    if unknown:
        problems.append(
            "left out, since this version does not know their reasons: "
            f"{unknown} cycles; a newer one does"
        )


def findings_of(
    recording: Recording,
    *,
    closeness: Closeness | None = None,
    prove_seconds: float = 0.0,
    progress: Callable[[int], None] | None = None,
) -> Findings:
    """All contents of a recording, in the scene that it holds.

    Args:
        recording: The recording.
        closeness: Limits of a near miss.
        prove_seconds: Time for proofs that are not kept on this machine [s].
        progress: See `gather`.

    Raises:
        RecordingError: It has no scene, or content that no recorder writes.
    """
    with reading(recording.paths[0]):
        recording, others = of_one_scene(recording)
        scene = recording.scene()
        first, *more = [path.name for path in recording.paths]
        if others:
            recording.note(
                f"left out, since of another scene than {first}: {', '.join(others)}"
            )
        names = names_of(compile_scene(scene))
        found = gather(recording.frames(), names, closeness, progress)
        return replace(
            found,
            source=first if not more else f"{first} and {len(more)} more",
            info=recording.info,
            problems=[*recording.problems, *found.problems],
            model=model_facts(scene, prove_seconds),
        )


def of_one_scene(recording: Recording) -> tuple[Recording, list[str]]:
    """The files of a recording with the scene of the first, and names of the others.

    A service with changed settings writes another recording, since its verdicts change.
    """
    files = [(path, Recording([path]).info) for path in recording.paths]
    archive = files[0][1].get("archive")
    own = [path for path, info in files if not info or info.get("archive") == archive]
    others = [path.name for path in recording.paths if path not in own]
    return (Recording(own), others) if others else (recording, [])
