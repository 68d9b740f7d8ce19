"""True distances of a Panda's own meshes, by MuJoCo."""

from collections.abc import Iterator
from itertools import product

import mujoco
import numpy as np

from arrays import Floats
from gripping.judge import FINGERS, HELD, Judge, Pair
from gripping.panda_arm import PandaArm
from gripping.solids import Solid
from gripping.workplace import PERIOD, Workplace

# Distance up to which pairs are measured [m].
SIGHT = 0.03

# What is held touches the hand and its fingers, and that is no contact.
GRIPPER = ("hand", *FINGERS)

# How far what is held may reach beyond the upright solid it is, as the hand that
# carries it is not quite upright [m].
TILTED = 0.005


class PandaJudge(Judge):
    """Looks at true joint positions, one stretch of time after the other.

    Args:
        place: The workplace.
        arm: The Panda in it.
    """

    def __init__(self, place: Workplace, arm: PandaArm) -> None:
        super().__init__(place, PERIOD)
        self.arm = arm
        self._poses = {name: upright(solid) for name, solid in self.solids.items()}
        self._T_hand_held = np.eye(4)
        # Boxes round the solids, none of which turns but what is held, by little.
        self._half = np.array([half_of(solid) for solid in self.solids.values()])

    def grasp(self, q: Floats, name: str) -> None:
        """From now on something is carried."""
        self.held = name
        self._T_hand_held = np.linalg.inv(self.arm.hand(q)) @ self._poses[name]
        self._fingers = q[-1:]

    def release(self, q: Floats) -> None:
        """From now on it stands where it is."""
        if self.held is not None:
            T = self.arm.hand(q) @ self._T_hand_held
            self._poses[self.held] = T
            self.solids[self.held] = self.solids[self.held].moved_to(T[:3, 3])
            self.held = None

    def gap(self, q: Floats, part: str, other: str) -> float:
        """True distance of a part of the arm and something else [m]."""
        return self.near(q).get((part, other), SIGHT)

    def near(self, q: Floats) -> dict[Pair, float]:
        """Signed distances of all that is in sight at joint positions [m]."""
        self._put(q)
        arm, m, data = self.arm, self.arm.model, self.arm.data
        geoms, parts = list(arm.parts), list(arm.parts.values())
        if self.held is not None:
            geoms, parts = [*geoms, arm.solids[self.held]], [*parts, HELD]
        names = list(self.solids)
        others = [arm.solids[name] for name in names]
        apart = np.abs(data.geom_xpos[geoms][:, None] - data.geom_xpos[others])
        outside = np.maximum(apart - self._half, 0.0)
        bound = np.sqrt(np.einsum("ijk,ijk->ij", outside, outside))
        bound -= m.geom_rbound[geoms][:, None]
        found: dict[Pair, float] = {}
        for i, j in np.argwhere(bound < SIGHT + TILTED):
            pair = parts[i], names[j]
            if self._judged(*pair):
                a, b = geoms[i], others[j]
                distance = mujoco.mj_geomDistance(m, data, a, b, SIGHT, None)
                found[pair] = min(found.get(pair, SIGHT), distance)
        return found

    def _distances(self, q: Floats) -> Iterator[tuple[Pair, Floats]]:
        """See `Judge`."""
        parts = dict.fromkeys([*self.arm.parts.values(), *[HELD] * bool(self.held)])
        near = [self.near(row) for row in q]
        for pair in product(parts, self.solids):
            if self._judged(*pair):
                yield pair, np.array([found.get(pair, SIGHT) for found in near])

    def _judged(self, part: str, name: str) -> bool:
        """Whether a part of the arm and something else are two."""
        return name != self.held or part not in (*GRIPPER, HELD)

    def _put(self, q: Floats) -> None:
        """Put the arm, and what it carries, to where they are at joint positions."""
        hand = self.arm.hand(q)
        if self.held is not None:
            self._poses[self.held] = hand @ self._T_hand_held
        data = self.arm.data
        for name, T in self._poses.items():
            geom = self.arm.solids[name]
            data.geom_xpos[geom] = T[:3, 3]
            data.geom_xmat[geom] = T[:3, :3].ravel()


def half_of(solid: Solid) -> Floats:
    """Half of the sizes of the box round something that stands, shape (3,) [m]."""
    return solid.half + np.array([solid.radius, solid.radius, 0.0])


def upright(solid: Solid) -> Floats:
    """Pose of something that stands, shape (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = solid.at
    return T
