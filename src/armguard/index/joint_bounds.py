"""Lower bounds of the distance of a link to a primitive, in a box of joint positions.

At the middle of the box the parts of the link are placed, and their distance is
measured. A bound on the displacement of their points within the box is subtracted from
it.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.shapes.kind import ShapeKind
from armguard.index.joint_cells import JointCells
from armguard.index.world import World
from armguard.kernel import kernel
from armguard.robot.kinematics import FIXED, PRISMATIC, place_body
from armguard.table import IntMatrix, IntVector, Matrix, Vector

Floats = NDArray[np.float64]

# Joints of a link that may be divided into more than one cell.
MOST_JOINTS = 4

# Rounding of distances and poses, and what an error of a normal makes of a gap [m].
SLACK = 1e-4

# Half width of a box from which on derivatives say little [rad or m].
LARGE = 0.5

CAPSULE = int(ShapeKind.CAPSULE)


class JointLinks(NamedTuple):
    """Links with their chains and parts. Sizes: l links, j joints of a chain at most.

    Attributes:
        link_of: Link of each primitive, -1 if it has none, shape (p,).
        joints: Places in q of the joints of a link's chain, the first of the chain
            first, -1 after the last, shape (l, j).
        lower: Least positions of the cells, shape (l, j) [rad or m].
        upper: Greatest positions of the cells, shape (l, j) [rad or m].
        period: A turn for joints without limits, else 0, shape (l, j) [rad].
        levers: Largest distance of a point of the link from the axis of each joint; 1
            for prismatic joints, shape (l, j) [m].
        first_body: First body of each link's chain in the arrays from `parent` to
            `axis`, and the end of the last, shape (l + 1,).
        parent: Parent within the chain, see `KinematicTable`, to `axis`.
        joint_kind: Kinds of joints.
        slot: Place of a body's joint in a row of `joints`, -1 if it is fixed.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        first_part: First part of each link, and the end of the last, shape (l + 1,).
        kinds: ShapeKind of each part.
        rows: Its row in the frame of the last body of the chain, shape (k, 16).
        ends: Ends of the axis of a capsule around it, in that frame, shape (k, 6) [m].
        radii: Radius of this capsule, shape (k,) [m].
    """

    link_of: IntVector
    joints: IntMatrix
    lower: Matrix
    upper: Matrix
    period: Matrix
    levers: Matrix
    first_body: IntVector
    parent: IntVector
    joint_kind: IntVector
    slot: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    first_part: IntVector
    kinds: IntVector
    rows: Matrix
    ends: Matrix
    radii: Vector


class Search(NamedTuple):
    """Scratch for the search that fills the table.

    Attributes:
        stack: Lower and upper cells of boxes that wait, and their depth, shape
            (s, 2 · MOST_JOINTS + 1).
        near: Columns of a box at each depth, shape (s, c).
        near_count: Number of them, shape (s,).
        q: Middle of the box, shape (j,).
        half: Half of its width, shape (j,).
        gain: What a division into cells takes off its width, shape (j,).
        T: Poses of a chain, shape (b, 12).
        placed: Rows of parts in the world, shape (k, 16).
        points: Ends of the axis of each part's capsule, shape (k, 6) [m].
        motion: Bound of the displacement of each part's points, shape (k,) [m].
        rates: Velocities of these ends at unit speed of each joint of the chain
            [m/rad]; the half width of a small box, or 0; and how much closer to its
            border the middle of a cell may be [rad], shape (k · b, 8).
        coarse: Part of the bound that `rates` do not cover, shape (k,) [m].
        spare: What a division may take off that part, shape (k,) [m].
        witness: Witness row, shape (10,).
    """

    stack: IntMatrix
    near: IntMatrix
    near_count: IntVector
    q: Vector
    half: Vector
    gain: Vector
    T: Matrix
    placed: Matrix
    points: Matrix
    motion: Vector
    rates: Matrix
    coarse: Vector
    spare: Vector
    witness: Vector


@kernel
def place_box(
    link: int, top: int, links: JointLinks, cells: JointCells, search: Search
) -> int:
    """Place the parts of a link at the middle of a box, and bound their displacements.

    Returns:
        The joint along which the box is to be divided; -1 if it is one cell.
    """
    q, half, T = search.q, search.half, search.T
    split, widest = -1, -1.0
    changed = 0 if search.stack[top, 2 * MOST_JOINTS] == 0 else links.slot.shape[0]
    for s in range(links.joints.shape[1]):
        if links.joints[link, s] < 0:
            break
        lower, upper = links.lower[link, s], links.upper[link, s]
        if s < MOST_JOINTS and cells.counts[link, s] > 1:
            step = (upper - lower) / cells.counts[link, s]
            first, end = search.stack[top, s], search.stack[top, MOST_JOINTS + s]
            middle = lower + 0.5 * step * (first + end)
            if middle != q[s]:
                changed = min(changed, s)
            q[s] = middle
            half[s] = 0.5 * step * (end - first)
            search.gain[s] = step * (end - first - 1)
            if end - first > 1 and half[s] * links.levers[link, s] > widest:
                split, widest = s, half[s] * links.levers[link, s]
        else:
            q[s] = 0.5 * (lower + upper)
            half[s] = 0.5 * (upper - lower)
            search.gain[s] = 0.0
    a, b = links.first_body[link], links.first_body[link + 1]
    same = changed > 0
    for body in range(a, b):
        same = same and links.slot[body] < changed
        if not same:
            place_chain_body(body, a, q, links, T)
    for part in range(links.first_part[link], links.first_part[link + 1]):
        place_row(
            links.kinds[part], links.rows[part], T[b - a - 1], search.placed[part]
        )
        bound_motion(part, a, b, links, search)
    return split


@kernel
def place_chain_body(
    body: int, first: int, q: Floats, links: JointLinks, T: Floats
) -> None:
    """Write the pose of a body of a chain, whose parent has its pose.

    Args:
        body: The body.
        first: First body of the chain.
        q: Positions of the chain's joints, shape (j,).
        links: The links.
        T: Poses of the chain, shape (b, 12).
    """
    position = 0.0
    if links.joint_kind[body] != FIXED:
        position = links.gain[body, 0] * q[links.slot[body]] + links.gain[body, 1]
    place_body(
        body - first,
        position,
        links.parent[first:],
        links.joint_kind[first:],
        links.T_parent_joint[first:],
        links.axis[first:],
        T,
    )


@kernel
def bound_motion(
    part: int, first: int, end: int, links: JointLinks, search: Search
) -> None:
    """Bound the displacement of a part's points from the middle of a box.

    A joint moves a point by at most its angle times the distance from the axis, or
    twice that distance. The distance is that at the middle of the box, and at most as
    much more as the joints behind it move the point. For small angles the derivative is
    kept as well, and the greatest second derivative in the box bounds the remainder.

    Args:
        part: The part.
        first: First body of its chain.
        end: End of its chain.
        links: The links.
        search: Scratch with poses and half widths; what belongs to the part is written.
    """
    T, ends, radius = search.T, links.ends[part], links.radii[part]
    points, rates = search.points[part], search.rates
    last = T[end - first - 1]
    for e in range(2):
        points[3 * e], points[3 * e + 1], points[3 * e + 2] = at(
            last, ends[3 * e], ends[3 * e + 1], ends[3 * e + 2]
        )
    motion = coarse = spare = curve = behind = 0.0
    for body in range(end - 1, first - 1, -1):
        rate = rates[part * T.shape[0] + body - first]
        rate[6] = rate[7] = 0.0
        kind = links.joint_kind[body]
        if kind == FIXED:
            continue
        way = abs(links.gain[body, 0]) * search.half[links.slot[body]]
        lever = chord = 0.0
        across = rate_of(body, T[body - first], points, links, rate)
        if kind == PRISMATIC:
            lever, chord = 1.0, way
        else:
            lever = across + radius + motion
            chord = lever * min(way, 2.0)
        motion += chord
        if way > LARGE:
            coarse += chord
            if search.gain[links.slot[body]] > 0.0:
                spare += chord
        else:
            rate[6] = way
            rate[7] = abs(links.gain[body, 0]) * search.gain[links.slot[body]]
            # Twice for each joint behind it, once for itself.
            curve += way * (0.5 * lever * way + behind)
            behind += lever * way
    search.motion[part] = motion
    search.coarse[part] = coarse + curve
    search.spare[part] = spare + curve


@kernel
def rate_of(
    body: int, F: Floats, points: Floats, links: JointLinks, rate: Floats
) -> float:
    """Write the velocities of two points at unit speed of a joint.

    Args:
        body: Body behind the joint.
        F: Its frame, shape (12,).
        points: The points, shape (6,) [m].
        links: The links.
        rate: Their velocities, overwritten, shape (7,) [m/rad, or 1 if prismatic].

    Returns:
        The greater of both speeds.
    """
    x, y, z = links.axis[body, 0], links.axis[body, 1], links.axis[body, 2]
    ax = F[0] * x + F[1] * y + F[2] * z
    ay = F[4] * x + F[5] * y + F[6] * z
    az = F[8] * x + F[9] * y + F[10] * z
    most2 = 0.0
    for e in range(2):
        if links.joint_kind[body] == PRISMATIC:
            u, v, w = ax, ay, az
        else:
            x = points[3 * e] - F[3]
            y = points[3 * e + 1] - F[7]
            z = points[3 * e + 2] - F[11]
            u, v, w = ay * z - az * y, az * x - ax * z, ax * y - ay * x
        rate[3 * e], rate[3 * e + 1], rate[3 * e + 2] = u, v, w
        most2 = max(most2, u * u + v * v + w * w)
    return sqrt(most2)


@kernel
def at(T: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A point of a frame in the world."""
    return (
        T[0] * x + T[1] * y + T[2] * z + T[3],
        T[4] * x + T[5] * y + T[6] * z + T[7],
        T[8] * x + T[9] * y + T[10] * z + T[11],
    )


