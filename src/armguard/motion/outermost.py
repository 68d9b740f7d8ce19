"""How far beyond its limits a joint may be without being refused.

A joint at its limit is measured beyond it by as much as its declared error. Where
commands go through the guard one that is told to stand still may creep outwards, by
what its drive misses. It is led back when it surely is outside, that is measured beyond
by more than the error: so it gets no farther than twice the error, and what it creeps
until that takes effect.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def led_beyond(tables: SceneTables) -> Floats:
    """How far beyond a limit a joint that the guard leads may truly be, shape (n,).

    Nothing for robots in mode "fixed", which declare no errors [rad or m].
    """
    beyond = np.zeros(len(tables.q_names))
    for part in tables.robots:
        f = part.stopping
        if f is None or part.mode == "fixed":
            continue
        time = f.sensing + tables.period + tables.late + f.command
        # It turns round no faster than a command can make it.
        turning = 0.5 * f.tracking_error / f.acceleration
        own = slice(part.first_joint, part.first_joint + part.joint_count)
        beyond[own] = 2.0 * f.position_error + f.tracking_error * (time + turning)
    return beyond


def true_limits(tables: SceneTables) -> tuple[Floats, Floats]:
    """Least and greatest positions of joints that are not refused, each shape (n,).

    What is not refused is measured an error farther than it may be led, and may be
    another one farther than it is measured [rad or m].
    """
    error = np.zeros(len(tables.q_names))
    for part in tables.robots:
        if part.stopping is not None and part.mode != "fixed":
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            error[own] = part.stopping.position_error
    beyond = led_beyond(tables) + 2.0 * error
    return tables.lower - beyond, tables.upper + beyond
