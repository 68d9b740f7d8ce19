"""Messages for people, each at its rate: joints, levels, lines, sentences."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.answer import Names, names_of
from armguard.guard.layout import IN_HEADER, IN_NEAR
from armguard.guard.levels import Level, Reason
from armguard.guard.verdict import Verdict
from armguard.recording import ros
from armguard.recording.frames import HEADER, IN_FRAME, frame_of, sections
from armguard.recording.palette import ORANGE, PURPLE, SKY
from armguard.recording.ros import Stored
from armguard.scene.archive import ArchiveError, scene_of
from armguard.scene.compile import compile_scene

Floats = NDArray[np.float64]

log = logging.getLogger("armguard.blackbox")

# Least time between two messages of each kind [s].
JOINTS_EVERY = 0.01
NUMBERS_EVERY = 1.0 / 30.0
LINES_EVERY = 0.1

# Near pairs that are drawn at most.
MOST_LINES = 64

CLEAR, SHORT, OVER = (
    tuple(part / 255.0 for part in colour) for colour in (SKY, ORANGE, PURPLE)
)

# A pair with less headroom than this is drawn as one that is short [m].
LITTLE = 0.01


class Summary:
    """The few numbers of a cycle that are read every time.

    Attributes:
        level: Highest level of all robots.
        headroom: Of the nearest pair; infinite if none is near [m].
        time_left: Time until a stop must be ordered, as far as it was predicted [s].
        levels: Level of each robot; of the scene where no stops are predicted.
    """

    __slots__ = ("headroom", "level", "levels", "time_left")

    def __init__(self, row: Floats, first_row: int) -> None:
        *_, verdict, poses, _ = sections(row)
        numbers = row[verdict:poses]
        reason = Reason(int(numbers[IN_HEADER.reason]))
        guarded = first_row > layout.HEADER and len(numbers) >= first_row
        ends = layout.HEADER + (
            int(row[IN_FRAME.robots]) * layout.ROBOT_WIDTH if guarded else 0
        )
        own = numbers[layout.HEADER : ends : layout.ROBOT_WIDTH]
        self.levels = tuple(int(x) for x in own) or (int(reason.level),)
        self.level = max(int(reason.level), *self.levels)
        self.time_left = (
            float(numbers[IN_HEADER.least_time_left]) if guarded else np.inf
        )
        nearest = int(numbers[IN_HEADER.nearest])
        self.headroom = np.inf
        if nearest >= 0:
            at = first_row + nearest * layout.NEAR_WIDTH + IN_NEAR.headroom
            self.headroom = float(numbers[at])


class MessageMaker:
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
        """Messages of a cycle at `now` [s], `time` on the wall [ns]."""
        if now - self._joints_at >= JOINTS_EVERY:
            self._joints_at = now
            yield from self._motion(row, time)
        summary = Summary(row, self.first_row)
        if now - self._numbers_at >= NUMBERS_EVERY:
            self._numbers_at = now
            yield ros.message(ros.LEVEL, time, summary.level)
            yield ros.message(ros.HEADROOM, time, summary.headroom)
            yield ros.message(ros.TIME_LEFT, time, summary.time_left)
        if now - self._lines_at >= LINES_EVERY:
            self._lines_at = now
            yield self._lines(row, time)
        if summary.levels != self._levels:
            if self._levels or max(summary.levels) > Level.CLEAR:
                yield self._change(row, summary, time)
            self._levels = summary.levels

    def _motion(self, row: Floats, time: int) -> Iterator[Stored]:
        """Positions and velocities of the joints, measured and commanded."""
        n, (*_, sent, verdict, _, _) = int(row[IN_FRAME.joints]), sections(row)
        measured, names = row[HEADER : HEADER + 2 * n].reshape(2, n), self._joints
        yield ros.joints(ros.JOINT_STATES, time, names, measured)
        if verdict > sent:
            velocity, position = row[sent : sent + 2 * n].reshape(2, n)
            command = np.array((position, velocity))
            yield ros.joints(ros.COMMANDS, time, names, command)

    def _lines(self, row: Floats, time: int) -> Stored:
        """Near pairs as lines."""
        *_, verdict, poses, _ = sections(row)
        pairs = row[verdict + self.first_row : poses]
        pairs = pairs[: len(pairs) // layout.NEAR_WIDTH * layout.NEAR_WIDTH]
        table = pairs.reshape(-1, layout.NEAR_WIDTH)
        order = np.argsort(table[:, IN_NEAR.headroom], kind="stable")[:MOST_LINES]
        rows = table[order, IN_NEAR.distance : IN_NEAR.distance + 7]
        colours = [colour_of(left) for left in table[order, IN_NEAR.headroom].tolist()]
        label = f"{rows[0, 0] * 1e3:.0f} mm" if len(rows) else ""
        return ros.markers(time, rows[:, 1:].reshape(-1, 2, 3), colours, label)

    def _change(self, row: Floats, summary: Summary, time: int) -> Stored:
        """A sentence on a level that changed."""
        names = [Level(level).name for level in summary.levels]
        sentence = names[0]
        if len(names) == len(self._robots):
            sentence = ", ".join(map(": ".join, zip(self._robots, names, strict=True)))
        if self._names is not None:
            frame = frame_of(row)
            fault = frame.text.get("fault", "")
            verdict = Verdict(frame.verdict, self._names, None, 0.0, fault)
            sentence += f" ({verdict.why})"
        level = ros.INFO if summary.level < Level.SLOW else ros.WARN
        level = ros.ERROR if summary.level >= Level.STOP else level
        return ros.log(time, level, sentence)


def colour_of(headroom: float) -> Sequence[float]:
    """Colour of a near pair by its headroom [m]."""
    if not headroom >= 0.0:
        return OVER
    return SHORT if headroom < LITTLE else CLEAR


def maker_of(about: Mapping[str, Any], archive: bytes) -> MessageMaker | None:
    """A maker of messages of the scene that is recorded; None if it is not known."""
    if not archive:
        log.warning("the scene is not in the ring: no replay, and no names of pairs")
        return None
    try:
        names = names_of(compile_scene(scene_of(archive)))
    except ArchiveError as error:
        log.warning("%s", error)
        return None
    joints, robots = about.get("names", ()), about.get("robots", ())
    return MessageMaker(joints, robots, names, names.first_row)


def nameless(row: Floats) -> MessageMaker:
    """A maker of messages of a scene that is not known, from the frame of a cycle."""
    n, r = int(row[IN_FRAME.joints]), int(row[IN_FRAME.robots])
    first = layout.HEADER + (
        r * layout.ROBOT_WIDTH + n if row[IN_FRAME.told] > 0 else 0
    )
    joints = [f"joint{k + 1}" for k in range(n)]
    return MessageMaker(joints, [f"robot{k + 1}" for k in range(r)], None, first)
