"""Things thrown or pushed at an arm: drawn such that their straight way hits it."""

from dataclasses import dataclass
from math import pi

import numpy as np

from arrays import Floats
from evading.places import PERIOD, SIZES, Place, Thing

# Speeds of what comes [m/s], and by how much more is declared at most [-].
SPEEDS, DECLARED = (0.1, 1.0), (1.0, 1.3)

# Time from when it is first seen until it would touch the arm [s].
SEEN = (0.6, 2.0)

# The arms work or rest for so long before it is seen [s].
BEFORE = 0.4

# Its way ends so far beyond where it would touch the arm, and is then over; after that
# the episode goes on for so long [m, s].
BEYOND, AFTER = 0.4, 0.5

# Least distances where an episode begins, of its way to all that stands, and to the
# other arm [m].
START_CLEAR, WAY_CLEAR, ARM_CLEAR = 0.04, 0.01, 0.1

# Step at which a way is looked at [m], and how far away it is looked for at most [m].
STEP, FARTHEST = 0.01, 3.0

# An operator at work: share of the top speeds, and time until he is back [s].
WORK, BACK = (0.02, 0.1), (1.5, 4.0)

# Share of the episodes in which the arm is at work [-].
WORKS = 0.5


@dataclass(frozen=True)
class Throw:
    """A thing that comes, and the arm it comes at.

    Attributes:
        thing: What.
        robot: Number of the arm.
        q: Joint positions at the beginning, shape (n,) [rad or m].
        sway: Greatest velocities the operator asks for, shape (n,) [rad/s or m/s].
        back: Time until his motion comes back [s].
        begin: Where the thing is when it is first seen, shape (3,) [m].
        velocity: Its velocity, shape (3,) [m/s].
        until_hit: Time until it touches the arm if that goes on as asked [s].
        passes: Time from when it is first seen until its way is over [s].
    """

    thing: Thing
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
        """What the operator asks for, shape (n,) [rad/s or m/s]."""
        return self.sway * np.sin(2.0 * pi * time / self.back)

    def nominal(self, time: float) -> Floats:
        """Where the arms are then if they do as asked, shape (n,) [rad or m]."""
        turned = self.back / (2.0 * pi) * (1.0 - np.cos(2.0 * pi * time / self.back))
        return self.q + turned * self.sway

    def mover(self, time: float) -> Floats | None:
        """Where the thing is, None while it is not there.

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


def drawn_thing(rng: np.random.Generator, speed: float) -> Thing:
    """A ball or a box."""
    is_box = bool(rng.random() < 0.5)
    half = rng.uniform(*SIZES, 3)
    if not is_box:
        half[:] = half[0]
    turn = rng.uniform(-pi, pi, 3) if is_box else np.zeros(3)
    return Thing(
        tuple(half.tolist()),
        tuple(turn.tolist()),
        is_box,
        speed * float(rng.uniform(*DECLARED)),
    )


def drawn_throw(
    rng: np.random.Generator, place: Place, thing: Thing, speed: float
) -> Throw:
    """A throw at an arm that stands or works where nothing is near.

    Its way is free of all that stands and of the other arm, and it begins where it
    touches nobody.
    """
    while True:
        throw = tried(rng, place, thing, speed)
        if throw is not None and is_fair(place, throw):
            return throw


def tried(
    rng: np.random.Generator, place: Place, thing: Thing, speed: float
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
    throw = Throw(thing, robot, q, sway, back, np.zeros(3), np.zeros(3), until_hit, 0.0)
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
    return Throw(thing, robot, q, sway, back, begin, velocity, until_hit, float(passes))


def first_touch(
    place: Place, q: Floats, robot: int, aim: Floats, way: Floats
) -> Floats | None:
    """Where a thing that comes from afar touches an arm first, shape (3,) [m]."""
    geoms = place.judge.arm(robot)
    left = FARTHEST
    while left > -STEP:
        at = aim - left * way
        place.judge.put(q, at)
        gap = place.judge.gap(geoms)
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
        if judge.gap(judge.fixtures) < WAY_CLEAR or judge.gap(others) < ARM_CLEAR:
            return False
        gap = judge.gap(own)
        if time < BEFORE + 0.5 * throw.until_hit and gap <= 0.0:
            return False
        hit |= gap <= 0.0
    return hit