@kernel
def bracket(
    link: int, i: int, reach: float, world: World, links: JointLinks, search: Search
) -> tuple[float, float]:
    """Lower bound of the distance of a link to primitive i in a box.

    Returns:
        The bound, and about the greatest that it would be in a cell of the box [m]. The
        first is NaN if a distance is.
    """
    least = best = np.inf
    witness = search.witness
    for part in range(links.first_part[link], links.first_part[link + 1]):
        motion, points = search.motion[part], search.points[part]
        away2 = across2 = 0.0
        for k in range(3):
            x = 0.5 * (points[k] + points[k + 3])
            out = max(world.boxes[i, k] - x, x - world.boxes[i, k + 3], 0.0)
            away2 += out * out
            across2 += (x - points[k]) ** 2
        size = sqrt(across2) + links.radii[part]
        if sqrt(away2) - size - motion > reach + SLACK:
            continue
        kind, other = links.kinds[part], world.kinds[i]
        measure(kind, search.placed[part], other, world.rows[i], witness)
        distance = witness[0]
        if not distance == distance:
            return distance, -np.inf
        first, end = links.first_body[link], links.first_body[link + 1]
        gap, gain = least_gap(part, end - first, links, search)
        bound = max(distance - motion, gap)
        least = min(least, bound)
        best = min(best, bound + gain)
    return least, best


