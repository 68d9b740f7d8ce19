"""A robot with a gripper that follows commands late and inexactly."""

from collections import deque

import numpy as np

from armguard.respond import Action, Command, Guard
from arrays import Floats
from episodes.follower import Follower

# How long an operator lets go that is stuck, and then goes away at most [s].
LET_GO, AWAY = 0.1, 1.5

# How fast the hand goes away [m/s], and what the nearest pair then has left [m].
SPEED, ROOM = 0.03, 0.004


class Plant(Follower):
    """A robot that follows what a guard makes of its operator's velocities.

    Attributes:
        rows: True positions after each cycle.
        stops: Named reasons of all stops, in order.
        command: The last command; None before the first cycle.
        stopped_for: Time for which the robot is being stopped [s].

    Args:
        guard: The guard.
        rng: Draws delays and errors.
    """

    # Joints of the fingers, the last ones.
    fingers = slice(3, 5)

    def __init__(self, guard: Guard, rng: np.random.Generator) -> None:
        super().__init__(guard, guard.home, rng)
        self.rows: list[Floats] = []
        self.stops: list[str] = []
        self.command: Command | None = None
        self.stopped_for = 0.0
        self._action = Action.FOLLOW
        self._actions = deque([Action.FOLLOW] * len(self._sent))
        self._grips = False

    @property
    def seen(self) -> Floats:
        """Where hand and fingers are as measured last: x, y, z, left, right [m]."""
        return self.measured

    def cycle(self, desired: Floats) -> Command:
        """One cycle with desired velocities of hand and fingers [m/s]."""
        return self.drive(desired)

    def drive(self, desired: Floats) -> Command:
        """One cycle with desired velocities of all joints."""
        command = super().drive(desired)
        self.rows.append(self.q)
        return command

    def clock(self, time: float) -> float:
        """See `Follower`."""
        return (round(time / self.period) + self._age) * self.period

    def grip(self, *, grips: bool) -> None:
        """From now on the fingers rest against what they grip, or no more."""
        self._grips = grips
        self._error = self.kept_error(self._error)

    def kept_error(self, error: Floats) -> Floats:
        """See `Follower`: fingers that grip something miss nothing."""
        if self._grips:
            error[self.fingers] = 0.0
        return error

    def may_draw(self, command: Command) -> bool:
        """See `Follower`: a stop is as declared, it is not sped up again."""
        self._actions.append(command.action)
        return self._actions.popleft() < Action.STOP

    def note(self, command: Command) -> None:
        """Remember the reason of a stop when it begins."""
        before, self._action, self.command = self._action, command.action, command
        stops = command.action >= Action.STOP
        self.stopped_for += self.period if stops else -self.stopped_for
        if stops and command.action > before:
            nearest = command.verdict.nearest
            pair = "" if nearest is None else f": {nearest.a}, {nearest.b}"
            self.stops.append(f"{command.verdict.reason.name}{pair}")

    def leave(self, *, fingers: bool) -> bool:
        """Let go, and go where the cues lead; whether the robot follows again.

        Args:
            fingers: Whether fingers may move: not while they hold something.
        """
        still = np.zeros(len(self.q))
        command = self.drive(still)
        for _ in range(int(LET_GO / self.period)):
            command = self.drive(still)
        for _ in range(int(AWAY / self.period)):
            nearest = command.verdict.nearest
            follows = command.action < Action.STOP
            if follows and (nearest is None or nearest.headroom > ROOM):
                return True
            escape = SPEED * np.asarray(command.verdict.cues["arm"].escape)
            if not fingers:
                escape[self.fingers] = 0.0
            command = self.drive(escape)
        return bool(command.action < Action.STOP)
