"""Objects that move: they bounce in a box, or come straight at an arm."""

from collections.abc import Mapping

import numpy as np

from arrays import Floats

# Shortest and longest time between two changes of mind of an object [s].
MIND = (0.1, 0.6)

# How often an object bounces, comes at an arm, or rests for a while.
WAYS = ("bounce", "home", "rest")
SHARES = (0.35, 0.5, 0.15)

# An object aims at an arm no nearer than this [m].
THERE = 1e-9


class Movers:
    """Where the objects of an episode are; nothing turns.

    Attributes:
        names: Their names.
        p: Displacement of each from where the scene has it, shape (m, 3) [m].

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
        self.names = tuple(origins)
        self._rng = rng
        self._origins = np.array([*origins.values()]).reshape(-1, 3)
        self._room = room
        self._speed = speed
        self.p = np.zeros_like(self._origins)
        self._homing = np.zeros(len(origins), dtype=np.bool_)
        self._until = np.zeros(len(origins))
        self._velocity = np.zeros_like(self._origins)

    def scatter(self) -> dict[str, Floats]:
        """Put every object somewhere in the box; where they are."""
        low, high = self._room
        self.p[:] = self._rng.uniform(low, high, self.p.shape) - self._origins
        return dict(zip(self.names, self.p, strict=True))

    def advance(
        self, now: float, substep: float, targets: Floats, rows: Floats
    ) -> None:
        """Move them over some substeps.

        Args:
            now: Time of the last state [s].
            substep: Length of a substep [s].
            targets: Points of the arms, shape (a, 3) [m].
            rows: Displacements after each substep, shape (k, m, 3), overwritten [m].
        """
        for i, until in enumerate(self._until.tolist()):
            if now >= until:
                self._change_mind(i, now)
        at = self._origins + self.p
        for i in np.flatnonzero(self._homing):
            ways = targets - at[i]
            lengths = np.sqrt((ways**2).sum(axis=1))
            k = int(lengths.argmin())
            if lengths[k] > THERE:
                speed = np.sqrt((self._velocity[i] ** 2).sum())
                self._velocity[i] = speed / lengths[k] * ways[k]
        times = np.arange(1, len(rows) + 1) * substep
        rows[:] = self.p + times[:, None, None] * self._velocity
        self.p[:] = rows[-1]
        at = self._origins + self.p
        inwards = np.abs(self._velocity)
        self._velocity[at < self._room[0]] = inwards[at < self._room[0]]
        self._velocity[at > self._room[1]] = -inwards[at > self._room[1]]

    def _change_mind(self, i: int, now: float) -> None:
        """Another way to move, in another direction."""
        rng = self._rng
        self._until[i] = now + rng.uniform(*MIND)
        way = WAYS[int(rng.choice(len(WAYS), p=SHARES))]
        self._homing[i] = way == "home"
        direction = rng.normal(size=3)
        speed = self._speed * (1.0 if rng.random() < 0.6 else rng.random())
        if way == "rest":
            speed = 0.0
        self._velocity[i] = speed * direction / np.linalg.norm(direction)
