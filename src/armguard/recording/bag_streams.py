"""Joint positions in messages of ROS, and several senders on one clock."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Nanoseconds of a second.
NANO = 1_000_000_000

# A message that is older than the one before by no more than this was overtaken on its
# way and is left out; by more, the clock was set back [ns].
MOST_OVERTAKEN = NANO // 10

# A header that differs from the time of receipt by more was stamped by another clock,
# or by none [ns].
ODD_CLOCK = 60 * NANO

# Messages that hold joint positions.
MEASURED = "sensor_msgs/msg/JointState"
CONTROLLED = "control_msgs/msg/JointTrajectoryControllerState"
PLANNED = "trajectory_msgs/msg/JointTrajectory"
KINDS = (MEASURED, CONTROLLED, PLANNED)

# Joints, and samples of them: stamp [ns since 1970] and positions.
Points = tuple[tuple[str, ...], list[tuple[int, Any]]]


def nanoseconds(time: Any) -> int:
    """A time or a duration of ROS [ns]."""
    return int(time.sec) * NANO + int(time.nanosec)


def points_of(message: Any, kind: str, received: int) -> Points:
    """Joint positions in a message; no samples if it has none.

    A plan's waypoints count from the header's stamp on. What a controller measured is
    `feedback` since ROS 2 Iron and was `actual` before.

    Args:
        message: The message.
        kind: Its type, of `KINDS`.
        received: When the bag got it, if its header does not say [ns since 1970].
    """
    start = nanoseconds(message.header.stamp) or received
    if kind == MEASURED:
        return tuple(message.name), samples(start, [(0, message.position)])
    if kind == PLANNED:
        points = [(nanoseconds(p.time_from_start), p.positions) for p in message.points]
        return tuple(message.joint_names), samples(start, points)
    found = [getattr(message, name, None) for name in ("feedback", "actual")]
    measured = samples(start, [(0, point.positions) for point in found if point])
    return tuple(message.joint_names), measured[:1]


def samples(start: int, points: Sequence[tuple[int, Any]]) -> list[tuple[int, Any]]:
    """Those of some points that have positions, at their times."""
    return [(start + since, row) for since, row in points if len(row)]


@dataclass(slots=True)
class Stream:
    """Samples of the same joints from one topic, as they come."""

    topic: str
    joints: tuple[str, ...]  # their names, as written
    planned: bool  # whether a message replaces the rest of the one before
    robot: str = ""  # put before the joints' names; "" if it is not known
    # When the samples were taken and received [ns since 1970].
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    # Positions, one row after another [rad or m].
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(
        self, joints: tuple[str, ...], points: Sequence[tuple[int, Any]], received: int
    ) -> None:
        """Take in a message: its joints, in any order, and their samples."""
        while self.planned and self.stamps and self.stamps[-1] >= points[0][0]:
            del self.stamps[-1], self.received[-1], self.values[-len(self.joints) :]
        for stamp, positions in points:
            row = np.asarray(positions, dtype=np.float64)
            if joints != self.joints:
                row = row[[joints.index(joint) for joint in self.joints]]
            self.stamps.append(stamp)
            self.received.append(received)
            self.values.frombytes(row.tobytes())


class Samples(NamedTuple):
    """Samples of the same joints from one topic, in order."""

    topic: str
    names: tuple[str, ...]  # of the joints
    q: Floats  # joint positions, shape (n, len(names)) [rad or m]
    stamps: Longs  # when they were taken, shape (n,) [ns since 1970]


def in_order(name: str, stream: Stream, notes: list[str]) -> Samples:
    """A stream without samples that were overtaken or sent twice.

    Args:
        name: Name of the bag.
        stream: The stream.
        notes: Gets what was found.

    Raises:
        TrajectoryError: Time goes back by more than messages overtake one another.
    """
    stamps, received = np.array(stream.stamps), np.array(stream.received)
    q = np.array(stream.values).reshape(len(stamps), -1)
    own = f"{stream.topic} ({', '.join(stream.joints[:2])}, …)"
    newest = np.maximum.accumulate(stamps)
    back = np.concatenate([newest[:1] - 1, newest[:-1]]) - stamps
    worst = int(back.argmax())
    if back[worst] > MOST_OVERTAKEN:
        since = (received[worst] - received[0]) / NANO
        raise TrajectoryError(
            f"{name}: {own}: the stamp of message {worst + 1} is "
            f"{back[worst] / NANO:.3f} s older than one before it; time must not go "
            f"back. Cut the bag there, at {since:.3f} s"
        )
    if twice := (back == 0).sum():
        notes.append(f"{own}: {twice} messages have the stamp of the one before them")
    if overtaken := (back > 0).sum():
        notes.append(
            f"{own}: {overtaken} messages were overtaken by newer ones, by up to "
            f"{back[worst] / NANO * 1e3:.1f} ms, and are left out"
        )
    kept = back < 0
    lag = (received - stamps)[kept]
    if not lag.any():
        notes.append(
            f"{own}: headers have no stamp; the times of receipt are used, which jitter"
        )
    elif abs(np.median(lag)) > ODD_CLOCK and not stream.planned:
        notes.append(
            f"{own}: stamps are {np.median(lag) / NANO:.0f} s from the times of "
            "receipt: another clock, which is taken as it is"
        )
    before = f"{stream.robot}/" if stream.robot else ""
    names = tuple(before + joint for joint in stream.joints)
    return Samples(stream.topic, names, q[kept], stamps[kept])


def merged(
    streams: Sequence[Samples], notes: list[str]
) -> tuple[tuple[str, ...], Floats, Longs]:
    """All streams on one clock: at each stamp of any, the newest sample of each.

    Begins when there is a sample of each, and ends with the stream that ends first:
    from there on it would be judged as if it stood still. Of two senders of the same
    joint the newer sample counts.

    Returns:
        Names, positions, stamps [ns since 1970].

    Raises:
        TrajectoryError: There is no time all streams have in common.
    """
    if len(streams) == 1:
        return streams[0].names, streams[0].q, streams[0].stamps
    begin = max(stream.stamps[0] for stream in streams)
    end = min(stream.stamps[-1] for stream in streams)
    if begin > end:
        spans = "; ".join(
            f"{stream.topic} from {(stream.stamps[0] - begin) / NANO:+.3f} s to "
            f"{(stream.stamps[-1] - begin) / NANO:+.3f} s"
            for stream in streams
        )
        raise TrajectoryError(
            f"{' and '.join(stream.topic for stream in streams)} have no time in "
            f"common: {spans}"
        )
    stamps = np.unique(np.concatenate([stream.stamps for stream in streams]))
    stamps = stamps[(stamps >= begin) & (stamps <= end)]
    columns: dict[str, Floats] = {}
    ages: dict[str, Longs] = {}
    for stream in streams:
        place = np.searchsorted(stream.stamps, stamps, side="right") - 1
        age = stamps - stream.stamps[place]
        notes.append(
            f"{stream.topic} ({', '.join(stream.names[:2])}, …): its newest sample is "
            f"{np.median(age) / NANO * 1e3:.1f} ms old at the median, at most "
            f"{age.max() / NANO * 1e3:.1f} ms"
        )
        if cut := ((stream.stamps > end) | (stream.stamps < begin)).sum():
            notes.append(
                f"{stream.topic}: {cut} samples lie outside of the time that all "
                "streams have in common"
            )
        for name, column in zip(stream.names, stream.q[place].T, strict=True):
            newer = age < ages.get(name, age)
            columns[name] = np.where(newer, column, columns.get(name, column))
            ages[name] = np.minimum(age, ages.get(name, age))
    return tuple(columns), np.column_stack(list(columns.values())), stamps
