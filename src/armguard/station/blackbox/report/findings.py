"""All that a report tells of a recording, as numbers and names."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armguard.guard.levels import Level, Reason
from armguard.guard.verdict import Names, names_of
from armguard.scene.compile import compile_scene
from armguard.station.blackbox.recording import Recording
from armguard.station.blackbox.report.block import blocks
from armguard.station.blackbox.report.clock import on_one_clock
from armguard.station.blackbox.report.closest import Closest, ClosestPairs
from armguard.station.blackbox.report.distribution import Distribution, distribution
from armguard.station.blackbox.report.halts import CauseCount, Halt, Halts, by_cause
from armguard.station.blackbox.report.model import ModelFacts, model_facts
from armguard.station.blackbox.report.near_misses import (
    Closeness,
    NearMiss,
    NearMisses,
)
from armguard.station.blackbox.report.series import Series, SeriesMaker
from armguard.station.blackbox.report.spoken import Sense
from armguard.station.frames import Frame, Kind

# Calls that change who may touch what.
CONTRACTS = ("grasp", "release", "allow")


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that was done to the guard, or told.

    Attributes:
        at: When, on the monotonic clock [s].
        kind: Call, checkpoint or note.
        text: Its name and arguments.
    """

    at: float
    kind: Kind
    text: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Findings:
    """What a recording holds.

    Attributes:
        source: Name of the file.
        info: What the recording says of itself: version, hashes, settings.
        robots: Names of the robots; empty where all modes are "fixed".
        everyone: Names of all robots of the scene.
        begin: When the first cycle was judged, on the monotonic clock [s].
        wall: The same on the wall clock [s since 1970]; NaN without a cycle.
        series: Every cycle.
        halts: Where slows and stops began.
        near_misses: Spans in which it was close.
        closeness: What counted as that.
        closest: Pairs that were near, nearest first.
        whole: Cycles whose near pairs are all recorded.
        events: What was done between cycles.
        problems: What the file lacks, each a sentence.
        model: What it was judged with; None if the scene is not known.
        sensing: Declared delay of each robot's measurements; NaN without figures [s].
    """

    source: str
    info: Mapping[str, Any]
    robots: tuple[str, ...]
    everyone: tuple[str, ...]
    begin: float
    wall: float
    series: Series
    halts: Sequence[Halt]
    near_misses: Sequence[NearMiss]
    closeness: Closeness
    closest: Sequence[Closest]
    whole: int
    events: Sequence[Happening]
    problems: Sequence[str]
    model: ModelFacts | None
    sensing: tuple[float, ...]

    @property
    def stops(self) -> list[Halt]:
        """Beginnings of stops."""
        return [halt for halt in self.halts if halt.stopped]

    def stops_that_were(self, sense: Sense) -> list[Halt]:
        """Stops by what they were good for."""
        return [halt for halt in self.stops if halt.told.sense is sense]

    @property
    def causes(self) -> list[CauseCount]:
        """Slows and stops by what made them."""
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
        """Time in which a message is to be answered [s]."""
        late = 0.0 if self.model is None else self.model.late
        return self.series.period + late

    @property
    def misses(self) -> int:
        """Cycles that took longer, from their message on where that is known."""
        took = np.fmax(self.series.answer, self.series.cycle_time)
        return int((took > self.deadline).sum())

    @property
    def reasons(self) -> Counter[Reason]:
        """Cycles of each reason."""
        numbers, counts = np.unique(self.series.reason, return_counts=True)
        return Counter(
            {
                Reason(int(number)): int(count)
                for number, count in zip(numbers, counts, strict=True)
            }
        )

    @property
    def faults(self) -> int:
        """Cycles whose input could not be believed."""
        return int((self.series.reason >= Reason.NOT_FINITE).sum())

    def ages(self) -> dict[str, Distribution | None]:
        """How old the measurements of each robot were [s]."""
        return {
            name: distribution(self.series.ages[:, r])
            for r, name in enumerate(self.robots)
        }

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain numbers and strings; the cycles in short."""
        series, begin = self.series, self.begin
        return {
            "source": self.source,
            "info": dict(self.info),
            "begin_wall": self.wall,
            "duration": series.duration,
            "judged": series.judged,
            "cycles": len(series.t),
            "cycles_missing": series.missing,
            "gaps": [
                {"t": series.time_of(k), "length": float(series.t[k + 1] - series.t[k])}
                for k in series.gaps.tolist()
            ],
            "time_at": words_of(series.time_at(series.level)),
            "time_at_by_robot": {
                name: words_of(series.time_at(series.levels[:, r]))
                for r, name in enumerate(self.robots)
            },
            "cycles_by_reason": {
                reason.name: count for reason, count in self.reasons.items()
            },
            "faults": self.faults,
            "stops": [halt.to_dict(begin) for halt in self.stops],
            "slows": [halt.to_dict(begin) for halt in self.halts if not halt.stopped],
            "stops_by_sense": {
                sense.value: len(self.stops_that_were(sense)) for sense in Sense
            },
            "causes": [count.to_dict() for count in self.causes],
            "near_misses": [miss.to_dict(begin) for miss in self.near_misses],
            "closeness": asdict(self.closeness),
            "closest": [
                {**asdict(pair), "at": pair.at - begin} for pair in self.closest
            ],
            "cycles_with_all_near_pairs": self.whole,
            "cycle_time": told(distribution(series.cycle_time)),
            "answer_time": told(distribution(series.answer)),
            "deadline": self.deadline,
            "deadline_misses": self.misses,
            "ages": {name: told(ages) for name, ages in self.ages().items()},
            "events": [
                {"t": event.at - begin, "kind": event.kind.name, **event.text}
                for event in self.events
            ],
            "problems": list(self.problems),
            "model": None if self.model is None else self.model.to_dict(),
        }


def is_news(event: Happening) -> bool:
    """Whether an event is more than what every recording writes again and again."""
    return event.kind is not Kind.CHECKPOINT and event.text.get("note") != "scene"


def told(numbers: Distribution | None) -> dict[str, float] | None:
    """A distribution by name."""
    return None if numbers is None else numbers.to_dict()


def words_of(times: Mapping[Level, float]) -> dict[str, float]:
    """Times by the names of levels."""
    return {level.name: time for level, time in times.items()}


def gather(
    frames: Iterable[Frame],
    names: Names,
    *,
    source: str = "",
    info: Mapping[str, Any] | None = None,
    problems: Sequence[str] = (),
    model: ModelFacts | None = None,
    closeness: Closeness | None = None,
    progress: Callable[[int], None] | None = None,
) -> Findings:
    """Read all frames of a recording once.

    Args:
        frames: Frames in their order.
        names: Names of the scene they were judged in.
        source: Name of the file.
        info: What the recording says of itself.
        problems: What the file lacks; looked at when all frames are read.
        model: What it was judged with.
        closeness: What counts as a near miss.
        progress: Called with the number of cycles that were read since the last call.
    """
    tables = names.tables
    if tables is None:
        raise ValueError("names without tables know no robots")
    closeness = closeness or Closeness()
    series = SeriesMaker(len(names.robots), tables.period)
    halts, closest = Halts(names), ClosestPairs(names)
    near = NearMisses(names, closeness)
    events: list[Happening] = []
    foreign = unknown = whole = 0
    begin = wall = float("nan")
    breaks: list[str] = []
    for block in blocks(on_one_clock(frames, breaks), names):
        if block.frames and begin != begin:
            begin, wall = block.frames[0].monotonic, block.frames[0].wall
        for part in (series, halts, closest, near):
            part.add(block)
        # Not as frames: those of scenes and checkpoints bring them with them.
        events += [Happening(e.monotonic, e.kind, e.text) for e in block.events]
        foreign += block.foreign
        unknown += block.unknown
        whole += int(block.whole.sum())
        if progress is not None:
            progress(len(block.frames))
    lacks = [*problems, *breaks]
    if foreign:
        lacks.append(f"left out, since not of the scene in the file: {foreign} cycles")
    if unknown:
        lacks.append(
            f"left out, since this version does not know their reasons: {unknown} "
            "cycles; a newer one does"
        )
    if begin != begin:
        lacks.append("there is no cycle in it")
    return Findings(
        source=source,
        info=dict(info or {}),
        robots=tuple(names.robots),
        everyone=tuple(part.name for part in tables.robots),
        begin=begin,
        wall=wall,
        series=series.series(),
        halts=halts.halts(),
        near_misses=near.near_misses(),
        closeness=closeness,
        closest=closest.pairs(),
        whole=whole,
        events=[event for event in events if is_news(event)],
        problems=lacks,
        model=model,
        sensing=tuple(
            float("nan") if part.stopping is None else part.stopping.sensing
            for part in tables.robots
        ),
    )


def findings_of(
    recording: Recording,
    *,
    closeness: Closeness | None = None,
    prove_seconds: float = 0.0,
    progress: Callable[[int], None] | None = None,
) -> Findings:
    """All that a recording holds, in the scene that is in it.

    Args:
        recording: The recording.
        closeness: What counts as a near miss.
        prove_seconds: Time for proofs that are not kept on this machine [s].
        progress: See `gather`.

    Raises:
        RecordingError: There is no scene in it.
    """
    recording, others = of_one_scene(recording)
    scene = recording.scene()
    first, *more = [path.name for path in recording.paths]
    if others:
        recording.note(
            f"left out, since of another scene than {first}: {', '.join(others)}"
        )
    return gather(
        recording.frames(),
        names_of(compile_scene(scene)),
        source=first if not more else f"{first} and {len(more)} more",
        info=recording.info,
        problems=recording.problems,
        model=model_facts(scene, prove_seconds),
        closeness=closeness,
        progress=progress,
    )


def of_one_scene(recording: Recording) -> tuple[Recording, list[str]]:
    """The files of a recording made in the scene of the first, and names of others.

    A service whose settings are changed goes on with another recording: its verdicts
    say something else.
    """
    first, *more = [Recording([path]) for path in recording.paths]
    own = [first.paths[0]]
    others = []
    for other in more:
        same = other.info.get("archive") == first.info.get("archive")
        if same or not other.info:
            own.append(other.paths[0])
        else:
            others.append(other.paths[0].name)
    return (Recording(own), others) if others else (recording, [])
