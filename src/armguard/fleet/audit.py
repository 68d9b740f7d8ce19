"""What is wrong with recorded episodes: contacts, limits, jumps, joints that freeze."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.fleet.episodes import Frames
from armguard.fleet.inputs import Input
from armguard.fleet.job import JobModel
from armguard.fleet.store import COLUMNS
from armguard.guard import Level
from armguard.prove.paving import NearInterval, Paver
from armguard.prove.tube import Tube
from armguard.respond import Guard
from armguard.scene import Scene

Floats = NDArray[np.float64]

# Ends of intervals are this exact [s]; without times, this share of a step.
RESOLUTION = 1e-4

# A step this many times faster than a joint's top speed is a jump.
JUMP = 2.0

# A joint whose leader moved this far, or another joint of the robot where there is no
# leader, while no bit of it changed, is frozen [rad or m].
FROZEN = 0.2

# A joint rests below this speed [rad/s or m/s]; so many frames of rest are compared.
REST = 0.02
REST_FRAMES = 10

# Times may be off the declared rate by this share of a period.
LATE = 0.5

# Single-precision numbers are off by this share of them; a limit is exceeded beyond it.
ROUNDING = float(np.finfo(np.float32).eps)


@dataclass
class Auditor:
    """Audits episodes in a scene.

    Attributes:
        scene: The scene.
        budget: Spans that a cycle of the guard may test.
        job: The job.
    """

    scene: Scene
    budget: int
    job: JobModel
    _guards: dict[float, tuple[Guard, bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._checker = Checker(self.scene)
        self._paver = Paver(self._checker)
        joints = [name.split("/", 1) for name in self.scene.q_names]
        models = [
            self.scene.robots[robot].model.joints[joint] for robot, joint in joints
        ]
        self._top = np.array([model.velocity or np.inf for model in models])
        self._robot = np.array([robot for robot, _ in joints])

    def audit(self, frames: Frames) -> Iterator[dict[str, Any]]:
        """The result of each input, see `COLUMNS`."""
        q, first = frames.q, frames.first
        finite = finite_rows(q)
        inner = np.ones(max(len(q) - 1, 0), dtype=bool)
        inner[first[1:-1] - 1] = False
        step = np.flatnonzero(inner)
        proven = np.ones(len(inner), dtype=bool)
        proven[step] = self._checker.prove(q[step], q[step + 1]).proven
        near = self._checker.distances(q)
        home = np.tile(self.scene.home, (len(first) - 1, 1))
        start = self._checker.prove(home, q[first[:-1]])
        speeds = self._speeds(frames, inner)
        beyond = np.maximum(self._checker.lower - q, q - self._checker.upper)
        beyond -= ROUNDING * np.maximum(np.abs(q), 1.0)
        for k, one in enumerate(frames.inputs):
            part = slice(int(first[k]), int(first[k + 1]))
            row = empty_row(one, part.stop - part.start)
            row["duration"] = (
                float(frames.times[part.stop - 1]) if frames.timed else None
            )
            found: list[dict[str, Any]] = row["findings"]
            if not finite[part].all():
                frame = int(np.argmin(finite[part]))
                found.append(
                    finding(
                        "no number", value=frame, text=self._not_finite(q[part], frame)
                    )
                )
            times = frames.times[part]
            self._nearest(row, times, near.distance[part], near.a[part], near.b[part])
            steps = slice(part.start, part.stop - 1)
            intervals = self._intervals(frames, part, proven[steps])
            self._contacts(row, intervals)
            self._limits(row, beyond[part], times)
            if speeds is not None:
                self._jumps(row, speeds[steps], times)
            leader = None if frames.leader is None else frames.leader[part]
            self._frozen(row, q[part], leader)
            if leader is not None and frames.timed:
                self._rest(row, q[part], leader, times)
            self._start(row, start.proven[k], start.share[k], start.a[k], start.b[k])
            self._times(row, frames, k)
            if self.job.guard and frames.timed and finite[part].all():
                self._guarded(row, q[part], times, intervals)
            row["clear"] = not intervals and bool(finite[part].all())
            yield row

    def _speeds(self, frames: Frames, inner: NDArray[np.bool_]) -> Floats | None:
        """Share of its top speed of each joint in each step; None without time."""
        if not frames.timed or len(frames.q) < 2:
            return None
        passed = np.where(inner, np.diff(frames.times), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.abs(np.diff(frames.q, axis=0)) / (passed[:, None] * self._top)
        return np.asarray(np.nan_to_num(rates, nan=0.0, posinf=np.inf))

    def _not_finite(self, q: Floats, frame: int) -> str:
        """Which number of a frame is none, in words."""
        joint = int(np.argmin(np.isfinite(q[frame])))
        name = self.scene.q_names[joint]
        return f"frame {frame}: joint '{name}' is at {q[frame, joint]}"

    def _names(self, a: int, b: int) -> tuple[str, str]:
        """Links of two primitives."""
        links = self._paver.links
        one, other = links.of_primitive[[a, b]]
        return links.names[one], links.names[other]

    def _nearest(
        self,
        row: dict[str, Any],
        times: Floats,
        distance: Floats,
        a: NDArray[np.intp],
        b: NDArray[np.intp],
    ) -> None:
        """Least distance of all frames."""
        known = np.where(np.isnan(distance), np.inf, distance)
        frame = int(np.argmin(known)) if len(known) else 0
        if len(known) and isfinite(known[frame]):
            row["least"] = float(known[frame])
            row["a"], row["b"] = self._names(int(a[frame]), int(b[frame]))
            row["time"] = float(times[frame])

    def _intervals(
        self, frames: Frames, part: slice, proven: NDArray[np.bool_]
    ) -> list[NearInterval]:
        """What the steps that are not proven come to, see `Paver.intervals`."""
        found: list[NearInterval] = []
        q, times = frames.q[part], frames.times[part]
        alone = len(q) == 1 and not self._checker.clear(q)[0]
        if alone and np.isfinite(q).all():
            # One frame has no step: as long as it lasts, it is where it is.
            q, times = np.repeat(q, 2, axis=0), np.array([0.0, 1.0])
            proven = np.zeros(1, dtype=bool)
        finite = finite_rows(q)
        open_steps = ~proven & finite[:-1] & finite[1:]
        resolution = RESOLUTION if frames.timed else RESOLUTION * 10.0
        edges = np.flatnonzero(np.diff(np.concatenate(([0], open_steps, [0]))))
        for start, end in edges.reshape(-1, 2).tolist():
            tube = Tube.straight(rising(times[start : end + 1]), q[start : end + 1])
            paving = self._paver.pave(tube, resolution)
            found += self._paver.intervals(paving, tube, resolution)
        return found

    def _contacts(self, row: dict[str, Any], intervals: Sequence[NearInterval]) -> None:
        """Intervals in which a pair may be nearer than its buffer."""
        row["contacts"] = sum(one.contact is not None for one in intervals)
        for one in intervals:
            place = one.nearest
            if row["least"] is None or place.distance < row["least"]:
                row["least"], row["time"] = place.distance, place.time
                row["a"], row["b"] = place.a, place.b
            kind = "too near"
            if one.contact is not None:
                robots = [name.split("/", 1)[0] for name in (place.a, place.b)]
                own = robots[0] == robots[1] and "/" in place.a and "/" in place.b
                kind = "self-contact" if own else "contact"
            row["findings"].append(
                finding(
                    kind,
                    place.a,
                    place.b,
                    one.start,
                    one.end,
                    place.distance,
                    f"{place.a} to {place.b}: {1e3 * place.distance:.2f} mm at "
                    f"{place.time:.4f} s",
                )
            )

    def _limits(self, row: dict[str, Any], beyond: Floats, times: Floats) -> None:
        """Joints beyond their limits."""
        most = np.nan_to_num(beyond, nan=-1.0).max(axis=0)
        row["beyond_limits"] = int((most > 0.0).sum())
        for joint in np.flatnonzero(most > 0.0).tolist():
            bad = np.flatnonzero(beyond[:, joint] > 0.0)
            name = self.scene.q_names[joint]
            row["findings"].append(
                finding(
                    "limit",
                    name,
                    start=times[bad[0]],
                    end=times[bad[-1]],
                    value=most[joint],
                    text=f"{name} is {most[joint]:.4g} rad or m beyond its limits, in "
                    f"{len(bad)} frames from frame {bad[0]} on",
                )
            )

    def _jumps(self, row: dict[str, Any], speeds: Floats, times: Floats) -> None:
        """Steps that are faster than their joints."""
        if not len(speeds):
            return
        most = speeds.max(axis=0)
        top = float(most.max())
        row["top_speed"] = top if isfinite(top) else None
        for joint in np.flatnonzero(most > 1.0 + ROUNDING).tolist():
            jumps = np.flatnonzero(speeds[:, joint] > JUMP)
            row["jumps"] += len(jumps)
            fast = jumps if len(jumps) else np.flatnonzero(speeds[:, joint] > 1.0)
            name = self.scene.q_names[joint]
            row["findings"].append(
                finding(
                    "jump" if len(jumps) else "speed",
                    name,
                    start=times[fast[0]],
                    end=times[fast[-1] + 1],
                    value=most[joint],
                    text=f"{name} moves at {most[joint]:.3g} times its top speed, in "
                    f"{len(fast)} steps from frame {fast[0]} on",
                )
            )

    def _frozen(self, row: dict[str, Any], q: Floats, leader: Floats | None) -> None:
        """Joints of which no bit changes while they are led."""
        still = (q == q[0]).all(axis=0)
        if not still.any():
            return
        moved = np.ptp(q, axis=0)
        led = np.zeros(len(still)) if leader is None else np.ptp(leader, axis=0)
        for joint in np.flatnonzero(still).tolist():
            name, by = self.scene.q_names[joint], "its leader"
            far = led[joint]
            if leader is None or np.isnan(far):
                far, by = (
                    moved[self._robot == self._robot[joint]].max(),
                    "another joint",
                )
            if far > FROZEN:
                row["frozen"] += 1
                row["findings"].append(
                    finding(
                        "frozen",
                        name,
                        value=q[0, joint],
                        text=f"{name} stays at {q[0, joint]:.6g} to the last bit while "
                        f"{by} moves by {far:.3g} rad or m",
                    )
                )

    def _rest(
        self, row: dict[str, Any], q: Floats, leader: Floats, times: Floats
    ) -> None:
        """How far followers are off their leaders where both rest."""
        if len(q) < REST_FRAMES:
            return
        most = REST * np.diff(times)[:, None]
        both = (np.abs(np.diff(q, axis=0)) < most) & (
            np.abs(np.diff(leader, axis=0)) < most
        )
        count = both.sum(axis=0)
        # A sum in the order of the frames has the same bits on every machine.
        total = np.where(both, leader[1:] - q[1:], 0.0).cumsum(axis=0)[-1]
        offset = np.where(count >= REST_FRAMES, total / np.maximum(count, 1), 0.0)
        worst = float(np.abs(offset).max())
        row["rest_offset"] = worst if (count >= REST_FRAMES).any() else None
        for joint in np.flatnonzero(np.abs(offset) > self.job.rest_offset).tolist():
            name = self.scene.q_names[joint]
            row["findings"].append(
                finding(
                    "rest offset",
                    name,
                    value=offset[joint],
                    text=f"{name}: the leader is {offset[joint]:.4g} rad or m off the "
                    f"follower in {count[joint]} frames in which both rest",
                )
            )

    def _start(
        self, row: dict[str, Any], proven: bool, share: float, a: int, b: int
    ) -> None:
        """Whether the straight way from home to the first frame is proven."""
        row["start_proven"] = bool(proven)
        if proven:
            return
        names, pair = ("", ""), ""
        if a >= 0:
            names = self._names(int(a), int(b))
            pair = f": {names[0]} to {names[1]}"
        row["findings"].append(
            finding(
                "start",
                *names,
                value=share,
                text=f"the straight way from home to the first frame is proven for "
                f"{100.0 * share:.0f} % alone{pair}",
            )
        )

    def _times(self, row: dict[str, Any], frames: Frames, k: int) -> None:
        """Times that contradict the declared rate, or do not rise."""
        part = slice(int(frames.first[k]), int(frames.first[k + 1]))
        times, late = frames.times[part], float(frames.late[k])
        if frames.timed and len(times) > 1 and not (np.diff(times) > 0.0).all():
            frame = int(np.flatnonzero(~(np.diff(times) > 0.0))[0]) + 1
            row["findings"].append(
                finding(
                    "times", value=frame, text=f"time does not rise at frame {frame}"
                )
            )
        elif len(times) > 1 and not late <= LATE * times[1]:
            row["findings"].append(
                finding(
                    "times",
                    value=late,
                    text=f"a frame's time is {late:.4g} s off the declared rate",
                )
            )

    def _guarded(
        self,
        row: dict[str, Any],
        q: Floats,
        times: Floats,
        intervals: Sequence[NearInterval],
    ) -> None:
        """The first frame at which a guard that is asked at each would stop."""
        if len(q) < 2 or not (np.diff(times) > 0.0).all():
            return
        period = float(np.median(np.diff(times)))
        guard, fresh = self._guard(period)
        guard.restore(fresh)
        speeds = np.diff(q, axis=0) / np.diff(times)[:, None]
        speeds = np.concatenate((speeds[:1], speeds))
        fixed = all(part.mode == "fixed" for part in guard.tables.robots)
        for frame, (positions, time) in enumerate(zip(q, times.tolist(), strict=True)):
            if fixed:
                verdict = guard.step(positions, time)
            else:
                # The recorded motion obeys no stop, so that none is in force.
                guard.forget_stops()
                verdict = guard.step(positions, time, velocity=speeds[frame])
            if verdict.level >= Level.STOP:
                row["stop"], row["stop_reason"] = time, verdict.reason.name
                row["needless"] = all(one.end < time for one in intervals)
                row["findings"].append(
                    finding(
                        "stop",
                        start=time,
                        value=frame,
                        text=f"frame {frame}: {verdict.why}",
                    )
                )
                return

    def _guard(self, period: float) -> tuple[Guard, bytes]:
        """A guard with this period, and its state before its first cycle."""
        if period not in self._guards:
            before = self.scene.period
            self.scene.period = period
            try:
                guard = Guard(self.scene, budget=self.budget, self_test=False)
            finally:
                self.scene.period = before
            self._guards[period] = guard, guard.checkpoint()
        return self._guards[period]


def finite_rows(q: Floats) -> NDArray[np.bool_]:
    """Whether each row holds finite numbers, shape (n,)."""
    return np.asarray(np.isfinite(q).all(axis=1), dtype=np.bool_)


def rising(times: Floats) -> Floats:
    """Times that rise: numbers of frames where they do not."""
    if (np.diff(times) > 0.0).all():
        return times
    return np.asarray(times[0] + np.arange(len(times), dtype=np.float64))


def empty_row(one: Input, frames: int) -> dict[str, Any]:
    """A result that says nothing yet."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {"input": one.source, "episode": one.episode, "frames": frames}
    row |= {"contacts": 0, "beyond_limits": 0, "jumps": 0, "frozen": 0, "clear": False}
    row["findings"] = []
    return row


def finding(
    kind: str,
    a: str = "",
    b: str = "",
    start: float | None = None,
    end: float | None = None,
    value: float | None = None,
    text: str = "",
) -> dict[str, Any]:
    """One finding, see `store.FINDING`."""
    figures = {"start": start, "end": end, "value": value}
    plain = {
        name: None if one is None or not isfinite(one) else float(one)
        for name, one in figures.items()
    }
    return {"kind": kind, "a": a, "b": b, **plain, "text": text}
