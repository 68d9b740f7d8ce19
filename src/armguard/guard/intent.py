"""Intent: grasp targets and places to put objects down, inferred from slow motion.

An object is the grasp target of slow fingers near it if the path of the middle between
them leads there, and none of them hits it on that path. A gripper has one target at a
time: another one only when the first keeps its separation without a contract. A held
object is about to be put down on a support if it is slow and approaches it.

The requested velocities are read, not the granted ones: a fast request shows no intent,
however much the guard slows the robot.
"""

from math import inf

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import stack
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, dot, norm, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.contracts import open_contract
from armguard.guard.finger_way import runs_into
from armguard.guard.grips import (
    AIM,
    BODY,
    BY_INTENT,
    COARSE_NOW,
    CREEP,
    DEPTH,
    DORMANT,
    END,
    END_A,
    END_B,
    END_FINGER,
    ENDING,
    EXPIRED,
    EXPIRY,
    FIRST,
    FIRST_A,
    FIRST_B,
    FIRST_FINGER,
    GAIN,
    GRIPPER,
    GROUP,
    GROUP_A,
    GROUP_B,
    HOLDS,
    IN_FORCE,
    INTENDED,
    INTENT_SPEED,
    KIND,
    LIFT,
    NEAR,
    NEAREST,
    NONE,
    NORMAL,
    NOWHERE,
    OBJECT_BODY,
    OBJECT_CREEP,
    OBJECT_DEPTH,
    OBJECT_NEAR,
    POINT,
    REARM,
    REGION,
    SLOT,
    SPEED,
    SPENT_ON,
    STANDING,
    STATE,
    UNTIL,
    Grips,
)
from armguard.guard.near_pairs import boxes_apart
from armguard.guard.observe import now_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import (
    Workspace,
)
from armguard.index.octree_state import ABSENT
from armguard.kernel import kernel
from armguard.motion.nearest import joint_way
from armguard.motion.state import Motion
from armguard.table import Vector

Floats = NDArray[np.float64]

CAPSULE = int(ShapeKind.CAPSULE)

# An object remains the grasp target up to this multiple of the distances [-].
NEAR_AGAIN = 1.25

# An intent starts at no more than this share of the speed that ends it: faster motion
# than declared never starts one [-].
STEADY = 0.95

# Another object replaces the grasp target if its score is lower by this much [m].
NEARER = 0.005

# Weight of the distance from the middle of the fingers, beside that of their path [-].
FROM_MIDDLE = 0.25

# Slower motion than this has no direction [m/s].
STANDS = 1e-4

# Least share of an approach: of the distance from the middle of the fingers to the
# target, by their path; of the speed of an object that is put down [-].
TOWARDS = 0.5


@kernel(separate=True)
def read_intents(u: Vector, w: Workspace) -> None:
    """Open and end contracts by intent, of every gripper and of held objects.

    Args:
        u: Requested or measured joint velocities, shape (n,) [rad/s or m/s].
        w: The workspace, after its pairs were judged.
    """
    v, m = w.watch, w.motion
    h = w.grips
    for g in range(h.grippers.shape[0]):
        read_gripper(g, u, h, w, v, m)
    for k in range(h.contracts.shape[0]):
        if h.contracts[k, KIND] == STANDING:
            read_placing(k, u, h, w, m)


@kernel(inline=False)
def read_gripper(
    g: int, u: Floats, h: Grips, w: Workspace, v: Watch, m: Motion
) -> None:
    """Find the grasp target of a gripper, and open or end its contracts."""
    own = h.grippers[g]
    settle_intended(g, h)
    way = numba.carray(stack(16), (ROW_WIDTH,), np.float64)
    best, least, now_at = -1, inf, inf
    for o in range(h.objects.shape[0]):
        score = score_of(g, o, u, way, h, w, m)
        if score < least:
            best, least = o, score
        if o == own[INTENDED]:
            now_at = score
    intended = own[INTENDED]
    if intended >= 0:
        still = now_at < inf and not least + NEARER < now_at
        for k in range(own[SLOT], own[SLOT] + own[END_FINGER] - own[FIRST_FINGER]):
            state = h.contracts[k, STATE]
            if still and state == ENDING:
                h.contracts[k, STATE] = IN_FORCE
            elif not still and state == IN_FORCE:
                h.contracts[k, STATE] = ENDING
    elif best >= 0:
        mean(g, best, h, v)


@kernel
def settle_intended(g: int, h: Grips) -> None:
    """Clear the grasp target of a gripper once all its contracts are over."""
    own = h.grippers[g]
    if own[INTENDED] < 0:
        return
    over = True
    for k in range(own[SLOT], own[SLOT] + own[END_FINGER] - own[FIRST_FINGER]):
        state = h.contracts[k, STATE]
        if state == EXPIRED:
            own[SPENT_ON] = own[INTENDED]
        over &= state == NONE
    if over:
        own[INTENDED] = -1


