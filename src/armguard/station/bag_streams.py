"""Samples of one sender, and how those of several are put on one clock."""

from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Nanoseconds of a second.
NANO = 1_000_000_000

# A message that is older than the one before by no more than this was overtaken on its
# way and is left out; by more, somebody has set the clock back [ns].
MOST_OVERTAKEN = NANO // 10

# A header that differs from the time of receipt by more was stamped by another clock,
# or by none [ns].
ODD_CLOCK = 60 * NANO


class Stream:
    """Samples of the same joints from one topic.

    Attributes:
        topic: The topic.
        kind: Type of its messages.
        joints: Names of the joints, as written.
        names: The same with the robot's name before them, if one is known.
    """

    def __init__(self, topic: str, joints: tuple[str, ...], kind: str) -> None:
        self.topic, self.kind, self.joints = topic, kind, joints
        self.names = joints
        self._stamps, self._received = array("q"), array("q")
        self._values = array("d")
        self._kept: Longs | None = None

    def add(
        self, joints: Sequence[str], stamps: Longs, rows: Floats, received: int
    ) -> None:
        """Take in a message: its joints, in any order, and rows of positions."""
        if tuple(joints) != self.joints:
            place = {joint: k for k, joint in enumerate(joints)}
            rows = rows[:, [place[joint] for joint in self.joints]]
        if self._replaces(int(stamps[0])):
            self._cut(int(stamps[0]))
        self._stamps.frombytes(np.ascontiguousarray(stamps).tobytes())
        self._values.frombytes(np.ascontiguousarray(rows).tobytes())
        self._received.extend([received] * len(stamps))

    def name_robot(self, robot: str) -> None:
        """Put a robot's name before the joints'."""
        if robot:
            self.names = tuple(f"{robot}/{joint}" for joint in self.joints)

    @property
    def stamps(self) -> Longs:
        """When the samples were taken, shape (n,) [ns since 1970]."""
        every = np.frombuffer(self._stamps, np.int64)
        return every if self._kept is None else every[self._kept]

    @property
    def received(self) -> Longs:
        """When they were received, shape (n,) [ns since 1970]."""
        every = np.frombuffer(self._received, np.int64)
        return every if self._kept is None else every[self._kept]

    @property
    def q(self) -> Floats:
        """Joint positions, shape (n, k) [rad or m]."""
        every = np.frombuffer(self._values).reshape(-1, len(self.joints))
        return every if self._kept is None else every[self._kept]

    def keep(self, places: Longs) -> None:
        """Leave out all other samples."""
        self._kept = places if self._kept is None else self._kept[places]

    def _replaces(self, stamp: int) -> bool:
        """Whether a new plan replaces what the one before had left."""
        planned = self.kind.endswith("JointTrajectory")
        return planned and len(self._stamps) > 0 and stamp <= self._stamps[-1]

    def _cut(self, stamp: int) -> None:
        """Forget what was planned for that time and later."""
        while self._stamps and self._stamps[-1] >= stamp:
            self._stamps.pop()
            self._received.pop()
            del self._values[-len(self.joints) :]


def check_time(name: str, stream: Stream) -> list[str]:
    """Leave out samples that were overtaken or sent twice; notes about what was found.

    Raises:
        TrajectoryError: Time goes back by more than messages overtake one another.
    """
    stamps, notes = stream.stamps, []
    who = f"{stream.topic} ({', '.join(stream.joints[:2])}, …)"
    newest = np.maximum.accumulate(stamps)
    before = np.concatenate([newest[:1] - 1, newest[:-1]])
    back = before - stamps
    worst = int(back.argmax())
    if back[worst] > MOST_OVERTAKEN:
        raise TrajectoryError(
            f"{name}: {who}: the stamp of message {worst + 1} is "
            f"{back[worst] / NANO:.3f} s older than one before it; time must not go "
            "back. Cut the bag there, at "
            f"{(stream.received[worst] - stream.received[0]) / NANO:.3f} s"
        )
    twice = (back == 0).sum()
    overtaken = (back > 0).sum()
    if twice:
        notes.append(f"{who}: {twice} messages have the stamp of the one before them")
    if overtaken:
        notes.append(
            f"{who}: {overtaken} messages were overtaken by newer ones, by up to "
            f"{back[worst] / NANO * 1e3:.1f} ms, and are left out"
        )
    if twice or overtaken:
        stream.keep(np.flatnonzero(back < 0))
    lag = stream.received - stream.stamps
    if not lag.any():
        notes.append(
            f"{who}: headers have no stamp; the times of receipt are used, which jitter"
        )
    elif np.abs(np.median(lag)) > ODD_CLOCK and not stream.kind.endswith("Trajectory"):
        notes.append(
            f"{who}: stamps are {np.median(lag) / NANO:.0f} s from the times of "
            "receipt: another clock, which is taken as it is"
        )
    return notes


def merged(
    streams: Sequence[Stream],
) -> tuple[tuple[str, ...], Floats, Longs, list[str]]:
    """All streams on one clock: at each stamp of any, the newest sample of each.

    Begins when there is a sample of each, and ends with the stream that ends first:
    from there on it would be judged as if it stood still.

    Returns:
        Names, positions, stamps [ns since 1970], and notes.

    Raises:
        TrajectoryError: There is no time all streams have in common.
    """
    joints = [name for stream in streams for name in stream.names]
    if len(streams) == 1:
        return streams[0].names, streams[0].q, streams[0].stamps, []
    begin = max(int(stream.stamps[0]) for stream in streams)
    end = min(int(stream.stamps[-1]) for stream in streams)
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
    columns: dict[str, tuple[Floats, Longs]] = {}
    notes = []
    for stream in streams:
        place = np.searchsorted(stream.stamps, stamps, side="right") - 1
        age = stamps - stream.stamps[place]
        notes.append(
            f"{stream.topic} ({', '.join(stream.names[:2])}, …): its newest sample is "
            f"{np.median(age) / NANO * 1e3:.1f} ms old at the median, at most "
            f"{age.max() / NANO * 1e3:.1f} ms"
        )
        cut = int((stream.stamps > end).sum() + (stream.stamps < begin).sum())
        if cut:
            notes.append(
                f"{stream.topic}: {cut} samples lie outside of the time that all "
                "streams have in common"
            )
        taken = stream.q[place]
        for k, name in enumerate(stream.names):
            if name in columns:
                # Two senders of the same joint: the newer sample counts.
                values, ages = columns[name]
                newer = age < ages
                columns[name] = (
                    np.where(newer, taken[:, k], values),
                    np.minimum(age, ages),
                )
            else:
                columns[name] = (taken[:, k], age)
    names = tuple(dict.fromkeys(joints))
    return names, np.column_stack([columns[n][0] for n in names]), stamps, notes
