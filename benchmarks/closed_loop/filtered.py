"""An episode in which all commands to the arms go through the guard's filter.

The plant follows its commands, late and inexactly, but within the declared delay and
error of tracking; it never follows its operator. An arm that rests is held until the
first command that moves it takes effect. Operators engage a stopped arm again as soon
as they can.
"""

from collections import deque
from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple

import numpy as np

from armguard.guard import Level
from armguard.respond import Action, Blocked
from arrays import Floats
from closed_loop import plant as plants
from closed_loop.conformance import Commanded, declared_of, misses
from closed_loop.episode import Episode
from closed_loop.settings import SUBSTEP
from closed_loop.truth import joined

# Where the tracking error is the term, commands are missed only below this distance of
# the nearest pair [m].
LAST_MOMENT = 0.015


class Sent(NamedTuple):
    """A command to one arm.

    Attributes:
        at: When it takes effect [s].
        arm: The arm.
        velocity: Velocities of its joints [rad/s or m/s].
        moves: Whether it releases the arm if that is held.
    """

    at: float
    arm: int
    velocity: Floats
    moves: bool


class FilteredEpisode(Episode):
    """An episode of a guard that commands go through; see `Episode`."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        n, arms = len(self.plant.q), len(self.arena.robots)
        self.commands: deque[Sent] = deque()
        self.driven_to = np.zeros(n)
        self.missed = np.zeros(n)
        self.halted = np.zeros(arms, dtype=bool)
        self.recent: deque[tuple[float, Floats]] = deque(maxlen=3)
        self.log: list[Commanded] = []
        self.tracking = joined(self.truth.figures, "tracking_error")

    def one_cycle(self, cycle: int, outward: Floats, thinks: bool) -> None:
        """See `Episode`; desired velocities go to the guard, commands to the arms."""
        arena, now = self.arena, self.now
        q, v, stamp = self.measure(cycle, outward)
        self.ask(thinks, np.ones(len(q), dtype=bool))
        command = arena.guard.filter(q, self.desired, stamp, velocity=v, now=now)
        verdict = self.last = command.verdict
        self.times.append(verdict.cycle_time)
        for arm, name in enumerate(arena.robots):
            level, action = verdict.levels[name], command.actions[name]
            self.levels[arm][level] += 1
            if level < Level.STOP:
                self.watch.leaving[arm] = False
            elif action is Action.FOLLOW:
                # Until it is given back: it may be stopped on its way out.
                self.watch.leaving[arm] = True
            self.halted[arm] = action >= Action.STOP
            if action >= Action.STOP:
                self.stop(arm, name, now, outward, verdict)
            if action >= Action.BRAKE:
                self.brake(arm, name)
            if command.blocked[name] is Blocked.STOPPED and action is Action.HOLD:
                arena.guard.engage(name)
            at = now + self.truth.command_delay(arm)
            velocity = command.velocity[arena.first[arm] : arena.first[arm + 1]]
            moves = action < Action.STOP and bool(velocity.any())
            self.commands.append(Sent(at, arm, velocity, moves))
            if self.arms is not None:
                self.log.append(Commanded(now, arm, velocity.copy()))
        self.recent.append((now, command.velocity))
        self.note_jerk(command.actions)
        self.draw_missed(outward)

    def draw_missed(self, outward: Floats) -> None:
        """Draw by how much velocities miss commands: towards what is near."""
        share = {"adverse": 1.0, "quiet": 1.0, "none": 0.0}
        part = share.get(self.truth.styles.errors)
        if part is None:
            missed = self.rng.uniform(-1.0, 1.0, len(outward))
        else:
            missed = -np.sign(outward) * part
        self.missed = missed * self.tracking
        if self.plan.term == "tracking_error" and self.nearest > LAST_MOMENT:
            # Missed all the time it would be seen long before anything is near.
            self.missed[:] = 0.0

    def note_jerk(self, actions: Mapping[str, Action]) -> None:
        """Note the jerk of the last three commands to every arm that is to stop."""
        if len(self.recent) < 3:
            return
        times, speeds = zip(*self.recent, strict=True)
        steps = np.diff(times)
        rates = np.diff(speeds, axis=0) / steps[:, None]
        jerk = np.abs(rates[1] - rates[0]) / (0.5 * steps.sum())
        halts = [actions[name] >= Action.STOP for name in self.arena.robots]
        halted = jerk[np.repeat(halts, self.arena.joint_counts)]
        greatest = float(halted.max(initial=self.outcome.stop_jerk))
        self.outcome.stop_jerk = greatest

    def drive(self, target: int) -> None:
        """Move the arms until the next cycle; commands take effect in between."""
        tick = self.tick
        while tick < target:
            until = self.obey(tick * SUBSTEP)
            end = target if until == inf else int(np.ceil(until / SUBSTEP - 1e-9))
            end = min(max(end, tick + 1), target)
            self.follow(tick, end, self.driven_to + self.missed)
            tick = end

    def broke(self) -> str | None:
        """See `Episode`; here drives may miss commands as well."""
        found = super().broke()
        if found is not None:
            return found
        rows = slice(self.tick + 1)
        figures = [*self.arena.figures.values()]
        missed = misses(
            self.v_rows[rows],
            self.free_rows[rows],
            self.arena.first,
            self.log,
            declared_of(figures, self.truth),
            np.array([f.command for f in figures]),
        )
        return "tracking_error" if missed else None

    def obey(self, now: float) -> float:
        """Let commands take effect that are due.

        Returns:
            When the next one is [s].
        """
        due = [sent for sent in self.commands if sent.at <= now + 1e-12]
        later = deque(sent for sent in self.commands if sent.at > now + 1e-12)
        for sent in due:
            own = slice(self.arena.first[sent.arm], self.arena.first[sent.arm + 1])
            self.driven_to[own] = sent.velocity
            if sent.moves and plants.release(self.plant, sent.arm):
                self.released(sent.arm)
                self.stop_again(sent.arm, now)
        self.commands = later
        return min((sent.at for sent in later), default=inf)

    def stop_again(self, arm: int, now: float) -> None:
        """Stop an arm whose stop was ordered after the command that moves it."""
        stops = [
            sent.at for sent in self.commands if sent.arm == arm and not sent.moves
        ]
        if self.halted[arm]:
            figures = self.truth.stop(np.zeros(len(self.plant.q)))
            plants.order_stop(self.plant, arm, min(stops, default=now), figures)