@kernel(inline=False)
def score_of(
    g: int, o: int, u: Floats, way: Floats, h: Grips, w: Workspace, m: Motion
) -> float:
    """Score of an object as grasp target, lower is better; infinite if it is none [m].

    Args:
        g: The gripper.
        o: The object.
        u: Velocities of all joints, shape (n,) [rad/s or m/s].
        way: Scratch for a capsule, the path of the middle between the fingers.
        h: Grips; an object with an expired contract is cleared when it is far.
        w: Workspace.
        m: Motion.
    """
    own, thing = h.grippers[g], h.objects[o]
    if own[HOLDS] > 0:
        return inf
    first = int(thing[FIRST])
    if w.octree.residency[first].status == ABSENT or own[COARSE_NOW] != 0:
        return inf
    near, aim, fast = thing[OBJECT_NEAR], thing[AIM], thing[INTENT_SPEED]
    if o == own[INTENDED]:
        near, aim = near * NEAR_AGAIN, aim * NEAR_AGAIN
    else:
        fast *= STEADY
    if not fingers_distance(g, o, near, h, w) <= near:
        if own[SPENT_ON] == o:
            own[SPENT_ON] = -1
        return inf
    if own[SPENT_ON] == o and own[INTENDED] != o:
        return inf
    middle = middle_of(g, h, w)
    other = velocity_of(middle, int(thing[OBJECT_BODY]), u, m)
    for f in range(own[FIRST_FINGER], own[END_FINGER]):
        i = int(h.fingers[f, 0])
        moves = velocity_of(centre_of(i, w), int(w.bodies[i]), u, m)
        if not norm(sub(moves, other)) <= fast:
            return inf
    moves = sub(velocity_of(middle, int(own[BODY]), u, m), other)
    speed = norm(moves)
    ahead = scaled(thing[OBJECT_NEAR] / speed if speed > STANDS else 0.0, moves)
    for k in range(ROW_WIDTH):
        way[k] = 0.0
    for k in range(3):
        way[1 + k] = way[4 + k] = middle[k]
    from_middle = max(row_distance(way, first, int(thing[END]), w), 0.0)
    for k in range(3):
        way[4 + k] = middle[k] + ahead[k]
    beside = max(row_distance(way, first, int(thing[END]), w), 0.0)
    if o == own[INTENDED]:
        # A hand that hardly moves, as while the fingers close, has not turned away.
        turned = not beside <= aim and speed > thing[OBJECT_CREEP]
    else:
        # A path past the object, or away from it, shows no intent.
        approaches = beside <= (1.0 - TOWARDS) * from_middle or not speed > STANDS
        turned = not beside <= aim or not approaches
    if turned:
        return inf
    several = own[END_FINGER] - own[FIRST_FINGER] > 1
    if several and from_middle > 0.0 and speed > thing[OBJECT_CREEP]:
        # The object is not between the fingers yet, and has to get there.
        for f in range(own[FIRST_FINGER], own[END_FINGER]):
            if runs_into(f, o, scaled(1.0 / speed, moves), thing[OBJECT_NEAR], h, w):
                return inf
    return float(beside + FROM_MIDDLE * from_middle)


@kernel(inline=False)
def fingers_distance(g: int, o: int, within: float, h: Grips, w: Workspace) -> float:
    """Distance of a gripper's fingers and an object; infinite beyond `within` [m]."""
    own, thing = h.grippers[g], h.objects[o]
    witness = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    kinds, rows = w.world.kinds, w.world.rows
    least = inf
    for f in range(own[FIRST_FINGER], own[END_FINGER]):
        for i in range(h.fingers[f, 0], h.fingers[f, 1]):
            for j in range(int(thing[FIRST]), int(thing[END])):
                if boxes_apart(w.world.boxes, i, j, within):
                    continue
                measure(kinds[i], rows[i], kinds[j], rows[j], witness)
                least = min(least, witness[0])
    return float(least)


@kernel(inline=False)
def row_distance(row: Floats, first: int, end: int, w: Workspace) -> float:
    """Distance of a capsule and a range of primitives [m]."""
    witness = numba.carray(stack(10), (WITNESS_WIDTH,), np.float64)
    least = inf
    for j in range(first, end):
        measure(
            CAPSULE,
            row,
            w.world.kinds[j],
            w.world.rows[j],
            witness,
        )
        least = min(least, witness[0])
    return float(least)


