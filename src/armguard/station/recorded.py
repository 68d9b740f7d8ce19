"""A guard whose cycles, and all that is done to it between them, go into a ring."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Shape
from armguard.guard.contract import Region
from armguard.guard.verdict import Verdict
from armguard.respond import Command, Guard
from armguard.station import frames
from armguard.station.frames import HEADER, Form, Kind, text_frame, words
from armguard.station.ring import RingWriter

Floats = NDArray[np.float64]


class RecordedGuard:
    """A guard that writes down what goes in and what comes out.

    Each of its calls is the guard's own, and answers as that does. A call that raises
    has changed nothing and is not written down.

    Attributes:
        guard: The guard.
        cycle: Number of the next cycle.

    Args:
        guard: The guard; nobody else may call it from now on.
        ring: Where frames go.
        monotonic: The machine's monotonic clock [s].
        wall: Its wall clock [s].
    """

    def __init__(
        self,
        guard: Guard,
        ring: RingWriter,
        *,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.guard = guard
        self.cycle = 0
        self._ring = ring
        self._monotonic, self._wall = monotonic, wall
        self._robots = tuple(part.name for part in guard.tables.robots)
        self._joints = len(guard.q_names)
        self._poses = guard.poses.reshape(-1)
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
        v_desired: ArrayLike,
        stamp: float | Mapping[str, float],
        *,
        velocity: ArrayLike | None = None,
        now: float | None = None,
        received: float = np.nan,
    ) -> Command:
        """See `Guard.filter`; `received` is when it came in, monotonic [s]."""
        command = self.guard.filter(q, v_desired, stamp, velocity=velocity, now=now)
        self._write_command(
            Form.VELOCITIES, q, velocity, stamp, now, v_desired, command, received
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

    def place(
        self,
        name: str,
        pose: Pose | ArrayLike,
        stamp: float | None = None,
        *,
        velocity: ArrayLike | None = None,
        shape: Shape | None = None,
    ) -> None:
        """See `Guard.place`."""
        self.guard.place(name, pose, stamp, velocity=velocity, shape=shape)
        T = pose.matrix() if isinstance(pose, Pose) else np.asarray(pose)
        moves = None if velocity is None else np.asarray(velocity).tolist()
        self.note(
            "place",
            name=name,
            pose=T.tolist(),
            stamp=stamp,
            velocity=moves,
            shape=None if shape is None else words_of(shape),
        )

    def remove(self, name: str) -> None:
        """See `Guard.remove`."""
        self.guard.remove(name)
        self.note("remove", name=name)

    def grasp(self, robot: str, name: str) -> None:
        """See `Guard.grasp`."""
        self.guard.grasp(robot, name)
        self.note("grasp", robot=robot, name=name)

    def release(self, robot: str, name: str) -> None:
        """See `Guard.release`."""
        self.guard.release(robot, name)
        self.note("release", robot=robot, name=name)

    def allow(
        self,
        a: str,
        b: str,
        *,
        region: Region | None = None,
        depth: float = 0.002,
        speed: float = 0.02,
        until: float | None = None,
    ) -> None:
        """See `Guard.allow`."""
        self.guard.allow(a, b, region=region, depth=depth, speed=speed, until=until)
        where = None
        if region is not None:
            where = {
                "half_extents": list(region.half_extents),
                "pose": region.pose.matrix().tolist(),
                "frame": region.frame,
            }
        self.note(
            "allow", a=a, b=b, region=where, depth=depth, speed=speed, until=until
        )

    def swap_model(self, robot: str, model: str) -> None:
        """See `Guard.swap_model`."""
        self.guard.swap_model(robot, model)
        self.note("swap_model", robot=robot, model=model)

    def engage(self, name: str | None = None) -> None:
        """See `Guard.engage`."""
        self.guard.engage(name)
        self.note("engage", name=name)

    def retreat(
        self, name: str | None = None, to: Literal["path"] | Sequence[float] = "path"
    ) -> None:
        """See `Guard.retreat`."""
        self.guard.retreat(name, to)
        where = to if isinstance(to, str) else np.asarray(to).tolist()
        self.note("retreat", name=name, to=where)

    def field_goal(
        self,
        name: str,
        *,
        q: ArrayLike | None = None,
        pose: Pose | ArrayLike | None = None,
    ) -> None:
        """See `Guard.field_goal`."""
        self.guard.field_goal(name, q=q, pose=pose)
        T = pose.matrix() if isinstance(pose, Pose) else pose
        self.note(
            "field_goal",
            name=name,
            q=None if q is None else np.asarray(q).tolist(),
            pose=None if T is None else np.asarray(T).tolist(),
        )

    def reset(self) -> None:
        """See `Guard.reset`."""
        self.guard.reset()
        self.note("reset")

    def note(self, call: str, **arguments: Any) -> None:
        """Write down a call of the guard that is no cycle."""
        self.tell(Kind.EVENT, {"call": call, **arguments})

    def tell(self, kind: Kind, text: Mapping[str, Any]) -> None:
        """Write down something that is no cycle."""
        row = text_frame(kind, self.cycle, self._monotonic(), self._wall(), text)
        self._ring.append(row)

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
            text = frames.text_of({"fault": verdict.fault, "tools": list(tools)})
        wish = asked if form in (Form.STEP, Form.TWISTS) else as_row(asked, n)
        k, t, v = len(wish), len(told), len(numbers)
        poses = self._poses
        p = len(poses)
        row = self._ring.reserve(HEADER + 2 * n + r + k + t + v + p + words(len(text)))
        ended = self._monotonic()
        row[:HEADER] = (
            Kind.CYCLE,
            self.cycle,
            ended,
            self._wall(),
            form,
            np.nan if now is None else now,
            velocity is not None,
            received,
            ended,
            verdict.cycle_time,
            n,
            r,
            k,
            t,
            v,
            p,
            len(text),
        )
        at = HEADER
        row[at : at + n] = as_row(q, n)
        at += n
        if velocity is None:
            row[at : at + n] = 0.0
        else:
            row[at : at + n] = as_row(velocity, n)
        at += n
        if isinstance(stamp, Mapping):
            row[at : at + r] = [stamp.get(name, np.nan) for name in self._robots]
        else:
            row[at : at + r] = np.nan if stamp is None else stamp
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


def words_of(shape: Shape) -> dict[str, Any]:
    """A shape as its kind and its sizes."""
    return {"kind": shape.kind.name.lower(), **asdict(shape)}


def as_row(value: ArrayLike, count: int) -> Floats:
    """Numbers as a vector of that length; NaN where they are something else."""
    try:
        row = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        row = np.zeros(0)
    return row if row.shape == (count,) else np.full(count, np.nan)
