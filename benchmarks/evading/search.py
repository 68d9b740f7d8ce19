"""Whether a thing that comes can be evaded at all: many straight ways are tried.

The arm has the limits, speeds, accelerations and delays the guard has for it, and the
share of its speeds it may evade at. It knows where the thing will be. It comes to rest,
goes along a straight line in joint space, sped up and slowed down as declared, and
stays at its end. A way counts if the thing and all else keep the buffer, by the judge.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from arrays import Floats
from evading.places import BUFFER, PERIOD, Place
from evading.throws import BEFORE, Throw

# How far the joint goes that goes farthest by its top speed: time of it at that speed
# [s].
LENGTHS = (0.08, 0.15, 0.25, 0.4, 0.7, 1.1)

# Directions tried: each joint alone, such as lead away from the thing, and any.
LEADING, ANY = 20, 40

# How much those that lead away are spread [-].
SPREAD = 0.7


@dataclass(frozen=True)
class Way:
    """A straight motion of an arm from rest to rest.

    Attributes:
        step: What each joint goes, shape (n,) [rad or m].
        rate: Greatest share of it in a second [1/s].
        speeds_up: How that grows at most [1/s²].
        slows_down: How that falls at most [1/s²].
    """

    step: Floats
    rate: float
    speeds_up: float
    slows_down: float

    def at(self, time: float) -> Floats:
        """Where it has led to a time after its begin, shape (n,) [rad or m]."""
        top, up, down = self.rate, self.speeds_up, self.slows_down
        most = np.sqrt(2.0 * up * down / (up + down))
        top = min(top, float(most))
        rises, falls = top / up, top / down
        goes_on = (1.0 - 0.5 * top * (rises + falls)) / top
        if time <= 0.0:
            share = 0.0
        elif time < rises:
            share = 0.5 * up * time * time
        elif time < rises + goes_on:
            share = 0.5 * top * rises + top * (time - rises)
        else:
            left = max(rises + goes_on + falls - time, 0.0)
            share = 1.0 - 0.5 * down * left * left
        return share * self.step


class Search:
    """Ways out of the way of one throw.

    Attributes:
        tried: How many ways were looked at.

    Args:
        place: Where it is thrown.
        throw: What is.
        state: Time from which on the arm does something about it [s], and its true
            joint positions and velocities then, shape (n,) [rad or m, rad/s or m/s].
        rng: Draws ways.
    """

    def __init__(
        self,
        place: Place,
        throw: Throw,
        state: tuple[float, Floats, Floats],
        rng: np.random.Generator,
    ) -> None:
        self.since, q, v = state
        self.place, self.throw, self.rng = place, throw, rng
        name = place.robots[throw.robot]
        self.own = place.own[name]
        figures = place.figures[name]
        share = place.tables.robots[throw.robot].response.evade_speed
        self.speed = share * figures.velocity
        self.up, self.down = figures.acceleration, figures.deceleration
        late = figures.sensing + PERIOD + figures.command
        own = np.zeros(len(q), dtype=np.bool_)
        own[self.own] = True
        v = np.where(own, v, 0.0)
        # Until its first command takes effect it goes on; then it comes to rest.
        self.begin = late + float(np.max(np.abs(v[self.own]) / self.down))
        self.late, self.q, self.v = late, q, v
        self.slows = np.where(own, place.joined("deceleration"), 1.0)
        self.rest = self.before(self.begin)
        steps = int((BEFORE + throw.passes - self.since) / PERIOD)
        self.times = spread_out(steps) * PERIOD
        self.tried = 0

    def before(self, time: float) -> Floats:
        """Where the arms are until they have come to rest, shape (n,) [rad or m]."""
        on = max(time - self.late, 0.0)
        speed = np.abs(self.v)
        braked = np.minimum(on, speed / self.slows)
        way = speed * (min(time, self.late) + braked) - 0.5 * self.slows * braked**2
        return self.q + np.sign(self.v) * way

    def at(self, way: Way, time: float) -> Floats:
        """Where the arms are at a time after that from which they do something."""
        if time < self.begin:
            return self.before(time)
        return self.rest + way.at(time - self.begin)

    def finds(self) -> bool:
        """Whether one of the ways is free."""
        return any(self.is_free(way) for way in self.ways())

    def is_free(self, way: Way) -> bool:
        """Whether nothing comes nearer than the buffer on it."""
        self.tried += 1
        end = self.rest + way.step
        low, high = self.place.limits
        if (end < low).any() or (end > high).any():
            return False
        judge = self.place.judge
        if min(judge.least(end, None)) < BUFFER:
            return False
        mover = self.throw.mover
        return all(
            min(judge.least(self.at(way, t), mover(self.since + t))) >= BUFFER
            for t in self.times
        )

    def ways(self) -> Iterator[Way]:
        """Ways to be tried, the likely ones first."""
        n = self.own.stop - self.own.start
        judge, throw = self.place.judge, self.throw
        away = np.zeros(n)
        for share in (0.7, 0.85, 1.0):
            # Where it touches the distance has no direction worth much.
            left = BEFORE + throw.until_hit - self.since
            judge.put(self.rest, throw.mover(self.since + share * left))
            away += self.speed * judge.way_off(throw.robot)[self.own]
        size = float(np.abs(away).max())
        if size > 0.0:
            away /= size
        leading = [
            away + (SPREAD * self.rng.normal(size=n) if k else 0.0)
            for k in range(LEADING)
        ]
        alone = [sign * row for row in np.eye(n) for sign in (1.0, -1.0)]
        others = [self.rng.normal(size=n) for _ in range(ANY)]
        for direction in (*leading, *alone, *others):
            most = float(np.abs(direction).max())
            if most == 0.0:
                continue
            for length in LENGTHS[::-1]:
                yield self.way(length / most * direction)

    def way(self, shares: Floats) -> Way:
        """A way by how long each joint goes at its top speed, shape (own,) [s]."""
        own = shares * self.speed
        step = np.zeros_like(self.q)
        step[self.own] = own
        moves = own != 0.0
        size = np.abs(own[moves])
        return Way(
            step,
            float((self.speed[moves] / size).min()),
            float((self.up[moves] / size).min()),
            float((self.down[moves] / size).min()),
        )


def spread_out(count: int) -> Floats:
    """Numbers 0 to count, first few far apart and then those between them."""
    found: dict[int, None] = {count: None}
    step = 1 << max(count.bit_length() - 1, 0)
    while step >= 1:
        found |= dict.fromkeys(range(0, count + 1, step))
        step //= 2
    return np.array([*found], dtype=np.float64)