@kernel
def centre_of(i: int, w: Workspace) -> Vec3:
    """Middle of a primitive's box in the world [m]."""
    box = w.world.boxes[i]
    return (
        0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4]), 0.5 * (box[2] + box[5])
    )  # fmt: skip


@kernel
def middle_of(g: int, h: Grips, w: Workspace) -> Vec3:
    """Middle between a gripper's fingers: the mean of their own middles [m]."""
    own = h.grippers[g]
    x = y = z = 0.0
    for f in range(own[FIRST_FINGER], own[END_FINGER]):
        a, b, c = finger_middle(f, h, w)
        x, y, z = x + a, y + b, z + c
    count = own[END_FINGER] - own[FIRST_FINGER]
    return (x / count, y / count, z / count)


@kernel
def finger_middle(f: int, h: Grips, w: Workspace) -> Vec3:
    """Middle of a finger's primitives [m]."""
    x = y = z = 0.0
    for i in range(h.fingers[f, 0], h.fingers[f, 1]):
        a, b, c = centre_of(i, w)
        x, y, z = x + a, y + b, z + c
    count = h.fingers[f, 1] - h.fingers[f, 0]
    return (x / count, y / count, z / count)


@kernel
def velocity_of(p: Vec3, body: int, u: Floats, m: Motion) -> Vec3:
    """Velocity of a body's point for given joint velocities [m/s]."""
    x = y = z = 0.0
    for k in range(m.length[body]):
        b = m.joints[body, k]
        way = joint_way(p, b, m.axes[b], m)
        speed = m.gain[b, 0] * u[m.q_index[b]]
        x, y, z = x + speed * way[0], y + speed * way[1], z + speed * way[2]
    return (x, y, z)


@kernel
def mean(g: int, o: int, h: Grips, v: Watch) -> None:
    """Make an object the grasp target: open contracts between each finger and it."""
    own, thing = h.grippers[g], h.objects[o]
    own[INTENDED] = o
    now = now_of(v)
    for f in range(own[FIRST_FINGER], own[END_FINGER]):
        k = int(own[SLOT] + f - own[FIRST_FINGER])
        c = h.contracts[k]
        c[KIND], c[GRIPPER] = BY_INTENT, g
        c[FIRST_A], c[END_A] = h.fingers[f, 0], h.fingers[f, 1]
        c[FIRST_B], c[END_B] = thing[FIRST], thing[END]
        c[GROUP_A], c[GROUP_B] = h.fingers[f, 2], thing[GROUP]
        c[DEPTH], c[CREEP] = thing[OBJECT_DEPTH], thing[OBJECT_CREEP]
        c[NEAR], c[SPEED] = thing[OBJECT_NEAR], thing[INTENT_SPEED]
        c[GAIN] = (c[SPEED] - c[CREEP]) / c[NEAR]
        c[UNTIL], c[REARM] = now + thing[EXPIRY], inf
        c[REGION] = NOWHERE
        open_contract(k, h)


@kernel
def read_placing(k: int, u: Floats, h: Grips, w: Workspace, m: Motion) -> None:
    """Put a held object's contract with a support in force, or end it."""
    c = h.contracts[k]
    if c[STATE] == DORMANT and approaches_slowly(c, False, u, w, m):
        # The contract ends when the object has lifted clear again.
        c[REARM] = NEAR_AGAIN * c[NEAR]
        open_contract(k, h)
    elif c[STATE] == IN_FORCE and c[REARM] > c[NEAR]:
        if c[NEAREST] <= 0.0:
            c[REARM] = c[LIFT]
        elif not approaches_slowly(c, True, u, w, m):
            c[STATE] = ENDING


@kernel
def approaches_slowly(
    c: Floats, again: bool, u: Floats, w: Workspace, m: Motion
) -> bool:
    """Whether a held object is near a support, slow, and approaching it.

    Args:
        c: Their contract; the object is its body A.
        again: The approach was found before; the object may now move away.
        u: Velocities of all joints, shape (n,) [rad/s or m/s].
        w: Workspace.
        m: Motion.
    """
    if not c[NEAREST] <= c[NEAR]:
        return again
    a, b = int(c[FIRST_A]), int(c[FIRST_B])
    point = (c[POINT], c[POINT + 1], c[POINT + 2])
    moves = velocity_of(point, int(w.bodies[a]), u, m)
    if b < m.rate.shape[0]:
        moves = sub(moves, velocity_of(point, int(w.bodies[b]), u, m))
    speed = norm(moves)
    if again:
        return bool(speed <= c[SPEED])
    if not speed <= STEADY * c[SPEED]:
        return False
    n = (c[NORMAL], c[NORMAL + 1], c[NORMAL + 2])
    return bool(dot(n, moves) >= TOWARDS * speed and speed > STANDS)
