"""What a cycle of the filter gives back: what to tell the robots, and why."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from armguard.guard import Level, Verdict

Floats = NDArray[np.float64]


class Action(IntEnum):
    """What to have a robot do; a higher one is always the safer one."""

    FOLLOW = 0
    """Send it the velocities."""

    STOP = 10
    """A controlled stop, power stays (IEC 60204-1 category 2): the velocities lead to
    it as the figures declare it, or the robot's own stop does."""

    BRAKE = 20
    """Remove power at once (category 0): the stop is not what was declared."""

    HARDWARE_STOP = 30
    """Use whatever stops it from outside: the brake is not what was declared."""


class Blocked(IntEnum):
    """Why a robot does not follow its operator, or not at once."""

    NOT = 0
    """It follows."""

    STOPPED = 10
    """It was stopped; its operator has to let go of it first, or to engage it."""

    TOO_NEAR = 11
    """It rests where it may only move away."""

    PINCHED = 12
    """It rests where every joint that leads away from one thing leads to another."""

    FAR_START = 20
    """It is told a position far from where it is, and its scene says to refuse that."""

    CATCHING_UP = 21
    """It is told a position far from where it is, and goes there slowly."""

    NO_WAY = 30
    """No velocity was found that keeps all it must; it is stopped."""


ACTIONS = {
    Level.STOP: Action.STOP,
    Level.BRAKE: Action.BRAKE,
    Level.HARDWARE_STOP: Action.HARDWARE_STOP,
}


@dataclass(frozen=True, slots=True)
class Command:
    """What to tell the robots in this cycle.

    Attributes:
        velocity: Velocity of each joint, in the order of `q_names`, shape (n,)
            [rad/s or m/s]. Always to be sent, also while a robot stops.
        position: The same for robots that are told positions: where the velocities
            lead until the next cycle, shape (n,) [rad or m].
        actions: What to have each robot do.
        blocked: Why each robot does not simply follow its operator.
        far_joints: Joints that are told positions far from where they are.
        passed: How much of what its operator asked for each robot was told: 1 if all
            of it, 0 if nothing of it [-].
        verdict: What was measured, what was proven, and why.
    """

    velocity: Floats
    position: Floats
    actions: Mapping[str, Action]
    blocked: Mapping[str, Blocked]
    far_joints: tuple[str, ...]
    passed: Mapping[str, float]
    verdict: Verdict

    @property
    def action(self) -> Action:
        """The highest of `actions`."""
        return max(self.actions.values())
