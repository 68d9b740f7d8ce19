"""An episode in which everything that arms are told goes through the guard's filter.

The plant follows what it is told, late and inexactly, but within the declared delay and
error of tracking; it never follows its operator. An arm that rests is held until the
first command that moves it takes effect. Operators engage a stopped arm again as soon
as they can.
"""

from collections import deque
from collections.abc import Mapping
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard import Level
from armguard.respond import Action, Blocked
from closed_loop import plant as plants
from closed_loop.episode import Episode
from closed_loop.keeping import Commanded, declared_of, misses
from closed_loop.operators import View, wish_within
from closed_loop.settings import SUBSTEP

Floats = NDArray[np.float64]

# Where the tracking error is the term, commands are missed only below this distance of
# the nearest pair [m].
LAST_MOMENT = 0.015


class Sent(NamedTuple):
    """What one arm was told.

    Attributes:
        at: When it takes effect [s].
        arm: The arm.
        velocity: Velocities of its joints [rad/s or m/s].
        moves: Whether it is let go by that if it is held.
    """

    at: float
    arm: int
    velocity: Floats
    moves: bool


class FilteredEpisode(Episode):
    """An episode of a guard that commands go through; see `Episode`."""

    def one_cycle(self, cycle: int, outward: Floats, thinks: bool) -> None:
        """Measurements and wishes to the guard, its commands to the plant."""
        arena, plant, now = self.arena, self.plant, self.tick * SUBSTEP
        if cycle == 0:
            self.commands: deque[Sent] = deque()
            self.driven_to = np.zeros(len(plant.q))
            self.halted = np.zeros(len(arena.robots), dtype=bool)
            self.told: deque[tuple[float, Floats]] = deque(maxlen=3)
            self.log: list[Commanded] = []
            self.tracking = np.concatenate(
                [f.tracking_error for f in self.truth.figures]
            )
        self.sight(now)
        q, v, stamps = self.measuring.measure(self.tick, cycle, outward)
        stamp = dict(zip(arena.robots, stamps, strict=True))
        if thinks:
            view = View(
                now, arena.judge, self.q, self.v, np.ones(len(plant.q), dtype=bool)
            )
            self.asked = self.speed * self.operator.desired(view)
        self.wished = wish_within(
            self.asked,
            self.shares,
            arena.first,
            plant.velocity,
            plant.q,
            arena.lower,
            arena.upper,
            self.truth.slowest,
            self.wish,
        )
        command = arena.guard.filter(q, self.wish, stamp, velocity=v, now=now)
        self.times.append(command.verdict.cycle_time)
        levels = command.verdict.levels
        for arm, name in enumerate(arena.robots):
            counts, action = self.levels[arm], command.actions[name]
            counts[levels[name]] = counts.get(levels[name], 0) + 1
            if levels[name] < Level.STOP:
                self.watch.leaving[arm] = False
            elif action is Action.FOLLOW:
                # Until it is given back: it may be stopped on its way out.
                self.watch.leaving[arm] = True
            self.halted[arm] = action >= Action.STOP
            if action >= Action.STOP:
                self.stop(arm, name, now, outward, command.verdict)
            if action >= Action.BRAKE:
                self.braked.setdefault(name, now)
                plants.order_brake(plant, arm, now + self.truth.brake_delay(arm))
            if command.blocked[name] is Blocked.STOPPED and action is Action.HOLD:
                arena.guard.engage(name)
            at = now + self.truth.command_delay(arm)
            own = slice(arena.first[arm], arena.first[arm + 1])
            velocity = command.velocity[own]
            moves = action < Action.STOP and bool(velocity.any())
            self.commands.append(Sent(at, arm, velocity, moves))
            if self.arms is not None:
                self.log.append(Commanded(now, arm, velocity.copy()))
        self.told.append((now, command.velocity))
        self.note_jerk(command.actions)
        self.last = command.verdict
        # Where an arm misses what it is told, it misses it towards what is near.
        share = {"adverse": 1.0, "quiet": 1.0, "none": 0.0}
        part = share.get(self.truth.styles.errors, None)
        missed = (
            -np.sign(outward) * part
            if part is not None
            else self.rng.uniform(-1.0, 1.0, len(plant.q))
        )
        self.missed = missed * self.tracking
        if self.term == "tracking_error" and self.nearest > LAST_MOMENT:
            # Missed all the time it would be seen long before anything is near.
            self.missed[:] = 0.0

    def note_jerk(self, actions: Mapping[str, Action]) -> None:
        """Note the jerk of the last three commands to every arm that is to stop."""
        if len(self.told) < 3:
            return
        times, speeds = zip(*self.told, strict=True)
        steps = np.diff(times)
        rates = np.diff(speeds, axis=0) / steps[:, None]
        jerk = np.abs(rates[1] - rates[0]) / (0.5 * steps.sum())
        for arm, name in enumerate(self.arena.robots):
            own = slice(self.arena.first[arm], self.arena.first[arm + 1])
            if actions[name] >= Action.STOP:
                greatest = max(self.outcome.stop_jerk, float(jerk[own].max()))
                self.outcome.stop_jerk = greatest

    def move(self, target: int) -> None:
        """Let time pass until the next cycle; commands take effect in between."""
        start = self.tick
        rows = slice(start + 1, target + 1)
        q_rows, p_rows = self.q_rows[rows], self.p_rows[rows]
        v_rows, free_rows = self.v_rows[rows], self.free_rows[rows]
        done = 0
        while start + done < target:
            until = self.obey((start + done) * SUBSTEP)
            end = target if until == inf else int(np.ceil(until / SUBSTEP - 1e-9))
            end = min(max(end, start + done + 1), target)
            part = slice(done, end - start)
            self.drive(
                start + done,
                self.driven_to + self.missed,
                q_rows[part],
                v_rows[part],
                free_rows[part],
            )
            done = end - start
        self.outcome.joint_wish += self.wished * (target - start) * SUBSTEP
        if self.movers.names:
            tips = self.arena.judge.tips()
            self.movers.advance(start * SUBSTEP, SUBSTEP, tips, p_rows)
        self.watch.look(start, q_rows, p_rows)
        for name, p in zip(self.movers.names, self.movers.p, strict=True):
            self.arena.judge.stand_at(name, p)
        self.tick = target

    def broke(self) -> str | None:
        """See `Episode`; here drives may miss commands as well."""
        found = super().broke()
        if found is not None:
            return found
        rows = slice(self.tick + 1)
        figures = self.arena.figures
        missed = misses(
            self.v_rows[rows],
            self.free_rows[rows],
            self.arena.first,
            self.log,
            declared_of(figures, self.truth),
            np.array([f.command for f in figures]),
        )
        return "tracking_error" if missed else None

    def stop_again(self, arm: int, now: float) -> None:
        """Stop an arm that was told to since the command that moves it was sent."""
        told = [sent.at for sent in self.commands if sent.arm == arm and not sent.moves]
        if self.halted[arm]:
            figures = self.truth.stop(np.zeros(len(self.plant.q)))
            plants.order_stop(self.plant, arm, min(told, default=now), figures)

    def obey(self, now: float) -> float:
        """Let commands take effect that are due.

        Returns:
            When the next one is [s].
        """
        later: deque[Sent] = deque()
        soonest = inf
        for sent in self.commands:
            if sent.at > now + 1e-12:
                later.append(sent)
                soonest = min(soonest, sent.at)
                continue
            own = slice(self.arena.first[sent.arm], self.arena.first[sent.arm + 1])
            self.driven_to[own] = sent.velocity
            if sent.moves and plants.release(self.plant, sent.arm):
                self.outcome.releases += sent.arm in self.driven
                self.driven.add(sent.arm)
                self.stop_again(sent.arm, now)
        self.commands = later
        return soonest
