"""What is thrown or pushed at an arm, drawn so that it hits it; and ways out of it.

Whether it can be evaded at all: many straight ways are tried. The arm has the limits,
speeds, accelerations and delays the guard has for it, and the share of its speeds it
may evade at. It knows where the projectile will be. It comes to rest, goes along a
straight line in joint space, sped up and slowed down as declared, and stays at its end.
A way counts if the projectile and all else keep the buffer, by the judge.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from arrays import Floats
from evading.places import BUFFER, PERIOD, SIZES, Place, Projectile

# Speeds of what comes [m/s], and by how much more is declared at most [-].
SPEEDS, DECLARED = (0.1, 1.0), (1.0, 1.3)

# Time from when it is first seen until it would touch the arm [s].
SEEN = (0.6, 2.0)

# The arms work or rest for so long before it is seen [s].
BEFORE = 0.4

# Its way ends so far beyond where it would touch the arm, and is then over; after that
# the episode goes on for so long [m, s].
BEYOND, AFTER = 0.4, 0.5

# Least distances where an episode begins, of its way to all that is fixed, and to the
# other arm [m].
START_CLEAR, WAY_CLEAR, ARM_CLEAR = 0.04, 0.01, 0.1

# Step at which a way is looked at [m], and how far away it is looked for at most [m].
STEP, FARTHEST = 0.01, 3.0

# An operator at work: share of the top speeds, and time until it is back [s].
WORK, BACK = (0.02, 0.1), (1.5, 4.0)

# Share of the episodes in which the arm is at work [-].
WORKS = 0.5


@dataclass(frozen=True)
class Throw:
    """A projectile, and the arm it comes at.

    Attributes:
        projectile: What.
        robot: Number of the arm.
        q: Joint positions at the beginning, shape (n,) [rad or m].
        sway: Greatest velocities the operator desires, shape (n,) [rad/s or m/s].
        back: Time until this motion comes back [s].
        begin: Where the projectile is when it is first seen, shape (3,) [m].
        velocity: Its velocity, shape (3,) [m/s].
        until_hit: Time until it touches the arm if that goes on as asked [s].
        passes: Time from when it is first seen until its way is over [s].
    """

    projectile: Projectile
    robot: int
    q: Floats
    sway: Floats
    back: float
    begin: Floats
    velocity: Floats
    until_hit: float
    passes: float

    @property
    def works(self) -> bool:
        """Whether the arm is at work."""
        return bool(self.sway.any())

    @property
    def speed(self) -> float:
        """How fast it comes [m/s]."""
        return float(np.sqrt(self.velocity @ self.velocity))

    def desired(self, time: float) -> Floats:
        """What the operator desires, shape (n,) [rad/s or m/s]."""
        return self.sway * np.sin(2.0 * pi * time / self.back)

    def nominal(self, time: float) -> Floats:
        """Where the arms are then if they do as asked, shape (n,) [rad or m]."""
        turned = self.back / (2.0 * pi) * (1.0 - np.cos(2.0 * pi * time / self.back))
        return self.q + turned * self.sway

    def mover(self, time: float) -> Floats | None:
        """Where the projectile is, None while it is not there.

        Args:
            time: Time since the beginning of the episode [s].
        """
        on = time - BEFORE
        if not 0.0 <= on <= self.passes:
            return None
        return self.begin + on * self.velocity

    @property
    def duration(self) -> float:
        """Length of the episode [s]."""
        return BEFORE + self.passes + AFTER


def drawn_projectile(rng: np.random.Generator, speed: float) -> Projectile:
    """A ball or a box."""
    is_box = bool(rng.random() < 0.5)
    half = rng.uniform(*SIZES, 3)
    if not is_box:
        half[:] = half[0]
    turn = rng.uniform(-pi, pi, 3) if is_box else np.zeros(3)
    return Projectile(
        tuple(half.tolist()),
        tuple(turn.tolist()),
        is_box,
        speed * float(rng.uniform(*DECLARED)),
    )


def drawn_throw(
    rng: np.random.Generator, place: Place, projectile: Projectile, speed: float
) -> Throw:
    """A throw at an arm that rests or works where nothing is near.

    Its way is free of all that is fixed and of the other arm, and it begins where it
    touches no body.
    """
    while True:
        throw = tried(rng, place, projectile, speed)
        if throw is not None and is_fair(place, throw):
            return throw


def tried(
    rng: np.random.Generator, place: Place, projectile: Projectile, speed: float
) -> Throw | None:
    """Something thrown at an arm; None if the arms cannot be there."""
    judge = place.judge
    robot = int(rng.integers(len(place.robots)))
    own = place.own[place.robots[robot]]
    q = rng.uniform(*place.limits)
    if min(judge.least(q, None)) < START_CLEAR:
        return None
    sway = np.zeros_like(q)
    if rng.random() < WORKS:
        most = place.joined("velocity")[own]
        sway[own] = rng.uniform(*WORK) * most * rng.uniform(-1.0, 1.0, len(most))
    back, until_hit = rng.uniform(*BACK), rng.uniform(*SEEN)
    nowhere = np.zeros(3)
    throw = Throw(projectile, robot, q, sway, back, nowhere, nowhere, until_hit, 0.0)
    at_hit = throw.nominal(BEFORE + until_hit)
    judge.put(at_hit, None)
    aim = judge.middle(int(rng.choice(judge.links[place.robots[robot]])))
    way = rng.normal(size=3)
    way /= np.sqrt(way @ way)
    touch = first_touch(place, at_hit, robot, aim, way)
    if touch is None:
        return None
    velocity = speed * way
    passes = until_hit + BEYOND / speed
    begin = touch - until_hit * velocity
    return replace(throw, begin=begin, velocity=velocity, passes=float(passes))


def first_touch(
    place: Place, q: Floats, robot: int, aim: Floats, way: Floats
) -> Floats | None:
    """Where a projectile from afar touches an arm first, shape (3,) [m]."""
    geoms = place.judge.arm(robot)
    left = FARTHEST
    while left > -STEP:
        at = aim - left * way
        place.judge.put(q, at)
        gap = place.judge.gap_to(geoms)
        if gap <= 0.0:
            return at
        # It cannot touch before it has come as far as it is away.
        left -= max(gap, 0.1 * STEP)
    return None


def is_fair(place: Place, throw: Throw) -> bool:
    """Whether the way is free, and the arm hit that goes on as it is asked to."""
    judge = place.judge
    others = [g for k in range(len(place.robots)) if k != throw.robot
              for g in judge.arm(k)]  # fmt: skip
    own = judge.arm(throw.robot)
    low, high = place.limits
    hit = False
    for time in np.arange(0.0, throw.duration, 4.0 * PERIOD):
        q = throw.nominal(float(time))
        if (q < low).any() or (q > high).any():
            return False
        at = throw.mover(float(time))
        if judge.least(q, None)[1] < START_CLEAR:
            return False
        if at is None:
            continue
        judge.put(q, at)
        if judge.gap_to(judge.fixtures) < WAY_CLEAR or judge.gap_to(others) < ARM_CLEAR:
            return False
        gap = judge.gap_to(own)
        if time < BEFORE + 0.5 * throw.until_hit and gap <= 0.0:
            return False
        hit |= gap <= 0.0
    return hit


# How far the joint goes that goes farthest by its top speed: time of it at that speed
# [s].
LENGTHS = (0.08, 0.15, 0.25, 0.4, 0.7, 1.1)

# Directions tried: each joint alone, such as lead away from the projectile, and any.
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
