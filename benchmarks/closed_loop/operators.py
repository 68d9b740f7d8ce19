"""Operators that try to cause contact: the velocities that they desire."""

from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from scipy.interpolate import CubicSpline

from arrays import Bools, Floats
from closed_loop.judge import Judge
from closed_loop.truth import pick

# Joints with less room than this, grippers, are left alone [rad or m].
ROOM = 0.1

# No desired velocity lets a joint come nearer to its limits than this [rad or m].
LIMIT_MARGIN = 0.05

# A joint counts as one that moves a pair from this change of its distance on [m/rad].
MOVES = 1e-2

# A chaser chooses one of so many nearest pairs, and another one when that pair has not
# become nearer by so much [m] for so long [s].
CONSIDERED = 40
PROGRESS = 0.001
PATIENCE = 0.12


@dataclass(frozen=True, slots=True)
class View:
    """What an operator sees: everything, and the truth.

    Attributes:
        now: Time [s].
        judge: The judge, with the present state placed.
        q: Positions, shape (n,) [rad or m].
        v: Velocities, shape (n,) [rad/s or m/s].
        free: Whether an operator has the joint's arm, shape (n,).
    """

    now: float
    judge: Judge
    q: Floats
    v: Floats
    free: Bools


class Operator(Protocol):
    """Source of desired velocities."""

    def desired(self, view: View) -> Floats:
        """Desired velocities in shares of the top speeds, in [-1, 1], shape (n,)."""


class Rough:
    """Every joint jumps from one velocity to another, at random times."""

    def __init__(self, rng: np.random.Generator, judge: Judge) -> None:
        self._rng = rng
        n = len(judge.reach)
        self._hold = 10.0 ** rng.uniform(-2.3, -0.7)
        self._until = np.zeros(n)
        self._desired = np.zeros(n)

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        due = view.now >= self._until
        count = int(due.sum())
        self._desired[due] = self._rng.uniform(-1.0, 1.0, count)
        self._until[due] = view.now + self._rng.exponential(self._hold, count)
        return self._desired


class Smooth:
    """Splines through random velocities, as a person moves."""

    def __init__(self, rng: np.random.Generator, judge: Judge) -> None:
        gap = rng.uniform(0.1, 0.5)
        knots = rng.uniform(-1.2, 1.2, (64, len(judge.reach)))
        self._spline = CubicSpline(np.arange(64) * gap, knots)
        self._length = 63 * gap

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        return np.clip(self._spline(view.now % self._length), -1.0, 1.0)


class OneJoint:
    """One joint of all at full speed, another one after a while."""

    def __init__(self, rng: np.random.Generator, judge: Judge) -> None:
        self._rng = rng
        self._n = len(judge.reach)
        self._until = 0.0
        self._desired = np.zeros(self._n)

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        if view.now >= self._until:
            self._until = view.now + self._rng.uniform(0.2, 1.0)
            self._desired = np.zeros(self._n)
            self._desired[self._rng.integers(self._n)] = self._rng.choice([-1.0, 1.0])
        return self._desired


class Reversals:
    """All joints at full speed one way, then the other."""

    def __init__(self, rng: np.random.Generator, judge: Judge) -> None:
        self._rng = rng
        self._hold = 10.0 ** rng.uniform(-2.3, -0.5)
        self._until = 0.0
        self._desired = rng.choice([-1.0, 1.0], len(judge.reach))

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        if view.now >= self._until:
            self._until = view.now + self._rng.exponential(self._hold)
            flips = self._rng.random(len(self._desired)) < 0.7
            self._desired = np.where(flips, -self._desired, self._desired)
        return self._desired


