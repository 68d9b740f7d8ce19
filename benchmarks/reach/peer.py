"""mink, a velocity-damper QP on MuJoCo, asked for the operator's velocity."""

import logging
from collections.abc import Mapping
from importlib.util import find_spec
from math import exp
from typing import Any

import mujoco
import numpy as np

from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from arrays import Floats
from closed_loop.judge import Judge
from closed_loop.judge_model import JudgeModel
from reach.scenes import PERIOD

# Settings of its limit. The first are its defaults: a pair may lose 85 % of what it has
# left in one cycle. The second is the same limit set to begin far away, and to let a
# pair lose all but 1/e in the time ours does.
EARLY = 1.0 - exp(-PERIOD / 0.06)
PEERS: Mapping[str, Mapping[str, float]] = {
    "mink": {},
    "mink_early": {
        "gain": EARLY,
        "minimum_distance_from_collisions": 0.005,
        "collision_detection_distance": 0.10,
    },
}

# The same of its limit of positions: gain [-] and distance from the limits [rad].
POSITIONS: Mapping[str, tuple[float, float]] = {
    "mink": (0.95, 0.0),
    "mink_early": (EARLY, 0.002),
}


def is_installed() -> bool:
    """Whether the peer can be imported."""
    return find_spec("mink") is not None and find_spec("qpsolvers") is not None


class MinkPeer:
    """The nearest velocity by mink: its limits, and a posture a cycle ahead as task.

    Args:
        scene: Where.
        judge: Which pairs of it are checked, and how its joints follow q.
        limits: Least and greatest positions of the joints, and their top speeds, each
            shape (n,).
        name: One of `PEERS`.
    """

    def __init__(
        self,
        scene: Scene,
        judge: Judge,
        limits: tuple[Floats, Floats, Floats],
        name: str,
    ) -> None:
        import mink

        logging.getLogger("mink").setLevel(logging.ERROR)
        self._mink = mink
        model = JudgeModel(scene, compile_scene(scene)).model
        lower, upper, velocity = limits
        self._source, self._gain = judge.source, judge.gain
        self._address = judge.address
        # Joints of the model follow q; those that q does not drive stay.
        velocities = {}
        for place, address, (gain, offset) in zip(
            self._source, self._address, self._gain, strict=True
        ):
            j = int(np.flatnonzero(model.jnt_qposadr == address)[0])
            ends = sorted(gain * x + offset for x in (lower[place], upper[place]))
            model.jnt_range[j], model.jnt_limited[j] = ends, 1
            velocities[model.joint(j).name] = abs(gain) * velocity[place]
        self._configuration = mink.Configuration(model)
        self._task = mink.PostureTask(model, cost=1.0)
        pairs = [([a], [b]) for a, b in judge.pairs]
        self._limits: list[Any] = [
            mink.ConfigurationLimit(model, *POSITIONS[name]),
            mink.VelocityLimit(model, velocities),
            mink.CollisionAvoidanceLimit(model, pairs, **PEERS[name]),
        ]
        self.model: mujoco.MjModel = model
        self._q = np.zeros(model.nq)
        self._first = {int(p): k for k, p in reversed([*enumerate(self._source)])}

    def velocity(self, q: Floats, desired: Floats) -> Floats | None:
        """Joint velocities, shape (n,); None where its program has no solution.

        Args:
            q: Measured positions, shape (n,).
            desired: Joint velocities asked for, shape (n,).
        """
        mink, gain = self._mink, self._gain
        self._q[self._address] = gain[:, 0] * q[self._source] + gain[:, 1]
        self._configuration.update(self._q)
        target = self._q.copy()
        target[self._address] += PERIOD * gain[:, 0] * desired[self._source]
        self._task.set_target(target)
        try:
            found = mink.solve_ik(
                self._configuration,
                [self._task],
                PERIOD,
                "daqp",
                limits=self._limits,
            )
        except mink.NoSolutionFound:
            return None
        v = np.zeros(len(q))
        for place, k in self._first.items():
            v[place] = found[self._address[k]] / gain[k, 0]
        return v
