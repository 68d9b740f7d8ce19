"""Objects that move: they bounce in a box, or come straight at an arm."""

from collections.abc import Mapping

import numba
import numpy as np

from arrays import Floats

# Shortest and longest time between two changes of mind of an object [s].
MIND = (0.1, 0.6)

# How often an object bounces, comes at an arm, or stands for a while.
WAYS = ("bounce", "home", "rest")
SHARES = (0.35, 0.5, 0.15)

# An object aims at an arm no nearer than this [m].
THERE = 1e-9


@numba.njit(cache=True)
def fly(p, velocity, homing, origins, room, substep, targets, rows):
    """Move objects over some substeps.

    Args:
        p: Displacements, shape (m, 3) [m], written in place.
        velocity: Velocities, shape (m, 3) [m/s], written in place.
        homing: Whether each comes at an arm, shape (m,).
        origins: Where the scene has each object, shape (m, 3) [m].
        room: Corners of the box in which they bounce, shape (2, 3) [m].
        substep: Length of a substep [s].
        targets: Points of the arms, shape (a, 3) [m].
        rows: Displacements after each substep, shape (k, m, 3), overwritten [m].
    """
    for i in range(p.shape[0]):
        if homing[i]:
            aim(p[i] + origins[i], velocity[i], targets)
        for k in range(rows.shape[0]):
            for x in range(3):
                rows[k, i, x] = p[i, x] + (k + 1) * substep * velocity[i, x]
        for x in range(3):
            p[i, x] = rows[rows.shape[0] - 1, i, x]
            at = origins[i, x] + p[i, x]
            if at < room[0, x]:
                velocity[i, x] = abs(velocity[i, x])
            elif at > room[1, x]:
                velocity[i, x] = -abs(velocity[i, x])


@numba.njit(cache=True)
def aim(at, velocity, targets):
    """Turn a velocity straight at the nearest of some points."""
    nearest, length = 0, np.inf
    for k in range(targets.shape[0]):
        way = np.sqrt(((targets[k] - at) ** 2).sum())
        if way < length:
            nearest, length = k, way
    if length > THERE:
        speed = np.sqrt((velocity**2).sum())
        velocity[:] = speed / length * (targets[nearest] - at)


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
        fly(
            self.p,
            self._velocity,
            self._homing,
            self._origins,
            self._room,
            substep,
            targets,
            rows,
        )

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
