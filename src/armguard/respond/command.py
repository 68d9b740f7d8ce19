"""Command: result of a cycle of the filter, with its reasons."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from armguard.errors import NamedNumber, WithSentence
from armguard.guard.levels import ORDERED, UNTIL_ENGAGED, Level, Reason
from armguard.guard.verdict import Verdict
from armguard.guard.watch import RECOVERING, RUNNING
from armguard.notebook import html_table
from armguard.scene.tables import RobotPart

Floats = NDArray[np.float64]


class Action(NamedNumber):
    """What a client has a robot do; a higher value is always safer."""

    FOLLOW = 0
    """Send the velocities to the robot."""

    HOLD = 5
    """Send the velocities; they keep the robot at rest, see `Command.held`."""

    STOP = 10
    """Controlled stop with power, then monitored standstill (IEC 60204-1 category 2):
    by the velocities, within the declared figures, or by the robot's own stop."""

    BRAKE = 20
    """Remove power at once (category 0): the stop deviates from its declaration."""

    HARDWARE_STOP = 30
    """Stop the robot by external means: the brake deviates from its declaration."""


class Blocked(WithSentence):
    """Reason for which a robot does not follow its operator, or only later.

    Attributes:
        sentence: The reason in words.
        remedy: What releases a robot that is held; empty for robots that move.
    """

    remedy: str

    def __init__(self, _: int, __: str = "", remedy: str = "") -> None:
        self.remedy = remedy

    NOT = 0, "follows its operator"
    """The robot follows its operator."""

    STOPPED = (
        10,
        "stopped, waiting for its operator",
        "send zero velocity once (or a position near it), lead it away",
    )
    """The robot stops, or was stopped and waits: its operator must request zero
    velocity, lead it away from all near pairs, or engage it; after an ordered stop,
    engage it."""

    TOO_NEAR = 11, "too close to a body; only motion away from it is allowed"
    """The robot rests too near to a body: it may only move away."""

    PINCHED = 12, "each motion away from one body approaches another one"
    """The robot has no recovery: each motion that opens one pair closes another."""

    FAR_START = (
        20,
        "the commanded position is far from the measured one",
        "command a position near it",
    )
    """The requested position is far from the robot, and its scene refuses that."""

    CATCHING_UP = 21, "moving slowly to a distant commanded position"
    """The requested position is far from the robot, which moves there slowly."""

    EVADING = 23, "evading an approaching obstacle"
    """The robot evades an approaching obstacle."""

    RETREATING = 24, "retreating as requested"
    """The robot retreats along its trail, or to a safe configuration."""

    WAY_BLOCKED = 25, "a body blocks the retreat; waiting until the path is free"
    """A body blocks the retreat of the robot, which goes on when the path is free."""

    NO_WAY = 30, "no safe velocity exists here; stopping"
    """No velocity was found that satisfies all constraints: the robot is stopped."""

    LOCAL_MINIMUM = (
        40,
        "local minimum of its field: no velocity leads nearer to the goal",
        "lead it elsewhere, set another goal",
    )
    """The field brings the robot no nearer to its goal: it rests until it is led
    elsewhere or engaged, or a goal is set."""


class Changed(IntFlag):
    """Reasons for which the command of a robot differs from the requested motion."""

    SPEED = 1
    """Top speed of a joint, or the share of it that its robot may use."""

    ACCELERATION = 2
    """Declared acceleration of a joint."""

    LIMITS = 4
    """Position limit of a joint."""

    ROWS = 8
    """Constraint row of a near pair, or a recovery."""

    PROOF = 16
    """The request was not proven, or the robot is stopped."""

    BLOCKED = 32
    """The robot does not follow its operator, see `Command.blocked`."""


CHANGED_WORDS = {
    Changed.SPEED: "speed limit of a joint",
    Changed.ACCELERATION: "declared acceleration of a joint",
    Changed.LIMITS: "position limit of a joint",
    Changed.ROWS: "near pair, or recovery",
    Changed.PROOF: "request not proven, or robot stopped",
    Changed.BLOCKED: "robot does not follow its operator",
}


@dataclass(frozen=True, slots=True)
class Held:
    """Robot that is held at rest until its operator acts.

    Attributes:
        robot: Name of the robot.
        blocked: Why it is held: `STOPPED`, `FAR_START` or `LOCAL_MINIMUM`.
        reason: Reason of its last stop; `OK` if there was none.
        since: Time from which it is held, on the clock of the cycle [s].
    """

    robot: str
    blocked: Blocked
    reason: Reason
    since: float

    @property
    def until_engaged(self) -> bool:
        """Whether its stop was ordered, so that only `engage` releases it."""
        return self.blocked is Blocked.STOPPED and self.reason in UNTIL_ENGAGED

    @property
    def cause(self) -> str:
        """Cause of the hold, in words."""
        if self.blocked is Blocked.STOPPED and self.reason:
            return self.reason.sentence
        return self.blocked.sentence

    @property
    def remedy(self) -> str:
        """Remedy: what releases the robot, in words."""
        engage = f"call engage('{self.robot}')"
        if self.until_engaged:
            return engage
        return f"{self.blocked.remedy}, or {engage}"

    @property
    def sentence(self) -> str:
        """Start, cause and remedy of the hold, in words."""
        return (
            f"HELD {self.robot} since {self.since:.1f} s: {self.cause}. "
            f"To go on: {self.remedy}"
        )


# Phases in which a robot moves as commanded. A robot that rests until it may go on is
# held at its position, as after any stop.
DRIVEN = (RUNNING, RECOVERING)

ACTIONS = {
    Level.BRAKE: Action.BRAKE,
    Level.HARDWARE_STOP: Action.HARDWARE_STOP,
}


