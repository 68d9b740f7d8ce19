"""Is there an admissible future in which arms touch? Dense samples, exact shapes."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.robot.stopping import StoppingFigures
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from arrays import Floats, Ints
from closed_loop import plant as plants
from closed_loop.answers import Guarding
from closed_loop.exact_world import ExactWorld
from closed_loop.settings import Setting
from closed_loop.truth import joined

# Time between two states of a future that is sampled [s].
STEP = 0.002

# Pairs that may be reached first and are attacked, in a hurry and thoroughly, and
# random corners tried beside.
ATTACKED = 8
ATTACKED_THOROUGHLY = 40
RANDOM = 4

# An unknown greatest deceleration may be this many times the least: a stop at once [-].
AT_ONCE = 1000.0

# How often a pair is attacked anew by its gradient where it came nearest.
ANEW = 3

# States between two that are measured while one pair is brought nearer.
COARSE = 5

# Pairs count as near if they could meet with levers so much longer than now [-].
SPARE = 1.3

# Change of a distance by a joint that counts as none [m/rad].
FLAT = 1e-3


class Future(NamedTuple):
    """A continuation: an operator's desired velocities, then a stop.

    Attributes:
        desired: Desired velocities in shares of the top speeds, shape (n,).
        strength: Strength of each joint's stop, 0 the least, 1 the most, shape (n,);
            the least one is late and swings as well.
        error: Errors of the measured state in shares of the largest, shape (n,).
    """

    desired: Floats
    strength: Floats
    error: Floats


class Measured(NamedTuple):
    """What is known in a cycle.

    Attributes:
        q: Measured positions, shape (n,).
        v: Measured velocities, shape (n,).
        ages: Ages of the arms' measurements, shape (a,) [s].
        object_age: Age of the oldest sighting of an object [s].
    """

    q: Floats
    v: Floats
    ages: Floats
    object_age: float


@dataclass(frozen=True, slots=True)
class Breach:
    """A future that breaks the floor.

    Attributes:
        pair: The pair.
        time: Time after the measurement [s].
        distance: What it keeps there, less what is not known of it [m].
        future: The future.
    """

    pair: tuple[str, str]
    time: float
    distance: float
    future: Future


class Search:
    """Looks for futures in which a pair comes nearer than the floor.

    A future is: the operator goes on until the next order could take effect, then all
    arms stop. Operator and stops may do whatever the figures allow.

    Args:
        world: Distances.
        figures: Figures of each arm.
        robots: Their names.
        first: First joint of each arm, and n.
        wait: Time from a cycle to the last moment of the next one [s].
        floor: Distance to be kept [m].
        speeds: Top speed of each object that moves [m/s].
        seed: Of the random corners.
    """

    def __init__(
        self,
        world: ExactWorld,
        figures: Sequence[StoppingFigures],
        robots: Sequence[str],
        first: Ints,
        *,
        wait: float,
        floor: float,
        speeds: dict[str, float],
        seed: int = 0,
    ) -> None:
        self.world = world
        self.first = first
        self.wait = wait
        self.floor = floor
        self._rng = np.random.default_rng(seed)
        self._figures = figures
        self._robots = tuple(robots)
        self._velocity = joined(figures, "velocity")
        self._acceleration = joined(figures, "acceleration")
        self._least = joined(figures, "deceleration")
        most = np.minimum(joined(figures, "deceleration_most"), AT_ONCE * self._least)
        self._ratio = most / self._least
        self._position_error = joined(figures, "position_error")
        self._velocity_error = joined(figures, "velocity_error")
        self._ramp = joined(figures, "ramp")
        self._settle = joined(figures, "settle")
        self._settle_time = joined(figures, "settle_time")
        self._command = np.array([f.command for f in figures])
        self._drift = np.array(
            [sum(speeds.get(s, 0.0) for s in p) for p in world.owners]
        )
        self._unknown = np.array([self._error_of(p) for p in world.owners])

    def breach(
        self, q: Floats, v: Floats, stamps: Floats, seen: float, now: float, sweeps: int
    ) -> Breach | None:
        """A future that breaks the floor, or None if none was found.

        Args:
            q: Measured positions, shape (n,).
            v: Measured velocities, shape (n,).
            stamps: When each arm was measured, shape (a,) [s].
            seen: When the objects were seen that were seen first [s].
            now: Time of the cycle [s].
            sweeps: How often every joint of the best future is tried the other way.
        """
        m = Measured(q, v, now - stamps, now - seen)
        ways, last = self._ways(v, m.ages)
        drift = self._drift * (m.object_age + last)
        levers = np.minimum(self.world.levers(q), self.world.reach)
        gaps = self.world.bounds(q) - self._unknown - self.floor - drift
        close = SPARE * levers @ ways
        for k in np.flatnonzero(gaps < close):
            distance = self.world.distance(int(k))
            gaps[k] = distance - self._unknown[k] - self.floor - drift[k]
        near = np.flatnonzero(gaps < close)
        if len(near) == 0:
            return None
        # Not the nearest first, but those whose gap is least beside what moves can do.
        order = near[np.argsort(gaps[near] / close[near])]
        order = order[: ATTACKED_THOROUGHLY if sweeps else ATTACKED]
        for k in order:
            outward = self.world.gradient(int(k), q)
            for future in self._attacks(outward, m.v):
                if found := self._first_breach(future, m, near):
                    return found
            if sweeps and (found := self._descend(int(k), outward, m, sweeps)):
                return found
        for _ in range(RANDOM):
            desired, error = self._rng.choice([-1.0, 1.0], (2, len(q)))
            strength = self._rng.integers(0, 2, len(q)).astype(float)
            if found := self._first_breach(Future(desired, strength, error), m, near):
                return found
        return None

    def _attacks(self, outward: Floats, v: Floats) -> list[Future]:
        """Futures that should bring a pair together."""
        closing = np.where(np.abs(outward) > FLAT, -np.sign(outward), 0.0)
        apart = (v * outward > 0.0).astype(float)
        return [
            Future(desired, strength, closing)
            for desired in (closing, np.sign(v))
            for strength in (apart, np.zeros(len(v)))
        ]

    def _first_breach(
        self, future: Future, m: Measured, near: NDArray[np.intp]
    ) -> Breach | None:
        """The first moment of a future at which a near pair breaks the floor.

        A pair is measured again only where it may have come as near as that.
        """
        rows = self.rows(future, m.q, m.v, m.ages)
        gone = np.zeros_like(rows)
        np.cumsum(np.abs(np.diff(rows, axis=0)), axis=0, out=gone[1:])
        times = np.arange(len(rows)) * STEP
        ways = gone @ self.world.reach[near].T
        ways += np.outer(times, self._drift[near])
        ends = [self._end_of(int(k), rows) for k in near]
        due = {0: list(range(len(near)))}
        for s in range(len(rows)):
            if s not in due:
                continue
            self.world.place(rows[s])
            for n in due.pop(s):
                if s > ends[n]:
                    continue
                k = int(near[n])
                kept = self._kept(k, float(times[s]), m)
                if kept < self.floor:
                    return Breach(self.world.owners[k], float(times[s]), kept, future)
                room = ways[s, n] + kept - self.floor
                at = max(int(np.searchsorted(ways[:, n], room)), s + 1)
                due.setdefault(at, []).append(n)
        return None

    def _descend(
        self, k: int, outward: Floats, m: Measured, sweeps: int
    ) -> Breach | None:
        """Turn joint by joint what brings a pair nearer still."""
        best = self._attacks(outward, m.v)[0]
        least, time, there = self._least_of(k, best, m)
        for _ in range(ANEW):
            # What brings a pair together may be another way where it is nearest.
            before = least
            for change in self._attacks(self.world.gradient(k, there), m.v):
                found = self._least_of(k, change, m)
                if found[0] < least:
                    (least, time, there), best = found, change
            if least == before:
                break
        for _ in range(sweeps):
            before = least
            for j in np.flatnonzero(self.world.reach[k]):
                for change in turned(best, int(j)):
                    found = self._least_of(k, change, m)
                    if found[0] < least:
                        (least, time, there), best = found, change
            if least < self.floor:
                return Breach(self.world.owners[k], time, least, best)
            if least == before:
                break
        return None

    def _least_of(
        self, k: int, future: Future, m: Measured
    ) -> tuple[float, float, Floats]:
        """Least distance a pair keeps in a future [m], when [s], and where."""
        rows = self.rows(future, m.q, m.v, m.ages)
        end = self._end_of(k, rows)
        least, at = np.inf, 0

        def look(states: Iterable[int]) -> None:
            nonlocal least, at
            for s in states:
                self.world.place(rows[s])
                kept = self._kept(k, s * STEP, m)
                if kept < least:
                    least, at = kept, s

        look(min(s, end) for s in range(0, end + COARSE, COARSE))
        look(range(max(at - COARSE + 1, 0), min(at + COARSE, end + 1)))
        return least, at * STEP, rows[at]

    def _kept(self, k: int, time: float, m: Measured) -> float:
        """Distance of a pair in the state placed last, less what is not known [m]."""
        lost = self._unknown[k] + self._drift[k] * (m.object_age + time)
        return self.world.distance(k) - lost

    def _end_of(self, k: int, rows: Floats) -> int:
        """The last state in which an arm of a pair still moves.

        Contacts after it are caused by objects only.
        """
        own = self.world.reach[k] > 0.0
        moves = np.abs(np.diff(rows[:, own], axis=0)).max(axis=1) > 0.0
        return int(np.flatnonzero(moves)[-1]) + 1 if moves.any() else 0

    def rows(self, future: Future, q: Floats, v: Floats, ages: Floats) -> Floats:
        """States of a future, one each STEP from the measurement on, shape (m, n)."""
        plant = plants.plant_at(
            q + future.error * self._position_error,
            self.first,
            self._velocity,
            self._acceleration,
            self._least,
        )
        plant.phase[:] = plants.FREE
        start = v + future.error * self._velocity_error
        plant.v[:] = np.clip(start, -self._velocity, self._velocity)
        strength = self._least * self._ratio**future.strength
        # What is to get far brakes late and swings; what is to stay behind does not.
        soft = (future.strength == 0.0).astype(float)
        stop = strength, soft * self._ramp, soft * self._settle, self._settle_time
        for arm, age in enumerate(ages):
            at = float(age) + self.wait + float(self._command[arm])
            plants.order_stop(plant, arm, at, stop)
        count = int(self._ways(plant.v, ages)[1] / STEP) + 2
        rows, speeds = np.zeros((2, count, len(q)))
        free = np.zeros((count, len(ages)), dtype=np.bool_)
        desired = future.desired * self._velocity
        plants.advance(plant, 0, STEP, desired, rows, speeds, free)
        return np.vstack([q + future.error * self._position_error, rows])

    def _ways(self, v: Floats, ages: Floats) -> tuple[Floats, float]:
        """Farthest each joint may get until it rests, (n,), and how long that takes."""
        free = np.repeat(ages + self.wait + self._command, np.diff(self.first))
        gained = self._velocity_error + self._acceleration * free
        speed = np.minimum(np.abs(v) + gained, self._velocity)
        stop = speed / self._least + self._ramp
        ways = speed * (free + 0.5 * stop) + self._settle + self._position_error
        return ways, float((free + stop + self._settle_time).max())

    def _error_of(self, pair: tuple[str, str]) -> float:
        """What is not known of a pair's distance, whatever the arms do [m]."""
        arms = [self._robots.index(s.split("/")[0]) for s in pair if "/" in s]
        found = sum(self._figures[arm].model_error for arm in arms)
        if len(arms) == 2 and arms[0] == arms[1]:
            return found
        for arm in arms:
            figures = self._figures[arm]
            own = slice(self.first[arm], self.first[arm + 1])
            far = float(self.world.reach[:, own].max())
            found += figures.base_error + figures.base_turn * far
        return found


