"""The programs of all robots in one cycle: arrays made once, written every cycle."""

import numpy as np
from numpy.typing import NDArray

from armguard.respond.program import (
    BREAKS,
    BY_CONTRIBUTION,
    BY_PRIORITY,
    EQUALLY,
    FOLLOWS,
    FOUND,
    PRIORITY,
    RETREATS,
    ROWS,
    SETTINGS,
    SHARING,
    SPEED_SHARE,
    frame_programs,
)
from armguard.scene.settings import Sharing
from armguard.scene.tables import RobotPart

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

SHARINGS: dict[Sharing, int] = {
    "contribution": BY_CONTRIBUTION,
    "equal": EQUALLY,
    "priority": BY_PRIORITY,
}


class Programs:
    """What each robot is asked for, what it may do, and what its rows allow.

    Attributes:
        parts: Each robot's part of a vector of all joints.
        asked: See `frame_programs`, from here to `found`.
        settings: Settings of each robot.
        target: What is told at once of what is asked for.
        low: Least velocities.
        high: Greatest velocities.
        brake: Velocities that keep every row.
        rows: Unit rows.
        limits: What they must not exceed.
        found: Counts of rows, and whether the target breaks one.
        lines: Ledger of the guard's workspace.

    Args:
        robots: Robots of the scene.
        lines: Ledger of the guard's workspace.
    """

    def __init__(self, robots: tuple[RobotPart, ...], lines: Longs) -> None:
        n = sum(part.joint_count for part in robots)
        self.parts = tuple(
            slice(part.first_joint, part.first_joint + part.joint_count)
            for part in robots
        )
        self.asked = np.zeros(n)
        self.settings = np.zeros((len(robots), SETTINGS))
        for r, part in enumerate(robots):
            self.settings[r, SHARING] = SHARINGS[part.response.sharing]
            self.settings[r, PRIORITY] = part.response.priority
        self.target, self.low, self.high, self.brake = np.zeros((4, n))
        self.rows = np.zeros((len(robots) * ROWS, n))
        self.limits = np.zeros(len(robots) * ROWS)
        self.found = np.zeros((len(robots), FOUND), dtype=np.int64)
        self._raw = np.zeros(n)
        self.lines = lines

    def set_robot(
        self, r: int, *, follows: bool, speed_share: float, retreats: bool
    ) -> None:
        """Say what a robot may do in this cycle."""
        row = self.settings[r]
        row[FOLLOWS], row[SPEED_SHARE], row[RETREATS] = follows, speed_share, retreats

    def frame(self) -> None:
        """Write all programs from what is asked for and what was measured."""
        frame_programs(
            self.asked,
            self.settings,
            self.target,
            self.low,
            self.high,
            self.brake,
            self.rows,
            self.limits,
            self.found,
            self._raw,
            self.lines,
        )

    def breaks(self, r: int) -> bool:
        """Whether a robot's target breaks a row."""
        return bool(self.found[r, BREAKS])

    def rows_of(self, r: int) -> Floats:
        """A robot's rows, over all joints, shape (ROWS, n)."""
        return self.rows[r * ROWS : (r + 1) * ROWS]

    def limits_of(self, r: int) -> Floats:
        """What they must not exceed, shape (ROWS,)."""
        return self.limits[r * ROWS : (r + 1) * ROWS]