class Command:
    """Command to the robots for this cycle; immutable, safe to keep.

    Attributes:
        verdict: Verdict of the cycle: measurements, proofs, levels and reasons.
    """

    # Properties split the numbers only on demand: each cycle constructs a command.
    __slots__ = ("_commanded", "_robots", "verdict")

    def __init__(
        self, commanded: Floats, robots: Sequence[RobotPart], verdict: Verdict
    ) -> None:
        self._commanded = commanded
        self._robots = robots
        self.verdict = verdict

    def __repr__(self) -> str:
        """Level, action and sentence of the cycle."""
        return f"<Command {self.verdict.level.name} {self.action.name}: {self.why}>"

    def _repr_html_(self) -> str:
        """The command of each robot as a table, for notebooks."""
        actions, blocked, passed = self.actions, self.blocked, self.passed
        rows = [
            (name, action, blocked[name].sentence, f"{100.0 * passed[name]:.0f} %")
            for name, action in actions.items()
        ]
        return html_table(
            f"{self.action}: {self.why}", ("robot", "action", "state", "passed"), rows
        )

    def _of_joints(self, k: int) -> Floats:
        """Number k of the four numbers of each joint, shape (n,)."""
        n = (len(self._commanded) - 4 * len(self._robots)) // 4
        return self._commanded[k * n : (k + 1) * n]

    def _of_robots(self, k: int) -> Floats:
        """Number k of the four numbers of each robot, shape (r,)."""
        r = len(self._robots)
        first = len(self._commanded) - (4 - k) * r
        return self._commanded[first : first + r]

    @property
    def numbers(self) -> Floats:
        """All numbers of the command, shape (4 n + 4 r,).

        Together with the robots of the scene and the verdict they reproduce the
        command.
        """
        return self._commanded

    @property
    def velocity(self) -> Floats:
        """Commanded joint velocities in the order of `q_names`, (n,) [rad/s or m/s].

        Always send them, also while a robot stops.
        """
        return self._of_joints(0)

    @property
    def position(self) -> Floats:
        """Position set-points, for robots that take positions, shape (n,) [rad or m].

        The velocities lead to them until the next cycle. NaN if the joint was not
        measured since the start or a reset: then send nothing.
        """
        return self._of_joints(1)

    @property
    def actions(self) -> Mapping[str, Action]:
        """Action of each robot, by name."""
        levels = self.verdict.levels
        rows = zip(self._robots, self._of_robots(1), self._of_robots(2), strict=True)
        return {
            part.name: Action.HOLD
            if since == since
            else Action.FOLLOW
            if phase in DRIVEN
            else ACTIONS.get(levels[part.name], Action.STOP)
            for part, phase, since in rows
        }

    @property
    def action(self) -> Action:
        """Highest of `actions`."""
        return max(self.actions.values())

    @property
    def blocked(self) -> Mapping[str, Blocked]:
        """Reason for which each robot does not follow its operator, by name."""
        return {
            part.name: Blocked(int(why))
            for part, why in zip(self._robots, self._of_robots(0), strict=True)
        }

    @property
    def changed(self) -> Mapping[str, Changed]:
        """Reasons for which the command of each robot differs from its request.

        `Changed(0)` if the request passes bit for bit.
        """
        return {
            part.name: Changed(int(why))
            for part, why in zip(self._robots, self._of_robots(3), strict=True)
        }

    @property
    def held(self) -> Mapping[str, Held]:
        """Robots that are held at rest until their operators act, by name."""
        causes, blocked = self.verdict.last_causes, self.blocked
        return {
            part.name: Held(
                part.name, blocked[part.name], causes[part.name], float(since)
            )
            for part, since in zip(self._robots, self._of_robots(2), strict=True)
            if since == since
        }

    @property
    def why(self) -> str:
        """Cycle in one line: the robots that are held, then the verdict's `why`."""
        said = [held.sentence for held in self.held.values()]
        if not said or self.verdict.reason not in (Reason.OK, *ORDERED):
            said.append(self.verdict.why)
        return "; ".join(said)

    def explain(self) -> str:
        """Cycle in full: held robots, changed commands, then `Verdict.explain`."""
        lines = [held.sentence for held in self.held.values()]
        passed, blocked = self.passed, self.blocked
        for name, changed in self.changed.items():
            if changed:
                causes = "; ".join(CHANGED_WORDS[cause] for cause in changed)
                lines.append(f"{name} gets {passed[name]:.0%} of its request: {causes}")
            if changed & Changed.BLOCKED and name not in self.held:
                lines.append(f"{name}: {blocked[name].sentence}")
        return "\n".join([*lines, self.verdict.explain()])

    @property
    def far_joints(self) -> tuple[str, ...]:
        """Joints whose requested positions are far from their set-points."""
        far = self._of_joints(3)
        return tuple(
            f"{part.name}/{joint}"
            for part in self._robots
            for k, joint in enumerate(part.joints)
            if far[part.first_joint + k] > part.response.far
        )

    @property
    def passed(self) -> Mapping[str, float]:
        """Share of its request that each robot is commanded, in [0, 1] [-]."""
        commanded, requested = self._of_joints(0), self._of_joints(2)
        return {
            part.name: share_passed(commanded[own], requested[own])
            for part in self._robots
            for own in (slice(part.first_joint, part.first_joint + part.joint_count),)
        }


def share_passed(commanded: Floats, requested: Floats) -> float:
    """Share of a request that is commanded: projection on the request, in [0, 1]."""
    size = float(requested @ requested)
    if size == 0.0:
        return 1.0
    return min(max(float(commanded @ requested) / size, 0.0), 1.0)
