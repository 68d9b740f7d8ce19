"""What is recorded for people: joints, levels, lines, words, each at its rate."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.levels import Level, Reason, level_of
from armguard.guard.verdict import Names, Verdict
from armguard.station.blackbox import ros
from armguard.station.blackbox.blocks import places
from armguard.station.blackbox.ros import Stored
from armguard.station.frames import HEADER, JOINTS, ROBOTS, frame_of

Floats = NDArray[np.float64]

# How often each is told at most [s].
JOINTS_EVERY = 0.01
NUMBERS_EVERY = 1.0 / 30.0
LINES_EVERY = 0.1

# Near pairs that are drawn at most.
MOST_LINES = 64

# Colours that those who do not see red and green apart can tell.
CLEAR, SHORT, OVER = (0.34, 0.71, 0.91), (0.90, 0.62, 0.0), (0.80, 0.47, 0.65)

# A pair that has no more than this beyond what it needs is drawn as one that is short
# [m].
LITTLE = 0.01


class Glance:
    """The few numbers of a cycle that are looked at every time.

    Attributes:
        level: Highest level of all robots.
        clearance: What the nearest pair has beyond what it needs; infinite if none is
            near [m].
        slack: Time until a stop must be ordered, as far as it was looked [s].
        levels: Level of each robot; of the scene where no stops are predicted.
    """

    __slots__ = ("clearance", "level", "levels", "slack")

    def __init__(self, row: Floats, first_row: int) -> None:
        _, verdict, poses, _ = places(row)
        numbers = row[verdict:poses]
        reason = Reason(int(numbers[layout.REASON]))
        guarded = first_row > layout.HEADER and len(numbers) >= first_row
        ends = layout.HEADER + (int(row[ROBOTS]) * layout.ROBOT_WIDTH if guarded else 0)
        own = numbers[layout.HEADER : ends : layout.ROBOT_WIDTH]
        self.levels = tuple(int(x) for x in own) or (int(level_of(reason)),)
        self.level = max(int(level_of(reason)), *self.levels)
        self.slack = float(numbers[layout.SLACK_TIME]) if guarded else np.inf
        nearest = int(numbers[layout.NEAREST])
        self.clearance = np.inf
        if nearest >= 0:
            at = first_row + nearest * layout.NEAR_WIDTH + layout.CLEARANCE
            self.clearance = float(numbers[at])


class Narrator:
    """Makes messages of cycles.

    Args:
        joints: Names of the joints.
        robots: Names of the robots.
        names: Names for verdicts; None if the scene is not known.
        first_row: Where near pairs start in a verdict.
    """

    def __init__(
        self,
        joints: Sequence[str],
        robots: Sequence[str],
        names: Names | None,
        first_row: int,
    ) -> None:
        self._joints, self._robots, self._names = tuple(joints), tuple(robots), names
        self.first_row = first_row
        self._joints_at = self._numbers_at = self._lines_at = -np.inf
        self._levels: tuple[int, ...] = ()

    def cycle(self, row: Floats, now: float, time: int) -> Iterator[Stored]:
        """What is to be told of a cycle at `now` [s], `time` on the wall [ns]."""
        if now - self._joints_at >= JOINTS_EVERY:
            self._joints_at = now
            yield from self._motion(row, time)
        glance = Glance(row, self.first_row)
        if now - self._numbers_at >= NUMBERS_EVERY:
            self._numbers_at = now
            yield ros.message(ros.LEVEL, time, glance.level)
            yield ros.message(ros.CLEARANCE, time, glance.clearance)
            yield ros.message(ros.TIME_LEFT, time, glance.slack)
        if now - self._lines_at >= LINES_EVERY:
            self._lines_at = now
            yield self._lines(row, time)
        if glance.levels != self._levels:
            if self._levels or max(glance.levels) > Level.CLEAR:
                yield self._change(row, glance, time)
            self._levels = glance.levels

    def _motion(self, row: Floats, time: int) -> Iterator[Stored]:
        """Where the joints are, and what they are told."""
        n = int(row[JOINTS])
        q, v = row[HEADER : HEADER + n], row[HEADER + n : HEADER + 2 * n]
        yield ros.joints(ros.JOINT_STATES, time, self._joints, q, v)
        told, verdict, _, _ = places(row)
        if verdict > told:
            v, q = row[told : told + n], row[told + n : told + 2 * n]
            yield ros.joints(ros.COMMANDS, time, self._joints, q, v)

    def _lines(self, row: Floats, time: int) -> Stored:
        """Near pairs as lines."""
        _, verdict, poses, _ = places(row)
        pairs = row[verdict + self.first_row : poses]
        pairs = pairs[: len(pairs) // layout.NEAR_WIDTH * layout.NEAR_WIDTH]
        table = pairs.reshape(-1, layout.NEAR_WIDTH)
        order = np.argsort(table[:, layout.CLEARANCE], kind="stable")[:MOST_LINES]
        lines = [
            ros.Line(
                pair[layout.WITNESS + 1 : layout.WITNESS + 4].tolist(),
                pair[layout.WITNESS + 4 : layout.WITNESS + 7].tolist(),
                colour_of(float(pair[layout.CLEARANCE])),
            )
            for pair in table[order]
        ]
        label = ""
        if len(order):
            label = f"{table[order[0], layout.WITNESS] * 1e3:.0f} mm"
        return ros.markers(time, lines, label)

    def _change(self, row: Floats, glance: Glance, time: int) -> Stored:
        """A sentence on a level that changed."""
        names = [Level(level).name for level in glance.levels]
        if len(names) == len(self._robots):
            told = ", ".join(map(": ".join, zip(self._robots, names, strict=True)))
        else:
            told = names[0]
        if self._names is not None:
            frame = frame_of(row)
            fault = frame.text.get("fault", "")
            told += f" ({Verdict(frame.verdict, self._names, None, 0.0, fault).why})"
        level = ros.INFO if glance.level < Level.SLOW else ros.WARN
        level = ros.ERROR if glance.level >= Level.STOP else level
        return ros.log(time, level, told)


def colour_of(clearance: float) -> tuple[float, float, float]:
    """Colour of a near pair by what it has beyond what it needs [m]."""
    if not clearance >= 0.0:
        return OVER
    return SHORT if clearance < LITTLE else CLEAR
