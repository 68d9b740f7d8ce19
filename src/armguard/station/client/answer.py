"""What the service told robots in a cycle."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import frombuffer
from numpy.typing import NDArray

from armguard.station.client.enums import words
from armguard.station.client.fields import (
    ACTION,
    BEGAN,
    BODY,
    CAUSE,
    COMMANDER,
    FLAGS,
    JOINTS,
    LEVEL,
    REASON,
    ROBOTS,
    SENT,
)
from armguard.station.client.welcome import Welcome
from armguard.station.wire.layout import (
    HEADER,
    MISSED,
    NOBODY,
    OBJECTS_CHANGED,
    ROBOT,
    ROBOTS_AT,
)
from armguard.station.wire.words import Cause

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held

Floats = NDArray[np.float64]

# As `Level` and `Action` number a stop, and the latter a robot that waits.
STOP_LEVEL, STOP_ACTION, HOLD_ACTION = 30, 10, 5

CAUSES = {int(cause): cause for cause in Cause}

# Looked up here and not in numpy, which takes longer than what is done with them.
FLOAT = np.dtype(np.float64)
ROW = ROBOT.size

NANO = 1e-9


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
    held_since: float


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


class Answer:
    """What the service told robots; or what a client tells that hears nothing.

    It holds the message, and cuts it into numbers when somebody asks for them.

    Attributes:
        began: Sender and number of the state that began the cycle; zeros for none.
        sent: When it was sent, on the service's clock [s].
        welcome: What the service told about itself.
        clock: The service's clock, as far as it is known here.

    Args:
        message: The message, whose seal fits; nobody changes it any more.
        fields: Its `FIELDS`.
        welcome: See there.
        clock: See there.
    """

    __slots__ = ("_body", "_fields", "_message", "began", "clock", "sent", "welcome")

    def __init__(
        self,
        message: bytes,
        fields: tuple[int, ...],
        welcome: Welcome,
        clock: Callable[[], float],
    ) -> None:
        self._message = message
        self._fields = fields
        self._body: tuple[float, ...] | None = None
        self.began = fields[BEGAN]
        self.sent = fields[SENT] * NANO
        self.welcome = welcome
        self.clock = clock

    def __repr__(self) -> str:
        return (
            f"Answer(cycle={self.cycle}, level={self.level.name}, "
            f"action={self.action.name}, cause={self.cause.name}, "
            f"held={list(self.held)}, velocity={self.velocity})"
        )

    @property
    def velocity(self) -> Floats:
        """Joint velocities to send, shape (n,) [rad/s or m/s]; not to be written."""
        n = self._fields[JOINTS]
        first = ROBOTS_AT + ROW * self._fields[ROBOTS]
        return frombuffer(self._message, FLOAT, n, first)

    @property
    def position(self) -> Floats:
        """The same as positions, shape (n,) [rad or m]; not to be written."""
        n = self._fields[JOINTS]
        first = ROBOTS_AT + ROW * self._fields[ROBOTS] + 8 * n
        return frombuffer(self._message, FLOAT, n, first)

    @property
    def cycle(self) -> int:
        """Number of the cycle; -1 if no service told it."""
        return int(self._cut[0])

    @property
    def inside(self) -> float:
        """From a state's arrival to when it had been judged; NaN if none came [s]."""
        _, sender, _, received, ended = self._cut[:5]
        return (ended - received) * NANO if sender else nan

    @property
    def time(self) -> float:
        """Time of the cycle, on the service's clock [s]."""
        return self._cut[5]

    @property
    def slack(self) -> float:
        """What the nearest pair has left beyond what it needs [m]."""
        return self._cut[6]

    @property
    def slack_time(self) -> float:
        """Least time until a stop must be ordered [s]."""
        return self._cut[7]

    @property
    def nearest(self) -> Nearest | None:
        """The pair with the least clearance; None if none is near."""
        a, b, distance, clearance = self._cut[8:12]
        if a == NOBODY:
            return None
        points = np.array(self._cut[12:])
        bodies = self.welcome.bodies
        return Nearest(
            bodies[int(a)], bodies[int(b)], distance, clearance, points[:3], points[3:]
        )

    @property
    def reason_number(self) -> int:
        """The guard's reason."""
        return self._fields[REASON]

    @property
    def cause(self) -> Cause:
        """What the service or the client has to say beside the guard's reason."""
        return CAUSES[self._fields[CAUSE]]

    @property
    def level_number(self) -> int:
        """The highest level."""
        return self._fields[LEVEL]

    @property
    def action_number(self) -> int:
        """The highest action."""
        return self._fields[ACTION]

    @property
    def missed(self) -> bool:
        """Whether the cycle ended later than its period allows."""
        return bool(self._fields[FLAGS] & MISSED)

    @property
    def objects_changed(self) -> bool:
        """Whether an object was placed or removed within the last second."""
        return bool(self._fields[FLAGS] & OBJECTS_CHANGED)

    @property
    def commander(self) -> int:
        """Who commands; 0 for nobody."""
        return self._fields[COMMANDER]

    @property
    def numbers(self) -> tuple[RobotNumbers, ...]:
        """What each robot is told, in the order of a COMMAND."""
        rows = self._message[ROBOTS_AT : ROBOTS_AT + ROW * self._fields[ROBOTS]]
        return tuple(map(RobotNumbers._make, ROBOT.iter_unpack(rows)))

    @property
    def stops(self) -> bool:
        """Whether any robot does not follow its operator."""
        return self.action_number >= HOLD_ACTION

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
        held = self.held
        said = [one.sentence for one in held.values()]
        if self.cause.stops or not held or self.reason_number:
            said.append(self._reason_sentence())
        return "; ".join(said)

    def _reason_sentence(self) -> str:
        if self.cause.stops:
            return self._cause_sentence()
        sentence = self.welcome.reasons[self.reason_number][1]
        near = self.nearest
        if near is not None and self.level_number:
            away = f"{near.a} to {near.b}: {near.distance * 1e3:.0f} mm"
            sentence = f"{sentence} ({away}, {near.clearance * 1e3:.0f} mm left)"
        return f"{sentence}; {self.cause.sentence}" if self.cause else sentence

    def _cause_sentence(self) -> str:
        sentence, welcome = self.cause.sentence, self.welcome
        if self.cause is not Cause.DEADLINE_MISSED:
            return sentence
        return (
            f"{sentence} ({welcome.period * 1e3:.1f} ms by --rate, and "
            f"{welcome.text['late'] * 1e3:.1f} ms by --late)"
        )

    @property
    def held(self) -> "dict[str, Held]":
        """Robots that do not move before a person does something, and why not."""
        if not any(row.held_since == row.held_since for row in self.numbers):
            return {}
        _, reason, _, blocked, held = words()
        return {
            name: held(
                name, blocked(row.blocked), reason(row.stopped_by), row.held_since
            )
            for name, row in self._rows()
            if row.held_since == row.held_since
        }

    @property
    def blocked(self) -> "dict[str, Blocked]":
        """Why each robot does not simply follow its operator."""
        blocked = words().blocked
        return {name: blocked(row.blocked) for name, row in self._rows()}

    @property
    def stopped_by(self) -> "dict[str, Reason]":
        """Why each robot that is stopped, at rest or held was ordered to stop."""
        reason = words().reason
        return {
            name: reason(row.stopped_by)
            for name, row in self._rows()
            if row.level >= STOP_LEVEL or row.held_since == row.held_since
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
        began_by, number = self.began
        if began_by == sender and number >= sequence:
            return True
        return any(
            row.sender == sender and row.sequence >= sequence for row in self.numbers
        )

    @property
    def _cut(self) -> tuple[float, ...]:
        """The fields of the `COMMAND`."""
        if self._body is None:
            self._body = BODY.unpack_from(self._message, HEADER.size)
        return self._body

    def _rows(self) -> Iterator[tuple[str, RobotNumbers]]:
        return zip(self.welcome.robots, self.numbers, strict=True)
