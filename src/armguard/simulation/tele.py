"""The tele-driver: drives all arms of a scene as busy operators do, without mercy."""

from copy import copy
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.scene.tables import SceneTables
from armguard.simulation.reach import Reach, meeting_points, places_in_reach

Floats = NDArray[np.float64]

# An arm's time is cut into legs of this length [s].
LEG = 3.2

# Shortest and longest pause at the end of a leg, without desired motion [s].
PAUSES = (0.3, 0.7)

# Time in which a leg's speed rises at its start, and falls before its pause [s].
EASE = 0.35

# Slowest and fastest legs, in shares of the top speeds [-].
PACES = (0.3, 0.8)

# A joint near its target is slowed down in proportion to the rest of its way [1/s].
APPROACH = 3.0

# Shares of the legs that lead all arms to one point, and of the others those that lead
# an arm to a stationary object.
MEETINGS, TO_AN_OBJECT = 0.4, 0.5

# Legs that are remembered; a forgotten one is drawn again, the same.
REMEMBERED = 64

# Top speed of a joint without a declared one [rad/s or m/s].
SOME_SPEED = 1.0


class HasTables(Protocol):
    """What has the tables of a scene, such as a guard."""

    @property
    def tables(self) -> SceneTables:
        """The tables."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Where an arm is led for some seconds.

    Attributes:
        target: Positions of its joints, shape (j,) [rad or m].
        pace: Share of the top speeds [-].
        end: When it ends and the pause begins, from the leg's start [s].
    """

    target: Floats
    pace: float
    end: float


class TeleDriver:
    """Desired motion of operators: a function of a seed, time and the arms' positions.

    Every few seconds each arm sets out for another place, often to a point where it
    meets the others, or to a stationary object. Between two legs there is no desired
    motion, as if the operator released the arm, so an arm that was stopped goes on with
    the next one.

    Attributes:
        robots: Names of the robots.

    Args:
        scene: Tables of the scene, or what has them.
        seed: Of all that is drawn.

    Example:
        >>> from armguard.scene import bay_scene, compile_scene
        >>> tables = compile_scene(bay_scene("path"))
        >>> driver = TeleDriver(tables, seed=1)
        >>> driver.desired(1.0, tables.home).shape
        (14,)
    """

    def __init__(self, scene: SceneTables | HasTables, seed: int = 0) -> None:
        tables = scene if isinstance(scene, SceneTables) else scene.tables
        parts = tables.robots
        self.robots = tuple(part.name for part in parts)
        self._seed = seed
        self._own = [
            slice(part.first_joint, part.first_joint + part.joint_count)
            for part in parts
        ]
        self._top = [
            np.full(part.joint_count, SOME_SPEED)
            if part.stopping is None
            else part.stopping.velocity
            for part in parts
        ]
        self._reach = [
            Reach(tables, part, np.random.default_rng((seed, r)))
            for r, part in enumerate(parts)
        ]
        self._places = [places_in_reach(tables, reach) for reach in self._reach]
        self._meetings = meeting_points(self._reach)
        self._legs: dict[tuple[int, int], Leg] = {}

    def desired(self, t: ArrayLike, q: Floats) -> Floats:
        """Desired velocities, shape (n,) [rad/s or m/s].

        Args:
            t: Time, one for all arms or each arm's own, shape (r,) [s].
            q: Measured positions, shape (n,) [rad or m].
        """
        times = np.broadcast_to(np.asarray(t, dtype=np.float64), len(self._own))
        desired = np.zeros(len(q))
        for r, own in enumerate(self._own):
            desired[own] = self._desired_of(r, float(times[r]), q[own])
        return desired

    def with_seed(self, seed: int) -> Self:
        """A driver with other legs, that knows the same configurations."""
        other = copy(self)
        other._seed, other._legs = seed, {}
        return other

    def __deepcopy__(self, _: dict[int, object]) -> Self:
        """The driver itself: what it answers does not depend on what it answered."""
        return self

    def known(self, rng: np.random.Generator) -> Floats:
        """A random configuration that its arms know, shape (n,) [rad or m]."""
        rows = [reach.q[int(rng.integers(len(reach.q)))] for reach in self._reach]
        return np.concatenate(rows)

    def own(self, r: int) -> slice:
        """Part of q of the r-th robot."""
        return self._own[r]

    def next_leg(self, t: float) -> float:
        """When the first leg after a time begins [s]."""
        return float(np.floor(t / LEG) + 1.0) * LEG

    def towards(self, r: int, target: Floats, q: Floats, share: float) -> Floats:
        """Velocities that lead the r-th robot straight to positions, shape (j,).

        Args:
            r: Place of the robot.
            target: Positions of its joints, shape (j,) [rad or m].
            q: Where they are, shape (j,).
            share: Share of the top speeds, at most [-].
        """
        desired = APPROACH * (target - q)
        # All joints in proportion, so that the way is straight.
        most = float(np.max(np.abs(desired) / self._top[r]))
        velocity: Floats = desired * min(share / most, 1.0) if most > 0.0 else desired
        return velocity

    def _desired_of(self, r: int, t: float, q: Floats) -> Floats:
        """Desired velocities of one arm, shape (j,)."""
        k = int(np.floor(t / LEG))
        leg = self._leg(r, k)
        since = t - k * LEG
        ease = eased(since / EASE) * eased((leg.end - since) / EASE)
        return ease * self.towards(r, leg.target, q, leg.pace)

    def _leg(self, r: int, k: int) -> Leg:
        """The k-th leg of an arm."""
        if (r, k) not in self._legs:
            if len(self._legs) >= REMEMBERED:
                self._legs.clear()
            self._legs[r, k] = self._draw(r, k)
        return self._legs[r, k]

    def _draw(self, r: int, k: int) -> Leg:
        """Draw the k-th leg of an arm."""
        # What all arms draw alike, and what each draws for itself.
        common = np.random.default_rng((self._seed, k % 2**32))
        rng = np.random.default_rng((self._seed, k % 2**32, r))
        reach, places = self._reach[r], self._places[r]
        meet, where = common.random(), common.random()
        if meet < MEETINGS and len(self._meetings):
            target = reach.nearest(self._meetings[int(where * len(self._meetings))])
        elif rng.random() < TO_AN_OBJECT and places:
            target = reach.nearest(places[int(rng.integers(len(places)))])
        else:
            target = reach.q[int(rng.integers(len(reach.q)))]
        return Leg(
            target=target,
            pace=float(rng.uniform(*PACES)),
            end=LEG - float(rng.uniform(*PAUSES)),
        )


def eased(share: float) -> float:
    """From 0 to 1 without a jump of the speed, as a share of the time goes by."""
    x = min(max(share, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
