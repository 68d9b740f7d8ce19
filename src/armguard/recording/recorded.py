"""A guard whose cycles, and all that is done to it between them, go into a ring."""

import inspect
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.shapes import Shape
from armguard.guard.given import is_mapping, joined
from armguard.guard.objects import SightingError
from armguard.guard.verdict import Verdict
from armguard.recording import frames
from armguard.recording.calls import GuardCall, Place
from armguard.recording.frames import (
    HEADER,
    Form,
    Frame,
    Kind,
    frame_of,
    text_frame,
    words,
)
from armguard.recording.ring import RingReader, RingWriter, in_memory
from armguard.respond import Command, Guard
from armguard.respond.requested import reason_of_stop
from armguard.scene.archive import archive_of, hash_of
from armguard.scene.scene import Scene
from armguard.scene.tables import RobotPart

Floats = NDArray[np.float64]

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer", Verdict, Command)


def recorded(
    form: Form, method: Callable[Concatenate[Guard, Arguments], Answer]
) -> Callable[Concatenate["RecordedGuard", Arguments], Answer]:
    """A cycle of a guard that is written down as well.

    Args:
        form: Form of the request.
        method: The method of `Guard`. Beside its arguments the cycle takes `received`,
            when they came in, monotonic [s].
    """
    signature = inspect.signature(method)

    @wraps(method)
    def cycle(
        self: "RecordedGuard", /, *args: Arguments.args, **named: Arguments.kwargs
    ) -> Answer:
        received: Any = named.pop("received", np.nan)
        answer = method(self.guard, *args, **named)
        given = signature.bind(self.guard, *args, **named)
        given.apply_defaults()
        self.write_cycle(form, given.arguments, answer, received)
        return answer

    return cycle


