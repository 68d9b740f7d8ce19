"""A guard whose cycles, and all that is done to it between them, go into a ring."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.shapes import Shape
from armguard.guard.levels import Reason
from armguard.guard.objects import SightingError
from armguard.guard.verdict import Verdict
from armguard.respond import Command, Guard
from armguard.respond.asked import reason_of_stop
from armguard.scene.archive import archive_of, hash_of
from armguard.scene.scene import Scene
from armguard.station import frames
from armguard.station.calls import GuardCall, Place
from armguard.station.frames import HEADER, Form, Kind, text_frame, words
from armguard.station.ring import RingWriter

Floats = NDArray[np.float64]


class RecordedGuard:
    """A guard that writes down what goes in and what comes out.

    Its cycles are the guard's own, and answer as these do. A call that raises has
    changed nothing and is not written down, but for a sighting that is refused.

    Attributes:
        guard: The guard.
        cycle: Number of the next cycle.
        shapes: Shapes that objects were given since the start, by name.

    Args:
        guard: The guard; nobody else may call it from now on.
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
        self._nowhere = np.full(self._joints, np.nan)

    def step(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float] | None = None,
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        received: float = np.nan,
    ) -> Verdict:
        """See `Guard.step`; `received` is when it came in, monotonic [s]."""
        verdict = self.guard.step(q, stamp, velocity=velocity, now=now)
        nothing = self._nowhere[:0]
        self._write(
            Form.STEP, q, velocity, stamp, now, nothing, nothing, verdict, received
        )
        return verdict

    def filter(
        self,
        q: ArrayLike,
        v_desired: ArrayLike | Mapping[str, float],
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        received: float = np.nan,
    ) -> Command:
        """See `Guard.filter`; `received` is when it came in, monotonic [s]."""
        command = self.guard.filter(q, v_desired, stamp, velocity=velocity, now=now)
        asked: ArrayLike = (
            v_desired
            if not isinstance(v_desired, Mapping)
            else (by_name(v_desired, self.guard.q_names))
        )
        self._write_command(
            Form.VELOCITIES, q, velocity, stamp, now, asked, command, received
        )
        return command

    def filter_positions(
        self,
        q: ArrayLike,
        q_desired: ArrayLike,
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        received: float = np.nan,
    ) -> Command:
        """See `Guard.filter_positions`; `received` is when it came in, monotonic."""
        command = self.guard.filter_positions(
            q, q_desired, stamp, velocity=velocity, now=now
        )
        self._write_command(
            Form.POSITIONS, q, velocity, stamp, now, q_desired, command, received
        )
        return command

    def filter_twists(
        self,
        q: ArrayLike,
        twists: Mapping[str, ArrayLike],
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        received: float = np.nan,
    ) -> Command:
        """See `Guard.filter_twists`; `received` is when it came in, monotonic [s]."""
        command = self.guard.filter_twists(q, twists, stamp, velocity=velocity, now=now)
        rows = [as_row(twist, 6) for twist in twists.values()]
        asked = np.concatenate(rows) if rows else self._nowhere[:0]
        self._write_command(
            Form.TWISTS,
            q,
            velocity,
            stamp,
            now,
            asked,
            command,
            received,
            tools=list(twists),
        )
        return command

    def stop(
        self,
        q: ArrayLike,
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        reason: Reason = Reason.STOP_ORDERED,
        received: float = np.nan,
    ) -> Command:
        """See `Guard.stop`; `received` is when it came in, monotonic [s]."""
        command = self.guard.stop(q, stamp, velocity=velocity, now=now, reason=reason)
        asked = [reason_of_stop(reason)]
        self._write_command(
            Form.STOP, q, velocity, stamp, now, asked, command, received
        )
        return command

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
            self.tell(Kind.EVENT, call.event)
            raise
        if isinstance(call, Place) and call.shape is not None:
            self.shapes[call.name] = call.shape
        self.tell(Kind.EVENT, call.event)
        return call

    def describe(self, scene: Scene, about: Mapping[str, Any]) -> None:
        """Write down the scene, whole, so that a recording holds all it is about.

        Args:
            scene: The scene the guard was made of.
            about: What else to tell, ready for JSON.
        """
        archive = archive_of(scene)
        told = {
            **about,
            "note": "scene",
            "archive": hash_of(archive),
            "names": list(self.guard.q_names),
            "robots": list(self._robots),
            "period": self.guard.tables.period,
            "budget": self.guard.budget,
        }
        self._scene = told, archive
        self.tell(Kind.NOTE, told, archive)

    def checkpoint(self) -> None:
        """Write down all that the guard remembers, so that a replay may begin here.

        And the scene once more, for those who began to read later.
        """
        if self._scene is not None:
            self.tell(Kind.NOTE, *self._scene)
        self.tell(Kind.CHECKPOINT, {}, self.guard.checkpoint())

    def tell(self, kind: Kind, text: Mapping[str, Any], data: bytes = b"") -> None:
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
        """Write down a cycle that somebody else ran with the guard's kernels.

        For a loop that answers first: the guard must not have been called since.

        Args:
            length: Words of its frame before its text.
            fill: Fills them in; told the time on the monotonic and the wall clock [s].
            text: The frame's text.
        """
        row = self._ring.reserve(length + words(len(text)))
        fill(row, self._monotonic(), self._wall())
        if text:
            frames.put_text(text, row[length:])
        self._ring.commit()
        self.cycle += 1

    def _write_command(
        self,
        form: Form,
        q: ArrayLike,
        velocity: ArrayLike | None,
        stamp: float | Mapping[str, float],
        now: float | None,
        asked: ArrayLike,
        command: Command,
        received: float,
        tools: Sequence[str] = (),
    ) -> None:
        """Write down a filtered cycle."""
        self._write(
            form,
            q,
            velocity,
            stamp,
            now,
            asked,
            command.numbers,
            command.verdict,
            received,
            tools,
        )

    def _write(
        self,
        form: Form,
        q: ArrayLike,
        velocity: ArrayLike | None,
        stamp: float | Mapping[str, float] | None,
        now: float | None,
        asked: Any,
        told: Floats,
        verdict: Verdict,
        received: float,
        tools: Sequence[str] = (),
    ) -> None:
        """Write down a cycle."""
        n, r = self._joints, len(self._robots)
        numbers = verdict.numbers
        text = b""
        if tools or verdict.fault:
            about = {"fault": verdict.fault, "tools": list(tools)}
            if verdict.fault:
                about["wrong"] = wrong_input(q, velocity, stamp, now, self._robots, n)
            text = frames.text_of(about)
        exact = form in (Form.STEP, Form.TWISTS, Form.STOP)
        wish = asked if exact else as_row(asked, n)
        k, t, v = len(wish), len(told), len(numbers)
        poses = self._poses
        p = len(poses)
        row = self._ring.reserve(HEADER + 2 * n + r + k + t + v + p + words(len(text)))
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
            n,
            r,
            k,
            t,
            v,
            p,
            len(text),
            0,
        )
        at = HEADER
        row[at : at + n] = as_row(q, n)
        at += n
        if velocity is None:
            row[at : at + n] = 0.0
        else:
            row[at : at + n] = as_row(velocity, n)
        at += n
        if type(stamp) is float:
            row[at : at + r] = stamp
        elif isinstance(stamp, Mapping):
            row[at : at + r] = [as_number(stamp.get(name)) for name in self._robots]
        else:
            row[at : at + r] = as_number(stamp)
        at += r
        row[at : at + k] = wish
        at += k
        row[at : at + t] = told
        at += t
        row[at : at + v] = numbers
        at += v
        row[at : at + p] = poses
        at += p
        if text:
            frames.put_text(text, row[at:])
        self._ring.commit()
        self.cycle += 1


