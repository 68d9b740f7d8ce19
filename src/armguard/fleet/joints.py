"""What is wrong with the joints of recorded episodes: limits, jumps, and others."""

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.batch.checker import Checker
from armguard.batch.room import LARGEST_ANGLE
from armguard.fleet.episodes import Frames
from armguard.fleet.result import finding
from armguard.scene import Scene

Floats = NDArray[np.float64]

# Greatest position [rad or m]; the kernels judge none that is ten times as large.
LARGEST = LARGEST_ANGLE / 10.0

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
        self._lower, self._upper = checker.lower, checker.upper
        joints = [name.split("/", 1) for name in scene.q_names]
        models = [scene.robots[robot].model.joints[joint] for robot, joint in joints]
        self._top = np.array([model.velocity or np.inf for model in models])
        self._robot = np.array([robot for robot, _ in joints])

    def beyond(self, q: Floats) -> Floats:
        """How far joints are beyond their limits, negative within, (n, joints)."""
        beyond = np.maximum(self._lower - q, q - self._upper)
        with np.errstate(invalid="ignore"):
            return np.asarray(beyond - ROUNDING * np.maximum(np.abs(q), 1.0))

    def add(
        self,
        row: dict[str, Any],
        frames: Frames,
        k: int,
        beyond: Floats,
        speeds: Floats | None,
    ) -> None:
        """Check one input.

        Args:
            row: Its result, to which findings are added.
            frames: Its frames and those of others.
            k: Its number among them.
            beyond: See `beyond`, of all of them.
            speeds: See `speeds`, of all of them.
        """
        part = slice(int(frames.first[k]), int(frames.first[k + 1]))
        q, times = frames.q[part], frames.times[part]
        leader = None if frames.leader is None else frames.leader[part]
        self.numbers(row, q)
        self.limits(row, beyond[part], times)
        if speeds is not None:
            self.jumps(row, speeds[part.start : part.stop - 1], times)
        self.frozen(row, q, leader)
        if leader is not None and frames.timed:
            self.rest(row, q, leader, times)
        self.times(row, frames, k)

    def limits(self, row: dict[str, Any], beyond: Floats, times: Floats) -> None:
        """Joints beyond their limits."""
        most = np.nan_to_num(beyond, nan=-1.0).max(axis=0)
        row["beyond_limits"] = int((most > 0.0).sum())
        for joint in np.flatnonzero(most > 0.0).tolist():
            bad = np.flatnonzero(beyond[:, joint] > 0.0)
            name = self.names[joint]
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

    def jumps(self, row: dict[str, Any], speeds: Floats, times: Floats) -> None:
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

    def frozen(self, row: dict[str, Any], q: Floats, leader: Floats | None) -> None:
        """Joints of which no bit changes while they are led."""
        still = (q == q[0]).all(axis=0)
        if not still.any():
            return
        moved = np.ptp(q, axis=0)
        led = np.zeros(len(still)) if leader is None else np.ptp(leader, axis=0)
        for joint in np.flatnonzero(still).tolist():
            name, by = self.names[joint], "its leader"
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

    def rest(
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
        for joint in np.flatnonzero(np.abs(offset) > self.rest_offset).tolist():
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

    def speeds(self, frames: Frames, inner: NDArray[np.bool_]) -> Floats | None:
        """Share of its top speed of each joint in each step; None without time."""
        if not frames.timed or len(frames.q) < 2:
            return None
        passed = np.where(inner, np.diff(frames.times), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates = np.abs(np.diff(frames.q, axis=0)) / (passed[:, None] * self._top)
        return np.asarray(np.nan_to_num(rates, nan=0.0, posinf=np.inf))

    def numbers(self, row: dict[str, Any], q: Floats) -> None:
        """Positions that are no numbers, or far too large."""
        good = finite_rows(q)
        if good.all():
            return
        frame = int(np.argmin(good))
        joint = int(np.argmin(np.abs(q[frame]) < LARGEST))
        row["findings"].append(
            finding(
                "no number",
                self.names[joint],
                value=frame,
                text=f"frame {frame}: {self.names[joint]} is at {q[frame, joint]:g}",
            )
        )


def finite_rows(q: Floats) -> NDArray[np.bool_]:
    """Whether each row holds numbers that can be positions, shape (n,)."""
    return np.asarray((np.abs(q) < LARGEST).all(axis=1), dtype=np.bool_)
