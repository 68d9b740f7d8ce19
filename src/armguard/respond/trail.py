"""Trail: past configurations of each robot, for a retreat along its own path.

A ring of joint positions at a least distance. Only fully proven configurations are
kept. A robot that moves back along its own path shortens its trail.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.lead_state import TRAIL, Lead

Floats = NDArray[np.float64]

# Least distance of two places of a trail, as time at top speed [s].
TRAIL_STEP = 0.02

# Distance from the place before the newest, as a share of the step, below which the
# newest place is dropped [-].
BACK_AGAIN = 0.5


@kernel
def remember_place(r: int, s: Lead, m: Motion) -> None:
    """Add a robot's configuration to its trail if it is far enough from the newest."""
    notes = s.notes[r]
    if notes.count > 0:
        if time_between(r, place_back(r, 0, s), s, m) < TRAIL_STEP:
            return
        if notes.count > 1:
            before = time_between(r, place_back(r, 1, s), s, m)
            if before < BACK_AGAIN * TRAIL_STEP:
                drop_place(r, s)
                return
    first = m.robot_figures[r].first_joint
    for j in range(first, first + m.robot_figures[r].joint_count):
        s.trail[notes.head, j] = m.q[j]
    notes.head = (notes.head + 1) % TRAIL
    notes.count = min(notes.count + 1, TRAIL)


@kernel
def place_back(r: int, back: int, s: Lead) -> int:
    """Row of a place in a robot's trail, counted back from the newest."""
    return int((s.notes[r].head - 1 - back) % TRAIL)


@kernel
def drop_place(r: int, s: Lead) -> None:
    """Remove the newest place of a robot's trail."""
    s.notes[r].head = (s.notes[r].head - 1) % TRAIL
    s.notes[r].count -= 1


@kernel
def time_between(r: int, row: int, s: Lead, m: Motion) -> float:
    """Time a robot needs at top speed to a place of its trail [s]."""
    return time_to(r, s.trail[row], m)


@kernel
def time_to(r: int, place: Floats, m: Motion) -> float:
    """Time a robot needs at top speed to joint positions, shape (n,) [s]."""
    first = m.robot_figures[r].first_joint
    longest = 0.0
    for j in range(first, first + m.robot_figures[r].joint_count):
        way = abs(place[j] - m.q[j])
        longest = max(longest, way / m.joint_figures[j].velocity)
    return float(longest)
