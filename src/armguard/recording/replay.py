"""Replay: what went in goes in again, and the answers are compared bit by bit."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.guard.answer import first_row_of
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import ORDERED, Reason
from armguard.guard.objects import SightingError
from armguard.guard.verdict import Verdict
from armguard.recording.blocks import digest_of
from armguard.recording.calls import call_of
from armguard.recording.frames import Form, Frame, Kind
from armguard.recording.recording import Recording, reading
from armguard.respond import Command, Guard

Floats = NDArray[np.float64]

# What no guard can read, in place of an input that it could not read.
UNREADABLE: Any = "?"

# What the numbers of a command are, `n` of each; then `r` of each.
OF_JOINTS = ("velocity", "position", "asked velocity", "way to the asked position")
OF_ROBOTS = (
    "why it is blocked",
    "phase",
    "since when it is held",
    "why its command differs from the desired one",
)


@dataclass(slots=True)
class Replay:
    """The result of a replay."""

    cycles: int = 0  # that were judged again and compared
    skipped: int = 0  # that could not be: the guard's state before is not known
    checkpoints: int = 0  # at which the whole state of the guard was compared
    first_cycle: int | None = None  # number of the first cycle compared
    difference: str = ""  # the first one in words; "" if there was none
    different_cycle: int | None = None  # its cycle
    different_time: float | None = None  # since the recording's first frame [s]
    problems: list[str] = field(default_factory=list)  # of the recording, in words

    @property
    def identical(self) -> bool:
        """Whether every compared cycle gave the same bits, and there was one."""
        return self.cycles > 0 and not self.difference

    @property
    def sentence(self) -> str:
        """The same for people."""
        left = (
            f"; {self.skipped:,} before a checkpoint were not" if self.skipped else ""
        )
        if self.difference:
            return (
                f"cycle {self.different_cycle:,} at {self.different_time:.3f} s is "
                f"different: {self.difference}; {self.cycles:,} cycles before it were "
                f"bit-identical{left}"
            )
        if not self.cycles:
            return f"no cycle could be judged again{left}"
        return f"{self.cycles:,} cycles, bit-identical{left}"


def replay(
    recording: Recording,
    *,
    start: float = 0.0,
    end: float = np.inf,
    progress: Callable[[int], None] | None = None,
) -> Replay:
    """Judge every cycle of a recording again, in a guard of its own scene.

    Args:
        recording: The recording.
        start: Where to begin, from its first frame on [s]; what lies between the
            checkpoint before that and there is judged too.
        end: Where to end [s].
        progress: Called with the cycles judged since the last call.

    Raises:
        RecordingError: It holds no scene, or something that no recorder writes.
    """
    answer, began = Replay(), None
    with reading(recording.paths[0]):
        parts = recording.parts()
        for part in parts:
            first = next(part.frames(), None)
            if first is None and len(parts) > 1:
                continue
            now = 0.0 if first is None else first.monotonic
            began = now if began is None else began
            if len(parts) > 1 and not part.has_scene:
                # A recorder that began late gets the scene with a checkpoint.
                answer.skipped += sum(f.kind is Kind.CYCLE for f in part.frames())
            else:
                replay_scene(answer, part, now - began, start, end, progress)
            answer.problems += part.problems
            if answer.difference:
                break
    return answer


def replay_scene(
    answer: Replay,
    recording: Recording,
    past: float,
    start: float,
    end: float,
    progress: Callable[[int], None] | None,
) -> None:
    """Add a recording of one scene, `past` [s] after the first, to a replay."""
    guard = guard_of(recording)
    for time, frame, known in known_frames(recording, start - past, end - past):
        found = ""
        if frame.kind is Kind.CYCLE and not known:
            answer.skipped += 1
        elif frame.kind is Kind.CYCLE:
            if not (found := difference_of(guard, frame)):
                if answer.first_cycle is None:
                    answer.first_cycle = frame.cycle
                answer.cycles += 1
                if progress is not None and answer.cycles % 100 == 0:
                    progress(100)
        elif frame.kind is Kind.CHECKPOINT and not known:
            guard.restore(frame.data)
        elif frame.kind is Kind.CHECKPOINT:
            same = guard.checkpoint() == frame.data
            answer.checkpoints += same
            found = "" if same else "the guard remembers something else than it did"
        elif frame.kind is Kind.EVENT and known:
            try:
                do(guard, frame)
            except ArmguardError as error:
                refused = f"the guard refuses {frame.text['call']}, which it did not"
                found = f"{refused}: {error}"
        if found:
            answer.difference, answer.different_cycle = found, frame.cycle
            answer.different_time = time + past
            return


def known_frames(
    recording: Recording, start: float, end: float
) -> Iterator[tuple[float, Frame, bool]]:
    """Frames between two times, and whether the guard's state before each is known.

    It is known before the first cycle of a guard, and from a checkpoint on until a
    cycle is missing. Of a checkpoint: whether it is known already.

    Args:
        recording: The recording.
        start: Where to begin, at the checkpoint before it [s].
        end: Where to end [s].

    Yields:
        Time since the first frame [s], the frame, and whether the state is known.
    """
    known, expected = False, None
    for time, frame in timed(recording, start):
        if time > end:
            return
        if frame.kind is Kind.CYCLE:
            begins = expected is None and frame.cycle == 0
            known = begins or (known and expected == frame.cycle)
            yield time, frame, known
            expected = frame.cycle + 1
        elif frame.kind is Kind.CHECKPOINT:
            yield time, frame, known and expected == frame.cycle
            known, expected = True, frame.cycle
        else:
            yield time, frame, known or frame.cycle == 0


def budget_of(recording: Recording) -> int:
    """Spans that a cycle of a recording may test."""
    return int(recording.info.get("budget", 1024))


def guard_of(recording: Recording) -> Guard:
    """A guard of the scene of a recording."""
    return Guard(recording.scene(), budget=budget_of(recording), self_test=False)


def timed(recording: Recording, start: float) -> Iterator[tuple[float, Frame]]:
    """Frames with the time since the first, from the checkpoint before a time on."""
    began: float | None = None
    waiting: list[tuple[float, Frame]] = []
    for frame in recording.frames():
        began = frame.monotonic if began is None else began
        time = frame.monotonic - began
        if time < start and frame.kind is Kind.CHECKPOINT:
            waiting = []
        waiting.append((time, frame))
        if time >= start:
            yield from waiting
            waiting = []


def difference_of(guard: Guard, frame: Frame) -> str:
    """Judge a cycle again; how the answer differs, empty if in no bit."""
    verdict, command = judge(guard, frame)
    sent = np.zeros(0) if command is None else command.numbers
    if digest_of(verdict.numbers, sent) == frame.data:
        return ""
    return difference(frame, verdict, sent, guard)


def judge(guard: Guard, frame: Frame) -> tuple[Verdict, Command | None]:
    """One cycle again, with the very input that it had."""
    given = inputs(guard, frame)
    if frame.form is Form.STEP:
        if guard_is_fixed(guard):
            return guard.step(given["q"], given["stamp"]), None
        return guard.step(**given), None
    asked, q, stamp = frame.asked.copy(), given.pop("q"), given.pop("stamp")
    if frame.form is Form.VELOCITIES:
        command = guard.filter(q, asked, stamp, **given)
    elif frame.form is Form.STOP:
        found = (reason for reason in ORDERED if asked.tolist() == [reason])
        why = next(found, Reason.STOP_ORDERED)
        command = guard.stop(q, stamp, **given, reason=why)
    elif frame.form is Form.POSITIONS:
        command = guard.filter_positions(q, asked, stamp, **given)
    else:
        twists = dict(zip(frame.text["tools"], asked.reshape(-1, 6), strict=True))
        if frame.text.get("fault"):
            twists = {
                name: UNREADABLE if np.isnan(twist).all() else twist
                for name, twist in twists.items()
            }
        command = guard.filter_twists(q, twists, stamp, **given)
    return command.verdict, command


def guard_is_fixed(guard: Guard) -> bool:
    """Whether no robot's stops are predicted."""
    return all(part.mode == "fixed" for part in guard.tables.robots)


