"""Objects that move: they bounce in a box, or come straight at an arm."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Shortest and longest time between two changes of mind of an object [s].
MIND = (0.1, 0.6)

# How often an object bounces, comes at an arm, or stands for a while.
WAYS = ("bounce", "home", "rest")
SHARES = (0.35, 0.5, 0.15)


class Movers:
    """Where the objects of an episode are; nothing turns.

    Attributes:
        p: Displacement of each object from where the scene has it, shape (3,) [m].

    Args:
        rng: Of the episode.
        origins: Where the scene has each object, shape (3,) [m].
        room: Corners of the box in which they bounce, shape (2, 3) [m].
        speed: Their greatest speed [m/s].
    """

    def __init__(
        self,
        rng: np.random.Generator,
        origins: Mapping[str, Floats],
        room: Floats,
        speed: float,
    ) -> None:
        self._rng = rng
        self._origins = origins
        self._room = room
        self._speed = speed
        self.p = self.scatter()
        self._way = dict.fromkeys(origins, "rest")
        self._until = dict.fromkeys(origins, 0.0)
        self._velocity = {name: np.zeros(3) for name in origins}

    def scatter(self) -> dict[str, Floats]:
        """Put every object somewhere in the box; where they are."""
        self.p = {
            name: self._rng.uniform(*self._room) - p
            for name, p in self._origins.items()
        }
        return self.p

    def advance(self, now: float, times: Floats, targets: Floats) -> dict[str, Floats]:
        """Move them over some substeps.

        Args:
            now: Time of the last state [s].
            times: Time of each state, shape (k,) [s].
            targets: Points of the arms, shape (m, 3) [m].

        Returns:
            Displacement of each object at each time, shape (k, 3) [m].
        """
        rows = {}
        for name, p in self.p.items():
            if now >= self._until[name]:
                self._change_mind(name, now)
            if self._way[name] == "home":
                self._aim(name, targets)
            v = self._velocity[name]
            rows[name] = p + np.outer(times - now, v)
            at = self._origins[name] + rows[name][-1]
            low, high = self._room
            self._velocity[name] = np.where(
                at < low, np.abs(v), np.where(at > high, -np.abs(v), v)
            )
            self.p[name] = rows[name][-1].copy()
        return rows

    def _change_mind(self, name: str, now: float) -> None:
        """Another way to move, in another direction."""
        rng = self._rng
        self._until[name] = now + rng.uniform(*MIND)
        self._way[name] = WAYS[int(rng.choice(len(WAYS), p=SHARES))]
        direction = rng.normal(size=3)
        speed = self._speed * (1.0 if rng.random() < 0.6 else rng.random())
        if self._way[name] == "rest":
            speed = 0.0
        self._velocity[name] = speed * direction / np.linalg.norm(direction)

    def _aim(self, name: str, targets: Floats) -> None:
        """Straight at the nearest of the points."""
        ways = targets - (self._origins[name] + self.p[name])
        lengths = np.linalg.norm(ways, axis=1)
        k = int(np.argmin(lengths))
        if lengths[k] > 1e-9:
            speed = float(np.linalg.norm(self._velocity[name]))
            self._velocity[name] = speed / lengths[k] * ways[k]
