"""Intent: grasp targets and places to put objects down, inferred from slow motion.

An object is the grasp target of slow fingers near it if the path of the middle between
them leads there, and none of them hits it on that path. A gripper has one target at a
time: another one only when the first keeps its separation without a contract. A held
object is about to be put down on a support if it is slow and approaches it.

The requested velocities are read, not the granted ones: a fast request shows no intent,
however much the guard slows the robot.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.vec3 import Vec3, dot, norm, scaled, sub
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.contracts import open_contract
from armguard.guard.finger_way import runs_into
from armguard.guard.grips import (
    ANYWHERE,
    ContractKind,
    ContractRow,
    ContractState,
    Grips,
)
from armguard.guard.near_pairs import boxes_apart
from armguard.guard.observe import now_of
from armguard.guard.watch import Watch
from armguard.guard.workspace import Workspace
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
DIRECTED_SPEED = 1e-4

# Least share of an approach: of the distance from the middle of the fingers to the
# target, by their path; of the speed of an object that is put down [-].
TOWARDS = 0.5


@kernel(separate=True, optional=True)
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
        if h.contracts[k].kind == ContractKind.SUPPORT:
            read_placing(k, u, h, w, m)


@kernel(inline=False)
def read_gripper(
    g: int, u: Floats, h: Grips, w: Workspace, v: Watch, m: Motion
) -> None:
    """Find the grasp target of a gripper, and open or end its contracts."""
    own = h.grippers[g]
    settle_intended(g, h)
    way = array_at(stack(16), (ROW_WIDTH,), np.float64)
    best, least, now_at = -1, inf, inf
    for o in range(h.objects.shape[0]):
        score = score_of(g, o, u, way, h, w, m)
        if score < least:
            best, least = o, score
        if o == own.target:
            now_at = score
    if own.target >= 0:
        still = now_at < inf and not least + NEARER < now_at
        for k in range(own.first_finger, own.end_finger):
            state = h.contracts[k].state
            if still and state == ContractState.ENDING:
                h.contracts[k].state = ContractState.IN_FORCE
            elif not still and state == ContractState.IN_FORCE:
                h.contracts[k].state = ContractState.ENDING
    elif best >= 0:
        set_target(g, best, h, v)


@kernel
def settle_intended(g: int, h: Grips) -> None:
    """Clear the grasp target of a gripper once all its contracts are over."""
    own = h.grippers[g]
    if own.target < 0:
        return
    over = True
    for k in range(own.first_finger, own.end_finger):
        state = h.contracts[k].state
        if state == ContractState.EXPIRED:
            own.expired_target = own.target
        over &= state == ContractState.NONE
    if over:
        own.target = -1


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
    own, item = h.grippers[g], h.objects[o]
    if own.held_count > 0:
        return inf
    first = item.first
    if w.octree.residency[first].status == ABSENT or own.coarse != 0:
        return inf
    near, aim, fast = item.near, item.aim, item.intent_speed
    if o == own.target:
        near, aim = near * NEAR_AGAIN, aim * NEAR_AGAIN
    else:
        fast *= STEADY
    if not fingers_distance(g, o, near, h, w) <= near:
        if own.expired_target == o:
            own.expired_target = -1
        return inf
    if own.expired_target == o and own.target != o:
        return inf
    middle = middle_of(g, h, w)
    other = velocity_of(middle, item.body, u, m)
    for f in range(own.first_finger, own.end_finger):
        i = h.fingers[f].first
        moves = velocity_of(centre_of(i, w), int(w.bodies[i]), u, m)
        if not norm(sub(moves, other)) <= fast:
            return inf
    moves = sub(velocity_of(middle, own.body, u, m), other)
    speed = norm(moves)
    ahead = scaled(item.near / speed if speed > DIRECTED_SPEED else 0.0, moves)
    for k in range(ROW_WIDTH):
        way[k] = 0.0
    for k in range(3):
        way[1 + k] = way[4 + k] = middle[k]
    from_middle = max(row_distance(way, first, item.end, w), 0.0)
    for k in range(3):
        way[4 + k] = middle[k] + ahead[k]
    beside = max(row_distance(way, first, item.end, w), 0.0)
    if o == own.target:
        # A hand that hardly moves, as while the fingers close, has not turned away.
        turned = not beside <= aim and speed > item.creep
    else:
        # A path past the object, or away from it, shows no intent.
        approaches = (
            beside <= (1.0 - TOWARDS) * from_middle or not speed > DIRECTED_SPEED
        )
        turned = not beside <= aim or not approaches
    if turned:
        return inf
    several = own.end_finger - own.first_finger > 1
    if several and from_middle > 0.0 and speed > item.creep:
        # The object is not between the fingers yet, and has to get there.
        for f in range(own.first_finger, own.end_finger):
            if runs_into(f, o, scaled(1.0 / speed, moves), item.near, h, w):
                return inf
    return float(beside + FROM_MIDDLE * from_middle)


@kernel(inline=False)
def fingers_distance(g: int, o: int, within: float, h: Grips, w: Workspace) -> float:
    """Distance of a gripper's fingers and an object; infinite beyond `within` [m]."""
    own, item = h.grippers[g], h.objects[o]
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
    kinds, rows = w.world.kinds, w.world.rows
    least = inf
    for f in range(own.first_finger, own.end_finger):
        for i in range(h.fingers[f].first, h.fingers[f].end):
            for j in range(item.first, item.end):
                if boxes_apart(w.world.boxes, i, j, within):
                    continue
                measure(kinds[i], rows[i], kinds[j], rows[j], witness)
                least = min(least, witness[0])
    return float(least)


