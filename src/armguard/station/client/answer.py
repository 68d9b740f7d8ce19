"""What the service told robots in a cycle."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.station.client.enums import words
from armguard.station.client.welcome import Welcome
from armguard.station.wire.layout import (
    COMMAND,
    HEADER,
    MISSED,
    NOBODY,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    SUMMARY,
    MessageError,
)
from armguard.station.wire.words import Cause

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked

Floats = NDArray[np.float64]

# As `Level` and `Action` number a stop.
STOP_LEVEL, STOP_ACTION = 30, 10


class RobotNumbers(NamedTuple):
    """What one robot is told, see docs/service.md."""

    level: int
    action: int
    blocked: int
    stopped_by: int
    speed_scale: float
    urgency: float
    age: float
    sender: int
    sequence: int


# What a robot is told by a client that has heard nothing.
STOPPED = RobotNumbers(STOP_LEVEL, STOP_ACTION, 0, 0, 0.0, 1.0, inf, 0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The pair with the least clearance.

    Attributes:
        a: Body of A: 'robot/link', or an object's name.
        b: Body of B.
        distance: Signed distance of their surfaces [m].
        clearance: What is left of it beyond what the pair needs [m].
        point_a: Witness point on A, world, shape (3,) [m].
        point_b: Witness point on B, world, shape (3,) [m].
    """

    a: str
    b: str
    distance: float
    clearance: float
    point_a: Floats
    point_b: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What the service told robots; or what a client tells that hears nothing.

    Attributes:
        cycle: Number of the cycle; -1 if no service told it.
        velocity: Joint velocities to send, shape (n,) [rad/s or m/s].
        position: The same as positions, shape (n,) [rad or m].
        cause: What the service or the client has to say beside the guard's reason.
        slack: What the nearest pair has left beyond what it needs [m].
        slack_time: Least time until a stop must be ordered [s].
        nearest: The pair with the least clearance; None if none is near.
        commander: Who commands; 0 for nobody.
        began: Sender and number of the state that began the cycle; zeros for none.
        missed: Whether the cycle ended later than its period allows.
        inside: From the state's arrival to when it had been judged; NaN if no state
            began the cycle [s].
        time: Time of the cycle, on the service's clock [s].
        sent: When the answer was sent, on the service's clock [s].
        clock: The service's clock, as far as it is known here.
        welcome: What the service told about itself.
        numbers: What each robot is told, in the order of a COMMAND.
        level_number: The highest level.
        action_number: The highest action.
        reason_number: The guard's reason.
    """

    cycle: int
    velocity: Floats
    position: Floats
    cause: Cause
    slack: float
    slack_time: float
    nearest: Nearest | None
    commander: int
    began: tuple[int, int]
    missed: bool
    inside: float
    time: float
    sent: float
    clock: Callable[[], float]
    welcome: Welcome
    numbers: tuple[RobotNumbers, ...]
    level_number: int
    action_number: int
    reason_number: int

    @property
    def stops(self) -> bool:
        """Whether any robot does not follow its operator."""
        return self.action_number >= STOP_ACTION

    @property
    def age(self) -> float:
        """How long ago it was sent [s]."""
        return self.clock() - self.sent

    @property
    def sequence(self) -> int:
        """Number of the newest state it was judged from; 0 for none."""
        return max((row.sequence for row in self.numbers), default=0)

    @property
    def action(self) -> "Action":
        """The highest of `actions`."""
        return words().action(self.action_number)

    @property
    def actions(self) -> "dict[str, Action]":
        """What to have each robot do."""
        action = words().action
        return {name: action(row.action) for name, row in self._rows()}

    @property
    def level(self) -> "Level":
        """The highest of `levels`, and of the guard's reason."""
        return words().level(self.level_number)

    @property
    def levels(self) -> "dict[str, Level]":
        """What each robot should do."""
        level = words().level
        return {name: level(row.level) for name, row in self._rows()}

    @property
    def reason(self) -> "Reason | Cause":
        """Why the level is what it is."""
        if self.cause.stops:
            return self.cause
        return words().reason(self.reason_number)

    @property
    def sentence(self) -> str:
        """The reason in words; `Client.call("why")` knows names and numbers as well."""
        if self.cause.stops:
            return self.cause.sentence
        sentence = self.welcome.reasons[self.reason_number][1]
        near = self.nearest
        if near is not None and self.level_number:
            away = f"{near.a} to {near.b}: {near.distance * 1e3:.0f} mm"
            sentence = f"{sentence} ({away}, {near.clearance * 1e3:.0f} mm left)"
        return f"{sentence}; {self.cause.sentence}" if self.cause else sentence

    @property
    def blocked(self) -> "dict[str, Blocked]":
        """Why each robot does not simply follow its operator."""
        blocked = words().blocked
        return {name: blocked(row.blocked) for name, row in self._rows()}

    @property
    def stopped_by(self) -> "dict[str, Reason]":
        """Why each robot that is stopped or at rest was ordered to."""
        reason = words().reason
        return {
            name: reason(row.stopped_by)
            for name, row in self._rows()
            if row.level >= STOP_LEVEL
        }

    @property
    def speed_scale(self) -> dict[str, float]:
        """Share of the operator's speed each robot may have, in [0, 1]."""
        return {name: row.speed_scale for name, row in self._rows()}

    @property
    def urgency(self) -> dict[str, float]:
        """How much each robot's operator is to be warned, in [0, 1]."""
        return {name: row.urgency for name, row in self._rows()}

    @property
    def ages(self) -> dict[str, float]:
        """How old each robot's state may have been [s]."""
        return {name: row.age for name, row in self._rows()}

    def answers(self, sender: int, sequence: int) -> bool:
        """Whether that sender's state, or a later one of his, was judged."""
        return any(
            row.sender == sender and row.sequence >= sequence for row in self.numbers
        )

    def _rows(self) -> Iterator[tuple[str, RobotNumbers]]:
        return zip(self.welcome.robots, self.numbers, strict=True)