# What is tried of each joint; in between, since not all distances fall to an end.
CHOICES = {
    "desired": (-1.0, 0.0, 1.0),
    "strength": (0.0, 0.1, 0.4, 1.0),
    "error": (-1.0, 1.0),
}


def turned(future: Future, j: int) -> list[Future]:
    """The future with one joint another way: its velocity, its stop, or its error."""
    found = []
    for name, values in CHOICES.items():
        own = getattr(future, name)
        for value in values:
            if value != own[j]:
                change = own.copy()
                change[j] = value
                found.append(future._replace(**{name: change}))
    return found


# How often the search turns every joint for a verdict, and to call a stop needless.
SWEEPS = 0
THOROUGH = 2


class Reference(Guarding):
    """Stops the arms of a pair as soon as some admissible future breaks its floor.

    Far too slow for a loop. It stops later than a guard may that has to prove what this
    one only samples: what it lets through is the most that can be required.

    Args:
        scene: The scene.
        figures: Figures of each arm.
        setting: Its period, lateness, floor and speeds.
        movers: Objects that move.
    """

    def __init__(
        self,
        scene: Scene,
        figures: Sequence[StoppingFigures],
        setting: Setting,
        movers: Sequence[str],
    ) -> None:
        tables = compile_scene(scene)
        super().__init__(scene.robots)
        self._origins = {n: scene.objects[n].pose.matrix()[:3, 3] for n in movers}
        self._world = ExactWorld(scene, tables)
        sizes = [len(f.velocity) for f in figures]
        self._search = Search(
            self._world,
            figures,
            self.robots,
            np.cumsum([0, *sizes]).astype(np.int64),
            wait=setting.period + setting.late,
            floor=setting.floor,
            speeds=dict.fromkeys(movers, setting.top_speed),
        )
        self._seen: dict[str, float] = {}

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""
        self._world.shift(name, T[:3, 3] - self._origins[name])
        self._seen[name] = stamp

    def stopped(
        self, q: Floats, stamp: Mapping[str, float], velocity: Floats, now: float
    ) -> Collection[str]:
        """See `Guarding`."""
        breach = self.breach(q, stamp, velocity, now, SWEEPS)
        sides = () if breach is None else breach.pair
        return {side.split("/")[0] for side in sides if "/" in side}

    def breach(
        self,
        q: Floats,
        stamp: Mapping[str, float],
        velocity: Floats,
        now: float,
        sweeps: int,
    ) -> Breach | None:
        """A future in which a pair breaks its floor if no stop is ordered now."""
        stamps = np.array([stamp[name] for name in self.robots])
        seen = min(self._seen.values(), default=now)
        return self._search.breach(q, velocity, stamps, seen, now, sweeps)

    def reset(self) -> None:
        """See `Guarding`."""
        self._seen.clear()
