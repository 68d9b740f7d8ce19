"""What a guard remembers of its inputs and of the stops it has ordered."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Places in `Watch.given`: what a cycle was handed.
NOW_TIME = 0  # time of the cycle [s]; NaN if nobody said
HAS_VELOCITY = 1  # 1 if velocities came with the positions
GIVEN = 2

# Places in `Watch.last`.
LAST_NOW = 0  # time of the last cycle [s]
FORCED = 1  # reason why every robot must stop in this cycle, 0 for none
LAST = 2

# Places in `Watch.pace`.
PERIOD = 0  # from one cycle to the next [s]
LATE = 1  # how much later it may come [s]
LOOK = 2  # how far ahead slack is told in time [s]
PACE = 3

# Phases of a robot.
RESTING = 0  # at rest after a stop, or at the start: its operator waits
RUNNING = 1  # its operator moves it
STOPPING = 2  # a controlled stop was ordered
BRAKING = 3  # the brake was ordered, since the stop was not what was declared
LOST = 4  # the brake is not what was declared either

# Samples kept of each joint, from which velocities are estimated.
HISTORY = 16


class Watch(NamedTuple):
    """Inputs of a cycle and memory of the cycles before.

    Attributes:
        stamps: Time each robot was measured, shape (r,) [s].
        given: See NOW_TIME, shape (GIVEN,).
        velocity: Velocities that came with the positions, shape (n,).
        last: See LAST_NOW, shape (LAST,).
        pace: See PERIOD, shape (PACE,).
        last_stamp: Stamp of each robot's last sample, shape (r,) [s].
        sample_count: Samples in each robot's history, shape (r,).
        sample_t: Their stamps, newest first, shape (r, HISTORY) [s].
        sample_q: Their positions, newest first, shape (n, HISTORY).
        phase: Phase of each robot, shape (r,).
        ordered: When its stop or brake was ordered, shape (r,) [s].
        must: 1 where a robot must stop in this cycle, shape (r,).
        cause: Reason of each robot's last order, shape (r,).
        fastest: Greatest speed the ordered stop leaves each joint, shape (n,).
        fastest_at: Time that is for, shape (r,) [s].
        disproved: 1 where a joint broke a declared figure, shape (n,).
        model: Model error of each moving primitive's robot, shape (m,) [m].
        base: How far an error of the base moves each, shape (m,) [m].
        top_speed: Greatest speed of primitives no robot moves, (p,) or (0,) [m/s].
        seen_at: When each of them was seen, shape (p,) or (0,) [s].
        robot_of: Robot of each moving primitive, shape (m,).
    """

    stamps: Floats
    given: Floats
    velocity: Floats
    last: Floats
    pace: Floats
    last_stamp: Floats
    sample_count: Longs
    sample_t: Floats
    sample_q: Floats
    phase: Longs
    ordered: Floats
    must: Longs
    cause: Longs
    fastest: Floats
    fastest_at: Floats
    disproved: Longs
    model: Floats
    base: Floats
    top_speed: Floats
    seen_at: Floats
    robot_of: NDArray[np.int32]