class Chase:
    """Straight at something: every joint as fast as it closes in on a pair.

    The pair is the one of some kind that can be closed soonest, or one of the soonest;
    another one is taken when it does not become nearer, or after a while.

    Args:
        rng: Of the episode.
        judge: The judge.
        kind: "any", "arms" for one arm against another, "fixtures", "movers".
        movers: Names of objects that move.
        pace: "full"; "feint", back and forth with a drift towards; "creep", slowly,
            and with all strength at the last moment.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        judge: Judge,
        kind: str = "any",
        movers: tuple[str, ...] = (),
        pace: str = "full",
    ) -> None:
        self._rng = rng
        self._pace = pace
        chosen = [p for p in judge.pairs if kind in kinds_of(judge, p, movers)]
        self._pairs = chosen or judge.pairs
        self._pair = (-1, -1)
        self._best, self._checked = np.inf, 0.0
        self._until = 0.0
        self._switch = 0.0
        self._towards = 1.0
        self._depth = 1 if rng.random() < 0.6 else 12
        self._near = 10.0 ** rng.uniform(-2.5, -0.8)
        self._flip = 10.0 ** rng.uniform(-2.5, -1.0)

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        if view.now >= self._until:
            self._choose(view)
        distance, outward = view.judge.apart(self._pair)
        used = np.abs(outward) > MOVES
        if self._stalls(view.now, distance):
            self._until = view.now
        return np.where(used, -np.sign(outward), 0.0) * self._share(view.now, distance)

    def _choose(self, view: View) -> None:
        """Take one of the pairs that can be closed soonest, not the same again."""
        self._until = view.now + self._rng.uniform(0.15, 0.8)
        gaps = np.array([view.judge.gap(pair) for pair in self._pairs])
        times = {}
        for k in np.argsort(gaps)[:CONSIDERED]:
            _, outward = view.judge.apart(self._pairs[k])
            rate = float(np.abs(outward[view.free]).sum())
            if rate > MOVES and self._pairs[k] != self._pair:
                times[int(k)] = gaps[k] / rate
        soonest = sorted(times, key=times.__getitem__)[: self._depth]
        self._pair = self._pairs[int(self._rng.choice(soonest or len(self._pairs)))]
        self._best, self._checked = np.inf, view.now

    def _stalls(self, now: float, distance: float) -> bool:
        """Whether the pair has not become nearer for a while."""
        if distance < self._best - PROGRESS:
            self._best, self._checked = distance, now
        return now > self._checked + PATIENCE

    def _share(self, now: float, distance: float) -> float:
        """Share of the top speed, towards the pair."""
        if self._pace == "creep":
            return 1.0 if distance < self._near else 0.15
        if self._pace == "feint":
            if now >= self._switch:
                self._towards = -self._towards
                drift = 1.5 if self._towards > 0.0 else 1.0
                self._switch = now + drift * self._rng.exponential(self._flip)
            return self._towards
        return 1.0


def kinds_of(
    judge: Judge, pair: tuple[int, int], movers: tuple[str, ...]
) -> tuple[str, ...]:
    """What a pair of geoms is, in the words of `Chase`."""
    arms = [int(judge.arm_of[g]) for g in pair]
    if min(arms) >= 0:
        return ("any",) if arms[0] == arms[1] else ("any", "arms")
    other = judge.owners[pair[arms.index(-1)]]
    return ("any", "movers" if other in movers else "fixtures")


class Mixed:
    """One operator for some arms, another for the others."""

    def __init__(self, one: Operator, other: Operator, joints: Bools) -> None:
        self._one, self._other, self._joints = one, other, joints

    def desired(self, view: View) -> Floats:
        """See `Operator`."""
        desired = self._one.desired(view), self._other.desired(view)
        return np.where(self._joints, *desired)


@numba.njit(cache=True)
def within_limits(
    asked, shares, first, velocity, q, lower, upper, deceleration, desired
):
    """Desired velocities that a robot can follow: slowed down, within the joint limits.

    Args:
        asked: Desired velocities, in shares of the top speeds, shape (n,) [-].
        shares: Share of that each arm may have, shape (a,) [-].
        first: First joint of each arm, and n, shape (a + 1,).
        velocity: Top speeds, shape (n,).
        q: Positions, shape (n,).
        lower: Least positions, shape (n,).
        upper: Greatest positions, shape (n,).
        deceleration: Of each joint, shape (n,).
        desired: Desired velocities, shape (n,), overwritten.

    Returns:
        Sum of the desired speeds.
    """
    total = 0.0
    for arm in range(len(shares)):
        for j in range(first[arm], first[arm + 1]):
            desired[j] = 0.0
            if upper[j] - lower[j] < ROOM:
                continue
            # Half of the deceleration leaves room for delays.
            down = np.sqrt(deceleration[j] * max(q[j] - lower[j] - LIMIT_MARGIN, 0.0))
            up = np.sqrt(deceleration[j] * max(upper[j] - q[j] - LIMIT_MARGIN, 0.0))
            desired[j] = min(max(asked[j] * shares[arm] * velocity[j], -down), up)
            total += abs(desired[j])
    return total


# Operators by name, and how often an episode gets each.
SHARES = {
    "rough": 0.08,
    "smooth": 0.07,
    "one joint": 0.06,
    "reversals": 0.09,
    "chase any": 0.20,
    "chase arms": 0.20,
    "chase fixtures": 0.14,
    "chase movers": 0.16,
}
OTHERS = {"rough": Rough, "smooth": Smooth, "one joint": OneJoint}
OTHERS |= {"reversals": Reversals}

# How those that chase go about it, and how often.
PACES = {"full": 0.45, "feint": 0.3, "creep": 0.25}

# Shares of the top speed an episode is driven at, and how often.
SPEEDS = {1.0: 0.6, 0.5: 0.2, 0.2: 0.12, 0.05: 0.08}

# How often the arms have different operators.
MIXED = 0.25

# How often an operator slows down as much as the guard recommends.
OBEDIENT = 0.4


def drawn_operator(
    rng: np.random.Generator,
    judge: Judge,
    movers: tuple[str, ...],
    first_arm: Bools,
    attack: bool,
) -> tuple[str, Operator]:
    """The operator of an episode, and its name.

    Args:
        rng: Of the episode.
        judge: The judge.
        movers: Names of objects that move.
        first_arm: Which joints are the first arm's, shape (n,).
        attack: Whether it must be one that chases; moving objects, if there are any.
    """
    name, operator = _one_of(rng, judge, movers, attack)
    if attack or first_arm.all() or rng.random() > MIXED:
        return name, operator
    other_name, other = _one_of(rng, judge, movers, False)
    return f"{name} + {other_name}", Mixed(operator, other, first_arm)


def _one_of(
    rng: np.random.Generator, judge: Judge, movers: tuple[str, ...], attack: bool
) -> tuple[str, Operator]:
    if attack:
        names = [n for n in SHARES if n.startswith("chase")]
        names = ["chase movers"] if movers else names[:-1]
    else:
        names = [n for n in SHARES if movers or n != "chase movers"]
    name = pick(rng, {n: SHARES[n] for n in names})
    if not name.startswith("chase"):
        return name, OTHERS[name](rng, judge)
    pace = pick(rng, PACES)
    kind = name.removeprefix("chase ")
    return f"{name}, {pace}", Chase(rng, judge, kind, movers, pace)