def read_answer(
    message: memoryview, sent: int, welcome: Welcome, clock: Callable[[], float]
) -> Answer:
    """The answer in a COMMAND.

    Args:
        message: The message, whose seal fits.
        sent: Its sender's monotonic clock [ns].
        welcome: What its sender told about itself.
        clock: Its sender's clock [s].

    Raises:
        MessageError: It is not as long as it must be.
    """
    robots, joints = len(welcome.robots), len(welcome.names)
    first = ROBOTS_AT + robots * ROBOT.size
    if len(message) != first + 16 * joints + SEAL:
        raise MessageError(f"a COMMAND of {len(message)} bytes has another scene's")
    head = COMMAND.unpack_from(message, HEADER.size)
    cycle, sender, sequence, received, ended, time, slack, slack_time = head[:8]
    a, b, distance, clearance = head[8:12]
    reason, cause, level, action, flags, n, r, _, commander = SUMMARY.unpack_from(
        message, HEADER.size + COMMAND.size
    )
    if (n, r) != (joints, robots):
        raise MessageError(f"a COMMAND tells {n} joints of {r} robots")
    numbers = np.frombuffer(bytes(message[first:-SEAL]), np.float64)
    nearest = None
    if a != NOBODY:
        points = np.array(head[12:])
        nearest = Nearest(
            welcome.bodies[a],
            welcome.bodies[b],
            distance,
            clearance,
            points[:3],
            points[3:],
        )
    rows = tuple(
        RobotNumbers._make(ROBOT.unpack_from(message, ROBOTS_AT + k * ROBOT.size))
        for k in range(r)
    )
    return Answer(
        cycle=cycle,
        velocity=numbers[:n],
        position=numbers[n:],
        cause=Cause(cause),
        slack=slack,
        slack_time=slack_time,
        nearest=nearest,
        commander=commander,
        began=(sender, sequence),
        missed=bool(flags & MISSED),
        inside=(ended - received) * 1e-9 if sender else nan,
        time=time,
        sent=sent * 1e-9,
        clock=clock,
        welcome=welcome,
        numbers=rows,
        level_number=level,
        action_number=action,
        reason_number=reason,
    )


def stop_answer(
    cause: Cause, position: Floats, welcome: Welcome, clock: Callable[[], float]
) -> Answer:
    """The answer of a client that has none: every robot stops.

    Args:
        cause: Why.
        position: Where robots are, as far as it is known, shape (n,).
        welcome: What the service told about itself.
        clock: Its clock [s].
    """
    return Answer(
        cycle=-1,
        velocity=np.zeros(len(welcome.names)),
        position=position,
        cause=cause,
        slack=nan,
        slack_time=nan,
        nearest=None,
        commander=0,
        began=(0, 0),
        missed=False,
        inside=nan,
        time=clock(),
        sent=clock(),
        clock=clock,
        welcome=welcome,
        numbers=(STOPPED,) * len(welcome.robots),
        level_number=STOP_LEVEL,
        action_number=STOP_ACTION,
        reason_number=0,
    )
