"""Continuous collision check of one straight line in joint space."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.contract_cycle import judge_all
from armguard.guard.cycle import clear_header, rebuild_world
from armguard.guard.layout import NEAR_WIDTH
from armguard.guard.motion_pairs import asks_index
from armguard.guard.sensed_search import begin_cells
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT
from armguard.motion.stop_path import bound_reaches, plan_segment, write_axes

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]


@kernel(inline=False, entry=True)
def run_segment(start: Floats, end: Floats, lines: Longs) -> int:
    """Prove for every pair that it keeps its buffer on a line in joint space.

    Args:
        start: Joint positions at its start, finite, shape (n,) [rad or m].
        end: Joint positions at its end, finite, shape (n,) [rad or m].
        lines: Ledger of a workspace; the answer's rows are those of its pairs.

    Returns:
        Count of numbers of the workspace's `out` that were used.
    """
    w = open_workspace(lines)
    m = w.motion
    rows = clear_header(w)
    begin_cells(w.sensed)
    plan_segment(start, end, m)
    w.memory.measure_all = 1
    rebuild_world(m.q, asks_index(w), w)
    write_axes(w.T_world, m)
    bound_reaches(NEXT, w.bodies, m)
    bound_reaches(1 - NEXT, w.bodies, m)
    judge_all(w)
    w.header.spans_tested = m.effort.tests
    m.span.segment = 0
    w.memory.measure_all = 1
    return rows + int(w.header.near_count) * NEAR_WIDTH
