"""The newest state of every robot, and who sends it."""

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables
from armguard.station.wire.layout import (
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    MOST_ROBOTS,
    SEAL,
    STATE,
    WISH,
)

Floats = NDArray[np.float64]

# Where the positions of a STATE begin.
FIRST = HEADER.size + STATE.size


class States:
    """What controllers measured last.

    Attributes:
        q: Joint positions, shape (n,) [rad or m].
        velocity: Joint velocities, shape (n,) [rad/s or m/s].
        stamps: When each robot was measured [s].
        measured: Whether the newest state of each robot had velocities.
        sender: Controller of each robot, 0 for none yet.
        sequence: Number of the state of each robot.
        heard: When it came in, monotonic [ns].
        complete: Whether every robot has one.

    Args:
        tables: The scene.
        watchdog: After that much silence a robot may get another controller [ns].
    """

    def __init__(self, tables: SceneTables, watchdog: int) -> None:
        self._watchdog = watchdog
        self._names = tuple(part.name for part in tables.robots)
        self._parts = tuple(
            slice(part.first_joint, part.first_joint + part.joint_count)
            for part in tables.robots
        )
        r, n = len(self._names), len(tables.q_names)
        self.q: Floats = np.full(n, np.nan)
        self.velocity: Floats = np.zeros(n)
        self.stamps: dict[str, float] = dict.fromkeys(self._names, float("nan"))
        self.measured = [False] * r
        self.sender = [0] * r
        self.sequence = [0] * r
        self.heard = [0] * r
        self.complete = False
        # Robots and number of joints by the bits that name them, as they come.
        self._robots_of: dict[int, tuple[tuple[int, ...], int]] = {}

    @property
    def velocities(self) -> Floats | None:
        """Measured velocities, None unless every robot's are known."""
        return self.velocity if all(self.measured) else None

    def take(
        self,
        message: memoryview,
        words: Floats,
        sender: int,
        sequence: int,
        now: int,
    ) -> tuple[str, int]:
        """Take a STATE over.

        Args:
            message: The message.
            words: The same as float64.
            sender: Who sent it.
            sequence: Its number.
            now: Monotonic clock [ns].

        Returns:
            Why it was dropped, "" if it was not, and where the wish in it begins, 0
            for none [bytes].
        """
        if len(message) < FIRST + SEAL:
            return "payload", 0
        bits, flags, stamp = STATE.unpack_from(message, HEADER.size)
        robots, joints = self._named(bits)
        if not robots:
            return "robots", 0
        both = 2 if flags & HAS_VELOCITY else 1
        end = FIRST + 8 * joints * both
        room = len(message) - SEAL - end
        # With a wish there is more, and how much more is the wish's to tell.
        if not (room >= WISH.size if flags & HAS_WISH else room == 0):
            return "joints", 0
        for r in robots:
            if self.sender[r] != sender and self.sender[r]:
                if now - self.heard[r] < self._watchdog:
                    return "second_controller", 0
        at = FIRST // 8
        for r in robots:
            own = self._parts[r]
            count = own.stop - own.start
            self.q[own] = words[at : at + count]
            if both == 2:
                self.velocity[own] = words[at + joints : at + joints + count]
            at += count
            self.stamps[self._names[r]] = stamp
            self.measured[r] = both == 2
            self.sender[r], self.sequence[r] = sender, sequence
            self.heard[r] = now
        self.complete = self.complete or 0 not in self.sender
        return "", end if flags & HAS_WISH else 0

    def release(self, sender: int) -> None:
        """A controller has left; its robots may get another one at once."""
        for r, own in enumerate(self.sender):
            if own == sender:
                self.sender[r] = 0

    def _named(self, bits: int) -> tuple[tuple[int, ...], int]:
        """Robots that bits name, and how many joints they have together."""
        found = self._robots_of.get(bits)
        if found is None:
            if bits >> len(self._names):
                return (), 0
            robots = tuple(r for r in range(MOST_ROBOTS) if bits >> r & 1)
            joints = sum(self._parts[r].stop - self._parts[r].start for r in robots)
            found = self._robots_of[bits] = robots, joints
        return found
