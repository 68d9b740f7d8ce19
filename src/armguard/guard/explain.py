"""Required separation of the nearest pair, split by cause."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.vec3 import Vec3, dot, scaled
from armguard.guard.layout import TERM_NAMES, normal_of, point_of
from armguard.guard.needs import object_speed, robot_of, static_need
from armguard.guard.proofs import OF_EXACT, OF_PRIMITIVES
from armguard.guard.refine import refine_pair
from armguard.guard.static_errors import BETWEEN_ROBOTS, STATIC_ERRORS
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.motion.joint_stop import whole_way
from armguard.motion.nearest import joint_way
from armguard.motion.pair_proof import shared_joints
from armguard.motion.state import NEXT, Motion
from armguard.motion.stop_path import error_of

Floats = NDArray[np.float64]

# Places of the terms, in the order of the fields of `Budget`.
TERM_FLOOR = TERM_NAMES.index("floor")
TERM_STATIC = TERM_NAMES.index(STATIC_ERRORS[0].term)
TERM_OBJECT = TERM_NAMES.index("object")
TERM_ERROR = TERM_NAMES.index("error")
TERM_REACTION_A = TERM_NAMES.index("reaction_a")
TERM_STOPPING_A = TERM_NAMES.index("stopping_a")
TERM_REACTION_B = TERM_NAMES.index("reaction_b")
TERM_STOPPING_B = TERM_NAMES.index("stopping_b")
TERM_ENVELOPE = TERM_NAMES.index("envelope")
TERM_PATH = TERM_NAMES.index("path")
TERM_NEEDED = TERM_NAMES.index("needed")


@kernel(separate=True)
def write_envelopes(w: Workspace) -> None:
    """Write the envelope term of every near pair: reported minus judged distance.

    The reported distance is that of the shapes which are farther apart. A pair that was
    proven by exact shapes is measured by these, so its distance, its need and its
    headroom are of the same shapes. Where the primitives were judged, the need
    contains their overreach beyond the exact shapes. Rows with a term are left alone.

    Args:
        w: The workspace.
    """
    out = w.header
    for k in range(int(out.near_count)):
        near = w.near[k]
        judged = near.envelope
        if judged == OF_PRIMITIVES:
            near.envelope = near.distance - near.outer
        elif judged == OF_EXACT:
            if near.exact == np.inf:
                i, j = int(near.first), int(near.second)
                refine_pair(i, j, near, w)
            near.envelope = near.distance - near.exact


@kernel
def explain_nearest(w: Workspace, v: Watch, m: Motion) -> None:
    """Write the terms of the nearest pair's required separation; they add up to it.

    Each joint's part is its displacement of the witness point towards the other side.
    A separate term is what the curvature of the path adds to that, or the common time
    of both stops saves; another one is the envelope.
    """
    out = w.header
    if out.nearest < 0.0:
        return
    near = w.near[int(out.nearest)]
    i, j = int(near.first), int(near.second)
    terms = out.terms
    for k in range(terms.shape[0]):
        terms[k] = 0.0
    robot_i, robot_j = robot_of(i, v), robot_of(j, v)
    terms[TERM_FLOOR] = near.buffer
    known = terms[TERM_FLOOR]
    for k in range(v.static_error.shape[0]):
        if robot_i != robot_j or not BETWEEN_ROBOTS[k]:
            error = v.static_error[k, i]
            error += v.static_error[k, j] if robot_j >= 0 else 0.0
            terms[TERM_STATIC + k] = error
            known += error
    seen = static_need(i, j, w, v, m) - known
    terms[TERM_OBJECT] = seen + object_speed(j, v) * m.span.settled
    n = normal_of(near)
    body_i, body_j = w.bodies[i], w.bodies[j]
    first = shared_joints(body_i, body_j, m)
    point = point_of(near, 0)
    add_side(body_i, first, point, n, TERM_REACTION_A, TERM_STOPPING_A, terms, m)
    point = point_of(near, 1)
    n = scaled(-1.0, n)
    add_side(body_j, first, point, n, TERM_REACTION_B, TERM_STOPPING_B, terms, m)
    terms[TERM_ENVELOPE] = near.envelope
    terms[TERM_NEEDED] = near.distance - near.headroom
    total = 0.0
    for k in range(TERM_PATH):
        total += terms[k]
    terms[TERM_PATH] = terms[TERM_NEEDED] - total


@kernel
def add_side(
    body: int,
    first: int,
    point: Vec3,
    n: Vec3,
    reaction: int,
    stopping: int,
    terms: Floats,
    m: Motion,
) -> None:
    """Add the displacement of a point along n by the joints of a body, by cause."""
    joints = m.q.shape[0]
    for k in range(first, m.length[body] if body >= 0 else 0):
        b = m.joints[body, k]
        j = m.q_index[b]
        g = m.gain[b, 0] * dot(n, joint_way(point, b, m.axes[b], m))
        stop = m.up[NEXT * joints + j] if g >= 0.0 else m.down[NEXT * joints + j]
        size = abs(g)
        terms[TERM_ERROR] += size * error_of(j, m)
        terms[reaction] += size * stop.effect_way
        terms[stopping] += size * (whole_way(stop) - stop.effect_way)
