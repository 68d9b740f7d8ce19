"""What is wrong with the joints of recorded episodes: limits, jumps, and others."""

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.fleet.episodes import LARGEST, Frames, finite_rows
from armguard.fleet.result import finding
from armguard.scene import Scene

Floats = NDArray[np.float64]

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


@dataclass(frozen=True, slots=True)
class JointFigures:
    """Figures of the joints of several inputs, each of shape (e, joints).

    Attributes:
        moved: How far joints move [rad or m].
        beyond: How far they are beyond their limits at most, below 0 within them
            [rad or m].
        speed: Greatest speeds in shares of the top speeds; None without times.
        led: How far leaders move, NaN without one; None if there are none [rad or m].
        resting: Frames in which leader and follower rest; None likewise.
        offset: How far leaders are off in these on average; None likewise [rad or m].
    """

    moved: Floats
    beyond: Floats
    speed: Floats | None
    led: Floats | None
    resting: NDArray[np.int64] | None
    offset: Floats | None


class JointChecks:
    """Checks of the joints of a scene; each adds to a result what it finds.

    Attributes:
        names: 'robot/joint' of each joint.
        rest_offset: See `JobModel` [rad or m].

    Args:
        scene: The scene.
        checker: A checker of it.
        rest_offset: See the attribute.
    """

    def __init__(self, scene: Scene, checker: Checker, rest_offset: float) -> None:
        self.names, self.rest_offset = scene.q_names, rest_offset
        self._lower = checker.lower - rounding_of(checker.lower)
        self._upper = checker.upper + rounding_of(checker.upper)
        joints = [name.split("/", 1) for name in scene.q_names]
        models = [scene.robots[robot].model.joints[joint] for robot, joint in joints]
        self._top = np.array([model.velocity or np.inf for model in models])
        self._robot = np.array([robot for robot, _ in joints])

    def figures(self, frames: Frames) -> JointFigures:
        """Figures of all inputs at once."""
        q, leader, begin = frames.q, frames.leader, frames.first[:-1]
        speed = led = resting = offset = None
        with np.errstate(all="ignore"):
            rates = rates_of(q, frames)
            if frames.timed:
                speed = np.fmax.reduceat(rates, begin) / self._top
            if leader is not None:
                led = np.maximum.reduceat(leader, begin)
                led -= np.minimum.reduceat(leader, begin)
            if leader is not None and frames.timed:
                both = (rates < REST) & (rates_of(leader, frames) < REST)
                both[begin] = False
                resting = np.add.reduceat(both.astype(np.int64), begin)
                total = np.add.reduceat(np.where(both, leader - q, 0.0), begin)
                offset = total / np.maximum(resting, 1)
            low, high = np.fmin.reduceat(q, begin), np.fmax.reduceat(q, begin)
            beyond = np.maximum(self._lower - low, high - self._upper)
            moved = high - low
        return JointFigures(moved, beyond, speed, led, resting, offset)

    def add(
        self, row: dict[str, Any], frames: Frames, k: int, figures: JointFigures
    ) -> None:
        """Check one input.

        Args:
            row: Its result, to which findings are added.
            frames: Its frames and those of others.
            k: Its number among them.
            figures: Figures of all of them.
        """
        part = slice(int(frames.first[k]), int(frames.first[k + 1]))
        q, times = frames.q[part], frames.times[part]
        if not frames.finite[part].all():
            self.numbers(row, q)
        self.limits(row, q, times, figures.beyond[k])
        if figures.speed is not None and len(q) > 1:
            self.jumps(row, q, times, figures.speed[k])
        led = None if figures.led is None else figures.led[k]
        self.frozen(row, q, figures.moved[k], led)
        if figures.resting is not None and figures.offset is not None:
            self.rest(row, figures.resting[k], figures.offset[k])
        self.times(row, frames, k)

    def limits(
        self, row: dict[str, Any], q: Floats, times: Floats, most: Floats
    ) -> None:
        """Joints beyond their limits."""
        lower, upper = self._lower, self._upper
        beyond = np.flatnonzero(most > 0.0).tolist()
        row["beyond_limits"] = len(beyond)
        for joint in beyond:
            outside = (q[:, joint] < lower[joint]) | (q[:, joint] > upper[joint])
            bad, name = np.flatnonzero(outside), self.names[joint]
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

    def jumps(
        self, row: dict[str, Any], q: Floats, times: Floats, most: Floats
    ) -> None:
        """Steps that are faster than their joints."""
        top = float(np.fmax.reduce(most))
        row["top_speed"] = top if isfinite(top) else None
        for joint in np.flatnonzero(most > 1.0 + ROUNDING).tolist():
            with np.errstate(all="ignore"):
                rates = np.abs(np.diff(q[:, joint])) / np.diff(times)
            speeds = rates / self._top[joint]
            jumps = np.flatnonzero(speeds > JUMP)
            row["jumps"] += len(jumps)
            fast = jumps if len(jumps) else np.flatnonzero(speeds > 1.0 + ROUNDING)
            name = self.names[joint]
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

    def frozen(
        self, row: dict[str, Any], q: Floats, moved: Floats, led: Floats | None
    ) -> None:
        """Joints of which no bit changes while they are led."""
        for joint in np.flatnonzero(moved == 0.0).tolist():
            name, by = self.names[joint], "its leader"
            far = np.nan if led is None else led[joint]
            if np.isnan(far):
                others = moved[self._robot == self._robot[joint]]
                far, by = others.max(), "another joint"
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

    def rest(
        self, row: dict[str, Any], count: NDArray[np.int64], offset: Floats
    ) -> None:
        """How far followers are off their leaders where both rest."""
        known = np.where(count >= REST_FRAMES, np.abs(offset), -1.0)
        if known.max() < 0.0:
            return
        row["rest_offset"] = float(known.max())
        for joint in np.flatnonzero(known > self.rest_offset).tolist():
            name = self.names[joint]
            row["findings"].append(
                finding(
                    "rest offset",
                    name,
                    value=offset[joint],
                    text=f"{name}: the leader is {offset[joint]:.4g} rad or m off the "
                    f"follower in {count[joint]} frames in which both rest",
                )
            )

    def times(self, row: dict[str, Any], frames: Frames, k: int) -> None:
        """Times that contradict the declared rate, or do not rise."""
        part = slice(int(frames.first[k]), int(frames.first[k + 1]))
        times, late = frames.times[part], float(frames.late[k])
        still = np.flatnonzero(frames.timed & ~(np.diff(times) > 0.0))
        if len(still):
            frame = int(still[0]) + 1
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

    def numbers(self, row: dict[str, Any], q: Floats) -> None:
        """Positions that are no numbers, or far too large."""
        frame = int(np.argmin(finite_rows(q)))
        joint = int(np.argmin(np.abs(q[frame]) < LARGEST))
        row["findings"].append(
            finding(
                "no number",
                self.names[joint],
                value=frame,
                text=f"frame {frame}: {self.names[joint]} is at {q[frame, joint]:g}",
            )
        )


def rates_of(q: Floats, frames: Frames) -> Floats:
    """Speed at which each frame was reached, 0 of the first of each input, (n, k)."""
    rates = np.zeros_like(q)
    np.abs(np.diff(q, axis=0), out=rates[1:])
    rates[1:] /= np.diff(frames.times)[:, None]
    rates[frames.first[:-1]] = 0.0
    return rates


def rounding_of(limits: Floats) -> Floats:
    """How far single-precision numbers at limits may be off, shape (joints,)."""
    size = np.abs(np.where(np.isfinite(limits), limits, 1.0))
    return np.asarray(ROUNDING * np.maximum(size, 1.0))
