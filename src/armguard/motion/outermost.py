"""Greatest positions of joints beyond their limits that the guard accepts.

A joint at its limit may be measured beyond it by its declared error. A joint that is
commanded to rest may creep outwards by its tracking error. The guard moves it back when
it surely is outside, that is measured beyond the limit by more than the error. So it
gets no farther than twice the error plus the creep until the command takes effect.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def led_beyond(tables: SceneTables) -> Floats:
    """Greatest true position beyond a limit under the guard, (n,) [rad or m].

    Zero for robots in mode "fixed", which declare no errors.
    """
    beyond = np.zeros(len(tables.q_names))
    for part in tables.robots:
        f = part.stopping
        if f is None or part.mode == "fixed":
            continue
        late = f.sensing + tables.period + tables.late + f.command
        # A command reverses it within its acceleration.
        turning = 0.5 * f.tracking_error / f.acceleration
        own = slice(part.first_joint, part.first_joint + part.joint_count)
        beyond[own] = 2.0 * f.position_error + f.tracking_error * (late + turning)
    return beyond


def true_limits(tables: SceneTables) -> tuple[Floats, Floats]:
    """Least and greatest true positions of accepted joints, each (n,) [rad or m].

    An accepted position is measured at most an error beyond the greatest true position
    under the guard, and the true position may be another error beyond that.
    """
    error = np.zeros(len(tables.q_names))
    for part in tables.robots:
        if part.stopping is not None and part.mode != "fixed":
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            error[own] = part.stopping.position_error
    beyond = led_beyond(tables) + 2.0 * error
    return tables.lower - beyond, tables.upper + beyond
