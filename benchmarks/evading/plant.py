"""Arms that evade: they follow commands late and inexactly, and have brakes."""

import numpy as np

from armguard.guard import Level
from armguard.respond import Action, Blocked, Command, Guard
from arrays import Bools, Floats
from episodes.follower import Follower


class Plant(Follower):
    """Arms that follow what a guard makes of their operators' velocities.

    Attributes:
        stops: Time, arm and named reason of all stops, in order.
        began: When each arm that evaded began to [s], and its true state then.
        cycle_times: How long each cycle took [s].

    Args:
        guard: The guard.
        q: Where they begin, shape (n,) [rad or m].
        rng: Draws delays and errors.
    """

    substeps = 4

    def __init__(self, guard: Guard, q: Floats, rng: np.random.Generator) -> None:
        super().__init__(guard, q, rng)
        self.stops: list[tuple[float, str, str]] = []
        self.began: dict[str, tuple[float, Floats, Floats]] = {}
        self.cycle_times: list[float] = []
        self._actions = dict.fromkeys(self.own, Action.FOLLOW)
        self._brake_at = dict.fromkeys(self.own, np.inf)

    def measured_speeds(self, v: Floats) -> Floats:
        """See `Follower`."""
        return v + self.noise("velocity_error")

    def move(self, velocity: Floats, drifts: Bools) -> None:
        """Move the joints on by a substep."""
        aim = velocity + drifts * self._error
        most = self._most["acceleration"] * self.substep
        for name, at in self._brake_at.items():
            if self.time >= at:
                own = self.own[name]
                aim[own] = 0.0
                most[own] = self.figures[name].brake_deceleration * self.substep
        before = self.v
        self.v = before + np.clip(aim - before, -most, most)
        self.q = self.q + 0.5 * (before + self.v) * self.substep

    def kept_error(self, error: Floats) -> Floats:
        """See `Follower`: a stop is as declared, it is not sped up again."""
        for name, action in self._actions.items():
            if action >= Action.STOP:
                error[self.own[name]] = self._error[self.own[name]]
        return error

    def note(self, command: Command) -> None:
        """Remember stops when they begin, and engage arms that may go on."""
        verdict, blocked = command.verdict, command.blocked
        self.cycle_times.append(verdict.cycle_time)
        for name, action in command.actions.items():
            if blocked[name] is Blocked.EVADING:
                self.began.setdefault(name, (self.time, self.q, self.v))
            before, self._actions[name] = self._actions[name], action
            if action < Action.BRAKE:
                self._brake_at[name] = np.inf
            elif self._brake_at[name] == np.inf:
                self._brake_at[name] = self.time + self.figures[name].brake_delay
            if action > before and verdict.levels[name] >= Level.STOP:
                self.stops.append((self.time, name, verdict.reason.name))
            if blocked[name] is Blocked.STOPPED and action is Action.HOLD:
                self.guard.engage(name)