def inputs(guard: Guard, frame: Frame) -> dict[str, Any]:
    """What a cycle was given; what could not be read is unreadable again."""
    robots = [part.name for part in guard.tables.robots]
    given: dict[str, Any] = {
        "q": frame.q.copy(),
        "stamp": stamp_of(robots, frame.stamps),
        "velocity": None if frame.velocity is None else frame.velocity.copy(),
        "now": frame.now,
    }
    wrong = frame.text.get("wrong", "")
    if wrong == "stamp of no robot":
        given["stamp"] = {**dict(zip(robots, frame.stamps, strict=True)), "": 0.0}
    elif wrong:
        given[wrong] = UNREADABLE
    return given


def stamp_of(robots: list[str], stamps: Floats) -> Any:
    """The stamp as it was given: one of all, one of each robot, or none."""
    if np.isnan(stamps).all():
        return None
    if (stamps == stamps[0]).all():
        return float(stamps[0])
    return {name: float(stamp) for name, stamp in zip(robots, stamps, strict=True)}


def do(guard: Guard, frame: Frame) -> None:
    """Do once more what was done to the guard between two cycles.

    Raises:
        ArmguardError: The guard refuses it.
    """
    # A sighting that was refused is refused again, and stops robots again.
    with suppress(SightingError):
        call_of(frame.text).apply(guard)


