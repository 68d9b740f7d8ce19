"""Make the bay's three tasks from their keyframes, and check what is claimed of them.

    python benchmarks/make_bay_tasks.py            # write, check, print the table
    python benchmarks/make_bay_tasks.py --check    # compare with the files only

The files come out the same to the last byte everywhere: the profile is a polynomial,
and positions are rounded to a millionth of a radian. The checks use pinocchio and coal
(`bay_oracle.py`), none of armguard's code.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bay_keyframes import TASK_150, TASK_700, TASK_2000, Keyframe
from bay_oracle import BAY, JOINTS, BayOracle, Floats, Nearest

# The paper's cycle: 30 ms a step [s].
PERIOD = 0.030

# Share of a keyframe spent gathering speed, and as much losing it [-].
RAMP = 0.25

TASKS = {150: TASK_150, 700: TASK_700, 2000: TASK_2000}

# What is claimed of every task: top tip speed, the paper's 24 in/s [m/s]; surfaces
# never this near [m]; farther than this is clear [m], for this share of the cycles [-].
TOP_SPEED = 0.61
LEAST_DISTANCE = 0.002
CLEAR = 0.080
CLEAR_SHARE = 0.60


def trapezoid(u: float) -> float:
    """Way done, in [0, 1], at the time u in [0, 1] of a stretch from rest to rest.

    Example:
        >>> trapezoid(0.0), trapezoid(0.5), trapezoid(1.0)
        (0.0, 0.5, 1.0)
    """
    if u > 0.5:
        return 1.0 - trapezoid(1.0 - u)
    top = 1.0 / (1.0 - RAMP)
    return top * u * u / (2.0 * RAMP) if u < RAMP else top * (u - RAMP / 2.0)


def configurations(home: Floats, keyframes: Sequence[Keyframe]) -> Floats:
    """Positions at every cycle, shape (cycles, 14) [rad]; rounded as in the file."""
    rows, here = [], home.copy()
    for keyframe in keyframes:
        goal = here.copy()
        for offset, arm in ((-1, keyframe.left), (JOINTS - 1, keyframe.right)):
            for joint, position in arm.items():
                goal[offset + joint] = position
        rows += [
            here + trapezoid(k / keyframe.cycles) * (goal - here)
            for k in range(1, keyframe.cycles + 1)
        ]
        here = goal
    return np.round(np.array(rows), 6)


def csv_text(names: Sequence[str], q: Floats) -> str:
    """A task as the text of its file; negative zero is written as zero."""
    lines = [",".join(("t", *names))]
    for k, row in enumerate(q):
        lines.append(",".join([f"{k * PERIOD:.2f}", *(f"{v + 0.0:.6f}" for v in row)]))
    return "\n".join(lines) + "\n"


class Findings:
    """What the oracle sees in a task.

    Args:
        oracle: The bay.
        q: Positions at every cycle, shape (cycles, 14) [rad].

    Attributes:
        nearest: Nearest pair of each cycle.
        closest: Nearest pair of the task for each kind: 'arm-arm', 'arm-object',
            'one arm'.
        tip_speed: Speed of each arm's tip, shape (cycles - 1, 2) [m/s].
        joint_speed: Speed of each joint, shape (cycles - 1, 14) [rad/s].
        inside: Whether every primitive stays within the index's cube.
    """

    def __init__(self, oracle: BayOracle, q: Floats) -> None:
        self.buffer = float(oracle.scene["buffer"])
        self.joint_speed = np.abs(np.diff(q, axis=0)) / PERIOD
        tips = np.array([oracle.tips(row) for row in q])
        self.tip_speed = np.linalg.norm(np.diff(tips, axis=0), axis=2) / PERIOD
        measured = [oracle.measure(row) for row in q]
        self.nearest = [min(m, key=lambda p: p.distance) for m in measured]
        self.closest: dict[str, tuple[int, Nearest]] = {}
        self.warned = {"arm-arm": 0, "arm-object": 0, "one arm": 0}
        for k, pairs in enumerate(measured):
            for kind in self.warned:
                least = min((p for p in pairs if kind_of(p) == kind),
                            key=lambda p: p.distance)  # fmt: skip
                self.warned[kind] += least.distance < self.buffer
                if kind not in self.closest or least < self.closest[kind][1]:
                    self.closest[kind] = (k, least)
        cube = oracle.scene["index"]["cube"]
        low = np.array(cube["centre"]) - cube["edge"] / 2
        boxes = np.array([oracle.corners(row) for row in q])
        self.inside = bool(
            (boxes[:, 0] >= low).all() and (boxes[:, 1] <= low + cube["edge"]).all()
        )


def kind_of(pair: Nearest) -> str:
    """'arm-arm', 'arm-object', or 'one arm' for two links of the same one."""
    if "/" not in pair.b:
        return "arm-object"
    return "one arm" if pair.a.split("/")[0] == pair.b.split("/")[0] else "arm-arm"
