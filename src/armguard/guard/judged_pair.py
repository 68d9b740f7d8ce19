"""One pair of a cycle with predicted stops: measurement and proof."""

from armguard.guard.change import NO_ROW, note_pair
from armguard.guard.demands import judge_motion
from armguard.guard.layout import NearRow, normal_of
from armguard.guard.near_pairs import measures_row, open_row
from armguard.guard.needs import LOOK_AHEAD
from armguard.guard.refine import refine_pair
from armguard.guard.search_distance import hidden_by_error
from armguard.guard.watch import HYSTERESIS
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.pair_proof import shared_joints
from armguard.motion.twist_bound import SPEED, TRAVEL, bound_along


@kernel(separate=True)
def judge_pair(
    i: int, j: int, need: float, look: float, known: float, count: int, w: Workspace
) -> int:
    """Measure a pair and prove it, if it may matter; write its row, if it is near.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
        look: Distance beyond which the pair does not matter [m].
        known: Lower bound of its distance during the stops [m].
        count: Count of rows of the answer.
        w: The workspace.

    Returns:
        New count of rows.
    """
    if not measures_row(i, j, look, count, w):
        return count
    v, near = w.watch, w.near[count]
    distance = near.distance
    if distance > w.settings.margin and is_far_along(i, j, need, known, near, w):
        return count
    open_row(i, j, near, w)
    if not distance - w.buffers[w.groups[i], w.groups[j]] >= 0.0:
        # Links may be farther apart than the primitives that enclose them.
        refine_pair(i, j, near, w)
    judge_motion(i, j, near, w)
    if (
        distance > w.settings.margin
        and near.headroom >= hidden_by_error(i, j, w, v)
        and near.time_left >= HYSTERESIS * v.timing.slow_time
    ):
        note_pair(i, j, NO_ROW, near, w, v)
        return count
    note_pair(i, j, count, near, w, v)
    return count + 1


@kernel
def is_far_along(
    i: int, j: int, need: float, known: float, near: NearRow, w: Workspace
) -> bool:
    """Whether a measured pair cannot matter by its motion along the normal.

    Args:
        i: Lower primitive.
        j: Higher primitive.
        need: Static need of the pair, inf if it has to be proven in full [m].
        known: Lower bound of its distance during the stops [m].
        near: The pair's row; its witness is written already.
        w: The workspace.
    """
    v, m = w.watch, w.motion
    kept = need + v.ahead[i]
    body_i, body_j = w.bodies[i], -1
    if j < m.rate.shape[0]:
        body_j = w.bodies[j]
        kept += v.ahead[j]
    if not near.distance > kept or v.tight[i] == 0 or (body_j >= 0 and v.tight[j] == 0):
        return False
    n = normal_of(near)
    shared = shared_joints(body_i, body_j, m)
    speed = bound_along(SPEED, n, i, j, body_i, body_j, shared, m)
    kept += max(LOOK_AHEAD * v.timing.slow_time * speed, hidden_by_error(i, j, w, v))
    if known >= kept:
        return True
    travel = bound_along(TRAVEL, n, i, j, body_i, body_j, shared, m)
    return bool(near.distance - travel >= kept)