def difference(frame: Frame, verdict: Verdict, sent: Floats, guard: Guard) -> str:
    """The most informative difference of a recorded cycle and the same judged again.

    Args:
        frame: The cycle as it was recorded.
        verdict: The guard's verdict now.
        sent: The numbers of its command now.
        guard: The guard.
    """
    was, now = frame.verdict, verdict.numbers
    robots = [part.name for part in guard.tables.robots]
    if was[IN_HEADER.reason] != now[IN_HEADER.reason]:
        then = Reason(int(was[IN_HEADER.reason]))
        return f"it was {then.name} and is {verdict.reason.name} ({verdict.why})"
    n, names = len(guard.q_names), guard.q_names
    for k in np.flatnonzero(different(frame.told, sent)).tolist():
        if k < 4 * n:
            what = f"{OF_JOINTS[k // n]} of {names[k % n]}"
        else:
            kind, robot = divmod(k - 4 * n, len(robots))
            what = f"{OF_ROBOTS[kind]} of {robots[robot]}"
        return f"{what} was {frame.told[k]!r} and is {sent[k]!r}"
    if len(frame.told) != len(sent):
        return f"{len(frame.told)} numbers were commanded and are {len(sent)}"
    ends = min(len(was), len(now), first_row_of(guard.tables))
    places = {k: name.replace("_", " ") for name, k in vars(IN_HEADER).items()}
    for k in np.flatnonzero(different(was[:ends], now[:ends])).tolist():
        if not frame.poses.size and k in (IN_HEADER.near_count, IN_HEADER.nearest):
            # Recorded without its other pairs.
            continue
        what = places.get(k, f"number {k} of the verdict")
        return f"{what} was {was[k]!r} and is {now[k]!r}"
    return "a near pair that is not the nearest, which the recording does not hold"


def different(a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Where two vectors differ in a bit, as far as both go."""
    k = min(len(a), len(b))
    return np.asarray(
        np.ascontiguousarray(a[:k]).view(np.int64)
        != np.ascontiguousarray(b[:k]).view(np.int64)
    )