class RecordedGuard:
    """A guard that writes down what goes in and what comes out.

    Its cycles are the guard's own, and answer as these do. A call that raises has
    changed nothing and is not written down, but for a sighting that is refused.

    Attributes:
        guard: The guard.
        cycle: Number of the next cycle.
        shapes: Shapes that objects were given since the start, by name.

    Args:
        guard: The guard; only this object may call it from now on.
        ring: Where frames go.
        cycle: Number of the first cycle.
        monotonic: The machine's monotonic clock [s].
        wall: Its wall clock [s].
    """

    def __init__(
        self,
        guard: Guard,
        ring: RingWriter,
        *,
        cycle: int = 0,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.guard = guard
        self.cycle = cycle
        self._scene: tuple[Mapping[str, Any], bytes] | None = None
        self._ring = ring
        self._monotonic, self._wall = monotonic, wall
        self._robots = tuple(part.name for part in guard.tables.robots)
        self._joints = len(guard.q_names)
        self._poses = guard.poses.reshape(-1)
        self.shapes: dict[str, Shape] = {}

    step = recorded(Form.STEP, Guard.step)
    filter = recorded(Form.VELOCITIES, Guard.filter)
    filter_positions = recorded(Form.POSITIONS, Guard.filter_positions)
    filter_twists = recorded(Form.TWISTS, Guard.filter_twists)
    stop = recorded(Form.STOP, Guard.stop)

    def do(self, call: GuardCall) -> GuardCall:
        """Make a call between two cycles, and give it back as it was made.

        Raises:
            ArmguardError: See `GuardCall.apply`.
        """
        if isinstance(call, Place):
            # Every time: a checkpoint holds where objects are, not their sizes.
            shape = call.shape or self.shapes.get(call.name)
            call = call.model_copy(update={"shape": shape})
        try:
            call.apply(self.guard)
        except SightingError:
            # It is refused when it is replayed as well, and stops robots there.
            self.write_text(Kind.EVENT, call.event)
            raise
        if isinstance(call, Place) and call.shape is not None:
            self.shapes[call.name] = call.shape
        self.write_text(Kind.EVENT, call.event)
        return call

    def describe(self, scene: Scene, about: Mapping[str, Any]) -> None:
        """Write down the scene, whole, so that a recording holds all it is about.

        Args:
            scene: The scene the guard was made of.
            about: Further facts about it, ready for JSON.
        """
        archive = archive_of(scene)
        text = {
            **about,
            "note": "scene",
            "archive": hash_of(archive),
            "names": list(self.guard.q_names),
            "robots": list(self._robots),
            "period": self.guard.tables.period,
            "budget": self.guard.budget,
        }
        self._scene = text, archive
        self.write_text(Kind.NOTE, text, archive)

    def checkpoint(self) -> None:
        """Write down all that the guard remembers, so that a replay may begin here.

        And the scene once more, for readers that started later.
        """
        if self._scene is not None:
            self.write_text(Kind.NOTE, *self._scene)
        self.write_text(Kind.CHECKPOINT, {}, self.guard.checkpoint())

    def write_text(
        self, kind: Kind, text: Mapping[str, Any], data: bytes = b""
    ) -> None:
        """Write down something that is no cycle."""
        now, wall = self._monotonic(), self._wall()
        text_frame(kind, self.cycle, now, wall, text, data, self._ring.reserve)
        self._ring.commit()

    def write_row(
        self,
        length: int,
        fill: Callable[[Floats, float, float], None],
        text: bytes = b"",
    ) -> None:
        """Write down a cycle that another loop ran with the guard's kernels.

        For a loop that answers first: the guard must not have been called since.

        Args:
            length: Words of its frame before its text.
            fill: Fills them in, given the time on the monotonic and the wall clock [s].
            text: The frame's text.
        """
        row = self._ring.reserve(length + words(len(text)))
        fill(row, self._monotonic(), self._wall())
        if text:
            frames.put_text(text, row[length:])
        self._ring.commit()
        self.cycle += 1

    def write_cycle(
        self,
        form: Form,
        given: Mapping[str, Any],
        answer: Verdict | Command,
        received: float,
    ) -> None:
        """Write down a cycle.

        Args:
            form: Form of the request.
            given: Arguments of the call, by name.
            answer: What came out.
            received: When it came in, monotonic; NaN if that is not known [s].
        """
        given = in_order(given, self.guard.tables.robots)
        n, now, velocity = self._joints, given["now"], given["velocity"]
        commanded = isinstance(answer, Command)
        verdict = answer.verdict if isinstance(answer, Command) else answer
        tools = list(given["twists"]) if form is Form.TWISTS else []
        text = b""
        if tools or verdict.fault:
            about = {"fault": verdict.fault, "tools": tools}
            if verdict.fault:
                about["wrong"] = wrong_input(given, self._robots, n)
            text = frames.text_of(about)
        sections: tuple[Floats | Sequence[float], ...] = (
            as_row(given["q"], n),
            np.zeros(n) if velocity is None else as_row(velocity, n),
            [as_number(own) for own in by_robot(given["stamp"], self._robots)],
            asked_in(form, given, self.guard.q_names),
            answer.numbers if commanded else (),
            verdict.numbers,
            self._poses,
        )
        numbers = np.concatenate(sections)
        row = self._ring.reserve(HEADER + len(numbers) + words(len(text)))
        written = self._monotonic()
        row[:HEADER] = (
            Kind.CYCLE,
            self.cycle,
            written,
            self._wall(),
            form,
            np.nan if now is None else as_number(now),
            velocity is not None,
            received,
            written,
            verdict.cycle_time,
            # The second section is as long as the first one.
            *(len(section) for section in sections[1:]),
            len(text),
            0,
        )
        end = HEADER + len(numbers)
        row[HEADER:end] = numbers
        if text:
            frames.put_text(text, row[end:])
        self._ring.commit()
        self.cycle += 1


def in_order(given: Mapping[str, Any], robots: Sequence[RobotPart]) -> dict[str, Any]:
    """Arguments of a call, with vectors by robot name as vectors of all joints.

    A mapping that is no such vector stays, and counts as wrong input.
    """
    found = dict(given)
    names = [part.name for part in robots]
    for key in ("q", "velocity", "q_desired", "v_desired"):
        value, partial = given.get(key), key == "v_desired"
        if is_mapping(value) and not (partial and set(value).isdisjoint(names)):
            vector, fault = joined(key, value, robots, partial=partial)
            found[key] = value if fault else vector
    return found


def asked_in(
    form: Form, given: Mapping[str, Any], names: Sequence[str]
) -> Floats | list[float]:
    """What was asked of a cycle as a recording holds it; NaN where it is none.

    Args:
        form: What it is.
        given: Arguments of the call, by name.
        names: Names of the joints.
    """
    if form is Form.STEP:
        return []
    if form is Form.STOP:
        return [reason_of_stop(given["reason"])]
    if form is Form.TWISTS:
        return [x for twist in given["twists"].values() for x in as_row(twist, 6)]
    asked = given["q_desired" if form is Form.POSITIONS else "v_desired"]
    if isinstance(asked, Mapping):
        asked = by_name(asked, names)
    return as_row(asked, len(names))


def by_robot(stamp: object, robots: Sequence[str]) -> list[object]:
    """The stamp of each robot."""
    if isinstance(stamp, Mapping):
        return [stamp.get(name) for name in robots]
    return [stamp] * len(robots)


def by_name(values: Mapping[str, float], names: Sequence[str]) -> Floats:
    """Velocities by name as a vector; NaN where one is of no joint."""
    if any(name not in names for name in values):
        return np.full(len(names), np.nan)
    return np.array([as_number(values.get(name, 0.0)) for name in names])


def as_number(value: object) -> float:
    """A number; NaN for everything else."""
    return float(value) if is_number(value) else np.nan  # type: ignore[arg-type]


class Tape:
    """A guard in a ring, and what it wrote there.

    Attributes:
        guard: The guard; it writes down its cycles.
        now: Time of the present cycle [s].

    Args:
        guard: The guard.
        folder: Where the ring is.
    """

    def __init__(self, guard: Guard, folder: str) -> None:
        path, self.now = Path(folder) / "ring", 0.0
        ring = RingWriter(path)
        self.guard = RecordedGuard(
            guard, ring, monotonic=lambda: self.now, wall=lambda: self.now
        )
        self._reader = RingReader(path)

    def unread(self) -> Iterator[Frame]:
        """Frames since the last call."""
        for row in self._reader.unread():
            yield frame_of(row.copy())


def judged(
    guard: Guard, q: Floats, times: Floats, speeds: Floats | None
) -> Iterator[Frame]:
    """Frames of a motion that obeys no stop, as a guard judges it.

    Args:
        guard: The guard; its clock is that of the motion.
        q: Joint positions, shape (k, n) [rad or m].
        times: Their times, rising, shape (k,) [s].
        speeds: Joint velocities then, shape (k, n) [rad/s or m/s]; None for a guard
            that predicts no stops.
    """
    with TemporaryDirectory(dir=in_memory()) as folder:
        tape = Tape(guard, folder)
        for k, (row, tape.now) in enumerate(zip(q, times.tolist(), strict=True)):
            guard.forget_stops()
            velocity = None if speeds is None else speeds[k]
            tape.guard.step(row, tape.now, velocity=velocity)
            yield from tape.unread()


def wrong_input(given: Mapping[str, Any], robots: Sequence[str], joints: int) -> str:
    """Name of the input that a cycle could not read; empty if it read all of them.

    In the order in which a guard reads them: the first one is what it stopped at.
    """
    stamp, now, velocity = given["stamp"], given["now"], given["velocity"]
    stamps = [*stamp.values()] if isinstance(stamp, Mapping) else [stamp]
    known = not isinstance(stamp, Mapping) or all(name in robots for name in stamp)
    if now is not None and not is_number(now):
        return "now"
    if not all(value is None or is_number(value) for value in stamps):
        return "stamp"
    if not known:
        return "stamp of no robot"
    if velocity is not None and not is_row(velocity, joints):
        return "velocity"
    return "" if is_row(given["q"], joints) else "q"


def is_number(value: Any) -> bool:
    """Whether a value is, or can be read as, one number."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def is_row(value: Any, count: int) -> bool:
    """Whether a value can be read as that many numbers."""
    try:
        return np.asarray(value, dtype=np.float64).shape == (count,)
    except Exception:  # as the guard does with whatever a stranger's object raises
        return False


def as_row(value: ArrayLike, count: int) -> Floats:
    """Numbers as a vector of that length; NaN where they are something else."""
    if not is_row(value, count):
        return np.full(count, np.nan)
    return np.asarray(value, dtype=np.float64)
