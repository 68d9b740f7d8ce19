"""An episode in which everything that arms are told goes through the guard's filter.

The plant follows what it is told, late and inexactly, but within the declared delay and
error of tracking; it never follows its operator. An arm that rests is held until the
first command that moves it takes effect. Operators engage a stopped arm again as soon
as they can.
"""

from collections import deque
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard import Level
from armguard.respond import Action, Blocked
from closed_loop import plant as plants
from closed_loop.episode import Episode
from closed_loop.operators import View, wish_within
from closed_loop.settings import SUBSTEP

Floats = NDArray[np.float64]


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

    leaving = True

    def one_cycle(self, cycle: int, outward: Floats, thinks: bool) -> None:
        """Measurements and wishes to the guard, its commands to the plant."""
        arena, plant, now = self.arena, self.plant, self.tick * SUBSTEP
        if cycle == 0:
            self.commands: deque[Sent] = deque()
            self.driven_to = np.zeros(len(plant.q))
            self.tracking = np.concatenate([f.tracking_error for f in arena.figures])
        self.sight(now)
        q, v, stamps = self.measuring.measure(self.tick, cycle, outward)
        stamp = dict(zip(arena.robots, stamps, strict=True))
        if thinks:
            view = View(
                now, arena.judge, plant.q, plant.v, np.ones(len(plant.q), dtype=bool)
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
            if action >= Action.STOP:
                self.stop(arm, name, now, outward, command.verdict)
            if action >= Action.BRAKE:
                self.braked.setdefault(name, now)
                plants.order_brake(plant, arm, now + self.truth.brake_delay(arm))
            if command.blocked[name] is Blocked.STOPPED and action is Action.FOLLOW:
                arena.guard.engage(name)
            at = now + self.truth.command_delay(arm)
            own = slice(arena.first[arm], arena.first[arm + 1])
            velocity = command.velocity[own]
            moves = action < Action.STOP and bool(velocity.any())
            self.commands.append(Sent(at, arm, velocity, moves))
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
            plants.advance(
                self.plant,
                start + done,
                SUBSTEP,
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

    def stop_again(self, arm: int, now: float) -> None:
        """Stop an arm that was told to since the command that moves it was sent."""
        told = [sent.at for sent in self.commands if sent.arm == arm and not sent.moves]
        name = self.arena.robots[arm]
        if self.last.levels[name] >= Level.STOP:
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
