"""What is wrong with recorded episodes: contacts, limits, jumps, joints that freeze."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.batch.results import NearestPairs
from armguard.fleet.episodes import Frames
from armguard.fleet.inputs import PLAN, Input
from armguard.fleet.job import JobModel
from armguard.fleet.joints import JointChecks
from armguard.fleet.result import empty_row, finding
from armguard.guard import Level
from armguard.prove.paving import NearInterval, Paver
from armguard.prove.tube import Tube
from armguard.respond import Guard
from armguard.scene import Scene
from armguard.simulation.judge import RESOLUTION, near_intervals, rising

Floats = NDArray[np.float64]

# A motion that loads the kernels [rad or m], and its frames a second [Hz].
WARM, RATE = 0.5, 30.0


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
        self._largest = float(self._checker.tables.buffers.max(initial=0.0))
        self._joints = JointChecks(self.scene, self._checker, self.job.rest_offset)

    def warm_up(self) -> None:
        """Load the kernels, by a motion of all joints about home."""
        q = np.array([self.scene.home, self.scene.home + WARM, self.scene.home])
        one = Input("warm-up", PLAN, -1, len(q), 0, 0)
        times = np.arange(len(q)) / RATE
        frames = Frames([one], np.array([0, len(q)]), q, None, times, True, np.zeros(1))
        for _ in self.audit(frames):
            pass
        # A motion that touches nothing has left some out.
        self._paver.least(Tube.straight(times, q))

    def audit(self, frames: Frames) -> Iterator[dict[str, Any]]:
        """The result of each input, see `COLUMNS`."""
        q, first = frames.q, frames.first
        inner = np.ones(max(len(q) - 1, 0), dtype=bool)
        inner[first[1:-1] - 1] = False
        step = np.flatnonzero(inner)
        proven = np.ones(len(inner), dtype=bool)
        proven[step] = self._checker.prove(q[step], q[step + 1]).proven
        near = self._checker.distances(q)
        known = np.where(np.isnan(near.distance), np.inf, near.distance)
        home = np.tile(self.scene.home, (len(first) - 1, 1))
        start = self._checker.prove(home, q[first[:-1]])
        figures = self._joints.figures(frames)
        for k, one in enumerate(frames.inputs):
            part = slice(int(first[k]), int(first[k + 1]))
            steps, times = slice(part.start, part.stop - 1), frames.times[part]
            row = empty_row(one, len(times))
            row["duration"] = float(times[-1]) if frames.timed else None
            intervals = self._intervals(frames, part, proven[steps])
            add_contacts(row, intervals)
            self._nearest(row, frames, part, near, known[part])
            self._joints.add(row, frames, k, figures)
            self._start(row, start.proven[k], start.share[k], start.a[k], start.b[k])
            if self.job.guard and frames.timed and frames.finite[part].all():
                self._guarded(row, q[part], times, intervals)
            row["clear"] = not intervals and bool(frames.finite[part].all())
            yield row

    def _names(self, a: int, b: int) -> tuple[str, str]:
        """Links of two primitives."""
        links = self._paver.links
        one, other = links.of_primitive[[a, b]]
        return links.names[one], links.names[other]

    def _nearest(
        self,
        row: dict[str, Any],
        frames: Frames,
        part: slice,
        near: NearestPairs,
        known: Floats,
    ) -> None:
        """Least distance of all frames, where no interval has a lesser one."""
        frame = int(np.argmin(known)) if len(known) else 0
        if row["least"] is not None or not len(known) or not isfinite(known[frame]):
            return
        times = frames.times[part]
        row["least"], row["time"] = float(known[frame]), float(times[frame])
        pair = int(near.a[part][frame]), int(near.b[part][frame])
        row["a"], row["b"] = self._names(*pair)
        around = slice(max(frame - 1, 0), frame + 2)
        if known[frame] < self._largest and frames.finite[part][around].all():
            # Primitives are too near, and their links' exact shapes are not.
            tube = Tube.straight(rising(times[around]), frames.q[part][around])
            place = self._paver.least(tube) if len(times) > 1 else None
            if place is not None:
                row["least"], row["time"] = place.distance, place.time
                row["a"], row["b"] = place.a, place.b

    def _intervals(
        self, frames: Frames, part: slice, proven: NDArray[np.bool_]
    ) -> list[NearInterval]:
        """What the steps that are not proven come to, see `Paver.intervals`."""
        if len(proven) and proven.all():
            return []
        q, times = frames.q[part], frames.times[part]
        alone = len(q) == 1 and not self._checker.clear(q)[0]
        if alone and np.isfinite(q).all():
            # One frame has no step: as long as it lasts, it is where it is.
            q, times = np.repeat(q, 2, axis=0), np.array([0.0, 1.0])
            proven = np.zeros(1, dtype=bool)
        finite = frames.finite[part]
        open_steps = ~proven & finite[:-1] & finite[1:]
        resolution = RESOLUTION if frames.timed else RESOLUTION * 10.0
        return [*near_intervals(self._paver, times, q, open_steps, resolution)]

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
        guard, speeds = self.guard_for(times), speeds_at(q, times)
        for frame, (positions, time) in enumerate(zip(q, times.tolist(), strict=True)):
            if self.fixed:
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

    @property
    def fixed(self) -> bool:
        """Whether no robot's stops are predicted."""
        return all(part.mode == "fixed" for part in self._checker.tables.robots)

    def guard_for(self, times: Floats) -> Guard:
        """A guard whose period is that of some times, as before its first cycle."""
        period = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
        if period not in self._guards:
            before = self.scene.period
            self.scene.period = period
            try:
                guard = Guard(self.scene, budget=self.budget, self_test=False)
            finally:
                self.scene.period = before
            self._guards[period] = guard, guard.checkpoint()
        guard, fresh = self._guards[period]
        guard.restore(fresh)
        return guard


def add_contacts(row: dict[str, Any], intervals: Sequence[NearInterval]) -> None:
    """Add intervals in which a pair may be nearer than its buffer to a result."""
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


def speeds_at(q: Floats, times: Floats) -> Floats:
    """Velocity with which each frame was reached, shape (n, joints) [rad/s or m/s].

    The first one has that of the second.
    """
    if len(q) < 2:
        return np.zeros_like(q)
    speeds = np.diff(q, axis=0) / np.diff(times)[:, None]
    return np.concatenate((speeds[:1], speeds))
