"""The cycle with predicted stops.

Joint angles -> plausible? -> possible stops -> poses -> index -> pairs, each proven
-> orders -> levels.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.commands import is_as_commanded, look_under_way, set_drives
from armguard.guard.contact_times import write_contact_times
from armguard.guard.contract_cycle import judge_all
from armguard.guard.cues import write_cues
from armguard.guard.cycle import (
    clear_header,
    positions_are_finite,
    rebuild_world,
)
from armguard.guard.explain import explain_nearest, write_envelopes
from armguard.guard.grade import grade_robots
from armguard.guard.hanging import no_sensor_is_stuck
from armguard.guard.layout import NEAR_WIDTH
from armguard.guard.levels import Reason
from armguard.guard.limits import report_measured_limits
from armguard.guard.motion_pairs import asks_index
from armguard.guard.observe import clocks_are_right, observe
from armguard.guard.sensed_age import cells_are_right
from armguard.guard.sensed_boxes import BY_WORD
from armguard.guard.sensed_search import begin_work
from armguard.guard.stops import (
    order_stops,
    set_clocks,
    stop_everything,
    supervise_stops,
)
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace, open_workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT, NOW, Motion
from armguard.motion.stop_path import (
    bound_reaches,
    measured_speeds,
    plan_stops,
    write_axes,
)
from armguard.table import Vector

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

CAPACITY = int(Reason.CAPACITY)
NO_DISTANCE = int(Reason.NO_DISTANCE)
OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)


@kernel(inline=False, entry=True)
def run_guarded_cycle(q: Floats, lines: Longs) -> int:
    """Judge one cycle and order the stops that it demands.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        lines: Ledger of a workspace; its state, memory and `out` are updated.

    Returns:
        Count of numbers of the workspace's `out` that were used.
    """
    w = open_workspace(lines)
    out = w.header
    v, m = w.watch, w.motion
    v.given.commanded = 0
    rows = clear_header(w)
    if not judge_input(q, w):
        return rows
    conclude(w)
    report_measured_limits(q, w, v, m)
    if out.reason == OUT_OF_LIMITS:
        refuse(w)
    return rows + int(out.near_count) * NEAR_WIDTH


@kernel
def judge_input(q: Floats, w: Workspace) -> bool:
    """Read the input of a cycle, rebuild the world and judge every pair.

    Returns:
        Whether the input could be judged; if not, every robot is stopped.
    """
    take_input(q, w)
    return bool(w.watch.given.judged != 0)


@kernel(separate=True)
def take_input(q: Vector, w: Workspace) -> None:
    """Judge every pair, or stop all robots for an implausible input.

    Args:
        q: Joint positions, shape (n,) if the input is valid [rad or m].
        w: The workspace; whether the input could be judged is written to its watch.
    """
    out = w.header
    v, m = w.watch, w.motion
    v.given.judged = 0
    # The clock first: the stop for any other fault is ordered by it.
    right = clocks_are_right(out, v, m)
    if not positions_are_finite(q, w.lower, out):
        out.robot, right = -1.0, False
    if not right:
        refuse(w)
        return
    if not observe(q, out, v, m):
        refuse(w)
        return
    if v.given.commanded != 0 and not (
        is_as_commanded(v, m, out) and no_sensor_is_stuck(q, v, m, out)
    ):
        refuse(w)
        return
    if w.settings.sensed != 0 and not cells_are_right(w.sensed.about, v, m, out):
        refuse(w)
        return
    v.given.judged = 1
    w.sensed.coarse[:] = BY_WORD
    w.sensed.evaded[:] = 0
    begin_work(w.sensed)
    begin(v, m)
    # Every pair is measured: one that does not move may need another distance now.
    w.memory.measure_all = 1
    rebuild_world(q, asks_index(w), w)
    write_axes(w.T_world, m)
    for plan in range(2):
        bound_reaches(plan, w.bodies, m)
    judge_all(w)


@kernel(separate=True)
def begin(v: Watch, m: Motion) -> None:
    """Supervise the ordered stops, and plan those that may be ordered."""
    supervise_stops(v, m)
    set_clocks(v, m)
    look_under_way(v, m)
    set_drives(v, m)
    forget_demands(v, m)
    plan_stops(NEXT, m)
    plan_stops(NOW, m)
    measured_speeds(m)


@kernel
def forget_demands(v: Watch, m: Motion) -> None:
    """Reset demands, deficits and time left before pairs are judged."""
    for r in range(v.must.shape[0]):
        v.must[r] = v.relieved[r] = 0
        v.time_left[r] = np.inf
        v.deficit[r] = 0.0
    m.effort.tests = 0


@kernel(separate=True)
def conclude(w: Workspace) -> None:
    """Order stops, grade the robots, explain the nearest pair, write times and cues."""
    v, m = w.watch, w.motion
    if w.header.reason == CAPACITY or w.header.reason == NO_DISTANCE:
        v.last.forced = int(w.header.reason)
    order_stops(v, m)
    w.header.spans_tested = m.effort.tests
    grade_robots(w, v, m)
    write_envelopes(w)
    explain_nearest(w, v, m)
    write_contact_times(w)
    write_cues(w, v, m)


@kernel(separate=True)
def refuse(w: Workspace) -> None:
    """Stop all robots for an implausible input, and write its reason."""
    v, m = w.watch, w.motion
    reason, robot = w.header.reason, w.header.robot
    stop_everything(int(reason), v, m)
    grade_robots(w, v, m)
    write_envelopes(w)
    w.header.reason, w.header.robot = reason, robot
