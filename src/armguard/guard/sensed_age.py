"""Age of the cells that a guard knows."""

from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.observe import (
    TIME_GRAIN,
    TIME_SHARE,
    blame_robot,
    now_of,
    unannounced_time,
)
from armguard.guard.sensed import Knowledge
from armguard.guard.watch import Watch
from armguard.kernel import kernel
from armguard.motion.state import Motion

CELLS_STALE, CELLS_AHEAD = int(Reason.CELLS_STALE), int(Reason.CELLS_AHEAD)


@kernel
def cells_are_right(about: Knowledge, v: Watch, m: Motion, out: Header) -> bool:
    """Whether the cells are neither too old for a motion nor later than the cycle."""
    now = now_of(v)
    grain = TIME_GRAIN + TIME_SHARE * abs(now)
    ahead = about.newest - now
    if ahead > unannounced_time(v, m) + grain:
        return blame_robot(CELLS_AHEAD, -1, ahead, out)
    age = now - about.stamp
    if not age <= about.stale + grain:
        return blame_robot(CELLS_STALE, -1, age, out)
    return True
