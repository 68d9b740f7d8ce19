"""Arms with limited torque: servos follow the set-points of the plant's drives.

The double integrators of `plant.py` are the drives' set-point generators. A servo for
each joint, with feed-forward, follows them against gravity, friction, the coupling of
the joints and a payload that it knows only roughly. What moves is MuJoCo's model.
"""

from copy import copy
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from armguard.robot.stopping import StoppingFigures
from arrays import Floats
from closed_loop.settings import SUBSTEP
from closed_loop.torque_model import LIGHT, TorqueModel, carry
from closed_loop.truth import UNKNOWN

# Substeps between two looks of the feed-forward at the arms' model: 1 kHz.
FEED_FORWARD = 4

# Share of the payload's mass that the servos know, least and most [-].
KNOWN = (0.85, 1.05)


class Reserve(NamedTuple):
    """How much of each declared figure is left to the servo; the rest is the drive's.

    Attributes:
        velocity: Share of the top speed [-].
        acceleration: Share of the acceleration [-].
        deceleration: Share of the least and of the greatest deceleration [-].
        ramp: Part of the ramp [s].
        command: Part of the delay of orders [s].
        position: Part of the error of positions [-].
        speed: Part of the errors of velocities and of driven velocities [-].
    """

    velocity: float = 0.03
    acceleration: float = 0.15
    deceleration: float = 0.15
    ramp: float = 0.5
    command: float = 0.001
    position: float = 0.5
    speed: float = 0.5


RESERVE = Reserve()


def driven_figures(
    figures: StoppingFigures, keep: Reserve = RESERVE
) -> StoppingFigures:
    """Figures of the drives and sensors alone, so that the arm keeps the declared.

    Args:
        figures: Declared figures of an arm.
        keep: What is left to its servos.
    """
    least = figures.deceleration / (1.0 - keep.deceleration)
    most = np.minimum(figures.deceleration_most, UNKNOWN * figures.deceleration)
    return replace(
        figures,
        velocity=(1.0 - keep.velocity) * figures.velocity,
        acceleration=(1.0 - keep.acceleration) * figures.acceleration,
        deceleration=least,
        deceleration_most=np.maximum((1.0 - keep.deceleration) * most, least),
        brake_deceleration=figures.brake_deceleration / (1.0 - keep.deceleration),
        ramp=(1.0 - keep.ramp) * figures.ramp,
        # The swing is the arm's own.
        settle=np.zeros_like(figures.settle),
        command=figures.command - keep.command,
        brake_delay=figures.brake_delay - keep.command,
        position_error=(1.0 - keep.position) * figures.position_error,
        velocity_error=(1.0 - keep.speed) * figures.velocity_error,
        tracking_error=(1.0 - keep.speed) * figures.tracking_error,
    )


class TorqueArms:
    """All arms of a scene.

    Attributes:
        built: Their model.
        saturated: Substeps in which a motor gave all its torque.

    Args:
        built: Their model.
    """

    def __init__(self, built: TorqueModel) -> None:
        self.built = built
        self._model, self._data = built.model, mujoco.MjData(built.model)
        # What the servos believe: the same arms, with another payload, no friction.
        self._nominal = copy(built.model)
        self._believed = mujoco.MjData(self._nominal)
        self._limits = built.model.jnt_actfrcrange[:, 1]
        self._before = np.zeros(len(built.driven))
        self._torque = np.zeros(len(built.driven))
        self.saturated = 0

    def start(self, q: Floats, rng: np.random.Generator, *, full: bool) -> None:
        """Rest at a configuration, with another payload.

        Args:
            q: Positions, shape (n,) [rad or m].
            rng: Of the episode.
            full: Whether payloads are the heaviest.
        """
        model, built = self._model, self.built
        for body in built.payloads:
            mass = built.heaviest * (1.0 if full else rng.uniform(LIGHT, 1.0))
            carry(model, body, mass)
            carry(self._nominal, body, mass * rng.uniform(*KNOWN))
        for m, data in ((model, self._data), (self._nominal, self._believed)):
            mujoco.mj_setConst(m, data)
            mujoco.mj_resetData(m, data)
            data.qpos[:] = q[built.driven]
        self._before[:] = 0.0
        self.saturated = 0

    def follow(self, q_rows: Floats, v_rows: Floats) -> None:
        """Move the arms after the set-points of some substeps.

        Args:
            q_rows: Set-points of positions after each substep, shape (k, n); positions
                of the arms from then on [rad or m].
            v_rows: The same of velocities, shape (k, n) [rad/s or m/s].
        """
        model, data, built = self._model, self._data, self.built
        q, v = q_rows[:, built.driven], v_rows[:, built.driven]
        pushed = np.diff(v, axis=0, prepend=self._before[None]) / SUBSTEP
        self._before = v[-1].copy()
        for k in range(len(q)):
            if k % FEED_FORWARD == 0:
                self._believed.qpos[:], self._believed.qvel[:] = q[k], v[k]
                mujoco.mj_fwdPosition(self._nominal, self._believed)
                mujoco.mj_fwdVelocity(self._nominal, self._believed)
            mujoco.mj_mulM(self._nominal, self._believed, self._torque, pushed[k])
            self._torque += self._believed.qfrc_bias
            self._torque += built.damping * v[k]
            data.ctrl[:] = q[k] + self._torque / built.stiffness
            mujoco.mj_step(model, data)
            q[k], v[k] = data.qpos, data.qvel
            spent = np.abs(data.qfrc_actuator) >= self._limits * (1.0 - 1e-9)
            self.saturated += bool(spent.any())
        q_rows[:, built.driven], v_rows[:, built.driven] = q, v