@kernel(inline=False)
def row_distance(row: Floats, first: int, end: int, w: Workspace) -> float:
    """Distance of a capsule and a range of primitives [m]."""
    witness = array_at(stack(10), (WITNESS_WIDTH,), np.float64)
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
    for f in range(own.first_finger, own.end_finger):
        a, b, c = finger_middle(f, h, w)
        x, y, z = x + a, y + b, z + c
    count = own.end_finger - own.first_finger
    return (x / count, y / count, z / count)


@kernel
def finger_middle(f: int, h: Grips, w: Workspace) -> Vec3:
    """Middle of a finger's primitives [m]."""
    x = y = z = 0.0
    for i in range(h.fingers[f].first, h.fingers[f].end):
        a, b, c = centre_of(i, w)
        x, y, z = x + a, y + b, z + c
    count = h.fingers[f].end - h.fingers[f].first
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
def set_target(g: int, o: int, h: Grips, v: Watch) -> None:
    """Make an object the grasp target: open contracts between each finger and it."""
    own, item = h.grippers[g], h.objects[o]
    own.target = o
    now = now_of(v)
    for f in range(own.first_finger, own.end_finger):
        c = h.contracts[f]
        c.kind, c.gripper = ContractKind.INTENT, g
        c.first_a, c.end_a = h.fingers[f].first, h.fingers[f].end
        c.first_b, c.end_b = item.first, item.end
        c.group_a, c.group_b = h.fingers[f].group, item.group
        c.depth, c.creep = item.depth, item.creep
        c.near, c.speed = item.near, item.intent_speed
        c.gain = (c.speed - c.creep) / c.near
        c.until, c.end_distance = now + item.expiry, inf
        c.region = ANYWHERE
        open_contract(f, h)


@kernel
def read_placing(k: int, u: Floats, h: Grips, w: Workspace, m: Motion) -> None:
    """Put a held object's contract with a support in force, or end it."""
    c = h.contracts[k]
    if c.state == ContractState.DORMANT and approaches_slowly(c, False, u, w, m):
        # The contract ends when the object has lifted clear again.
        c.end_distance = NEAR_AGAIN * c.near
        open_contract(k, h)
    elif c.state == ContractState.IN_FORCE and c.end_distance > c.near:
        if c.nearest <= 0.0:
            c.end_distance = c.lift
        elif not approaches_slowly(c, True, u, w, m):
            c.state = ContractState.ENDING


@kernel
def approaches_slowly(
    c: ContractRow, again: bool, u: Floats, w: Workspace, m: Motion
) -> bool:
    """Whether a held object is near a support, slow, and approaching it.

    Args:
        c: Their contract; the object is its body A.
        again: The approach was found before; the object may now move away.
        u: Velocities of all joints, shape (n,) [rad/s or m/s].
        w: Workspace.
        m: Motion.
    """
    if not c.nearest <= c.near:
        return again
    a, b = c.first_a, c.first_b
    point = (c.point[0], c.point[1], c.point[2])
    moves = velocity_of(point, int(w.bodies[a]), u, m)
    if b < m.rate.shape[0]:
        moves = sub(moves, velocity_of(point, int(w.bodies[b]), u, m))
    speed = norm(moves)
    if again:
        return bool(speed <= c.speed)
    if not speed <= STEADY * c.speed:
        return False
    n = (c.normal[0], c.normal[1], c.normal[2])
    return bool(dot(n, moves) >= TOWARDS * speed and speed > DIRECTED_SPEED)