def by_name(values: Mapping[str, float], names: Sequence[str]) -> Floats:
    """Velocities told by name as a vector; NaN where one is of no joint."""
    if any(name not in names for name in values):
        return np.full(len(names), np.nan)
    return np.array([as_number(values.get(name, 0.0)) for name in names])


def as_number(value: object) -> float:
    """A number; NaN for everything else."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return np.nan


def wrong_input(
    q: object,
    velocity: object,
    stamp: object,
    now: object,
    robots: Sequence[str],
    joints: int,
) -> str:
    """Which input a cycle could not read; empty if it was what was asked for.

    In the order in which a guard reads them: the first one is what it stopped at.
    """
    stamps = [*stamp.values()] if isinstance(stamp, Mapping) else [stamp]
    known = not isinstance(stamp, Mapping) or all(name in robots for name in stamp)
    if now is not None and not is_number(now):
        return "now"
    if not all(value is None or is_number(value) for value in stamps):
        return "stamp"
    if not known:
        return "stamp of nobody"
    if velocity is not None and not is_row(velocity, joints):
        return "velocity"
    return "" if is_row(q, joints) else "q"


def is_number(value: object) -> bool:
    """Whether a value is, or can be read as, one number."""
    try:
        float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False
    return True


def is_row(value: Any, count: int) -> bool:
    """Whether a value can be read as that many numbers."""
    try:
        return np.array(value, dtype=np.float64).shape == (count,)
    except Exception:  # as the guard does with whatever a stranger's object raises
        return False


def as_row(value: ArrayLike, count: int) -> Floats:
    """Numbers as a vector of that length; NaN where they are something else."""
    try:
        row = np.asarray(value, dtype=np.float64)
    except Exception:  # whatever a stranger's object raises, the loop goes on
        row = np.zeros(0)
    return row if row.shape == (count,) else np.full(count, np.nan)