@kernel
def least_gap(
    part: int, bodies: int, links: JointLinks, search: Search
) -> tuple[float, float]:
    """Lower bound of a distance in a box, by the gap along the normal at its middle.

    A point moves along the normal at most by its velocities in that direction times the
    half widths, and the remainder. Between both ends of a part's axis this is at most
    what it is at one of them.

    Args:
        part: The part.
        bodies: Number of bodies of its chain.
        links: The links.
        search: Scratch with the part's bounds and the measured distance.

    Returns:
        The bound, and about how much greater it may be in a cell of the box [m].
    """
    witness, points = search.witness, search.points[part]
    nx, ny, nz = witness[7], witness[8], witness[9]
    ahead0 = nx * points[0] + ny * points[1] + nz * points[2]
    ahead1 = nx * points[3] + ny * points[4] + nz * points[5]
    turns = gain0 = gain1 = 0.0
    # What is no sphere and no capsule has points anywhere within the capsule around it.
    thick = links.kinds[part] > CAPSULE
    gap0 = 0.0 if thick else max(ahead1 - ahead0, 0.0)
    gap1 = 0.0 if thick else max(ahead0 - ahead1, 0.0)
    for body in range(bodies):
        rate = search.rates[part * search.T.shape[0] + body]
        if rate[6] == 0.0:
            continue
        turns += rate[6]
        speed0 = abs(nx * rate[0] + ny * rate[1] + nz * rate[2])
        speed1 = abs(nx * rate[3] + ny * rate[4] + nz * rate[5])
        gap0 -= rate[6] * speed0
        gap1 -= rate[6] * speed1
        gain0 += rate[7] * speed0
        gain1 += rate[7] * speed1
    if thick:
        gap0 -= turns * links.radii[part]
        gap1 -= turns * links.radii[part]
    gap = witness[0] + min(gap0, gap1) - search.coarse[part]
    return gap, max(gain0, gain1) + search.spare[part]
