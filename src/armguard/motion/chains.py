"""Kinematic chains of bodies, and levers of primitives about the joints' axes.

A point of a link moves at most Σ |Δq| · R over the joints between it and the base. The
lever R is the largest distance of the point from the joint's axis. There is one for
each primitive and each joint of its chain; it holds in every configuration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ShapeKind
from armguard.motion.outermost import true_limits
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Anchor(NamedTuple):
    """Capsule round a primitive, in the frame of its body.

    Attributes:
        start: First end of its axis, shape (3,) [m].
        end: Other end of its axis, shape (3,) [m].
        radius: Radius; infinite for a half-space [m].
    """

    start: Floats
    end: Floats
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Chains:
    """Kinematic chains of bodies, and levers of primitives.

    Attributes:
        joints: Bodies with a joint from the root to each body, itself included, -1
            after the end of the chain, shape (b, depth).
        length: Number of joints of each body's chain, shape (b,).
        shared: Number of joints that two chains share from the root, shape (b, b).
        levers: Largest distance of a primitive's points from the axis of each joint of
            its chain; 1 for prismatic joints, shape (m, depth) [m].
    """

    joints: Ints
    length: Ints
    shared: Ints
    levers: Floats


def chains(tables: SceneTables) -> Chains:
    """Chains of a scene's bodies, and levers of its moving primitives."""
    m, parent, joint_kind = tables.moving_count, tables.parent, tables.joint_kind
    lower, upper = true_limits(tables)
    above: list[list[int]] = []
    for body in range(len(parent)):
        own = [body] if joint_kind[body] != FIXED else []
        above.append([*(above[parent[body]] if parent[body] >= 0 else []), *own])
    depth = max((len(chain) for chain in above), default=0)
    joints = np.full((len(parent), max(depth, 1)), -1, dtype=np.int32)
    for body, chain in enumerate(above):
        joints[body, : len(chain)] = chain
    levers = np.zeros((m, max(depth, 1)))
    for i, body in enumerate(tables.bodies[:m]):
        chain = above[body]
        levers[i, : len(chain)] = primitive_levers(
            anchor(int(tables.kinds[i]), tables.local_rows[i]),
            chain,
            joint_kind,
            tables.T_parent_joint,
            tables.axis,
            strokes(chain, joint_kind, tables.gain, tables.q_index, lower, upper),
        )
    return Chains(
        joints=joints,
        length=np.array([len(chain) for chain in above], dtype=np.int32),
        shared=shared_lengths(above),
        levers=levers,
    )


def shared_lengths(above: Sequence[Sequence[int]]) -> Ints:
    """Number of joints that the chains of two bodies share from the root, (b, b)."""
    shared = np.zeros((len(above), len(above)), dtype=np.int32)
    for a, one in enumerate(above):
        for b, other in enumerate(above):
            count = 0
            for x, y in zip(one, other, strict=False):
                if x != y:
                    break
                count += 1
            shared[a, b] = count
    return shared


def strokes(
    chain: Sequence[int],
    joint_kind: Ints,
    gain: Floats,
    q_index: Ints,
    lower: Floats,
    upper: Floats,
) -> list[float]:
    """Greatest shift of its frame by each joint of a chain; 0 if revolute [m]."""
    found = []
    for body in chain:
        if joint_kind[body] != PRISMATIC:
            found.append(0.0)
            continue
        multiplier, offset = gain[body]
        ends = multiplier * np.array([lower[q_index[body]], upper[q_index[body]]])
        found.append(float(np.abs(ends + offset).max()))
    return found


def primitive_levers(
    capsule: Anchor,
    chain: Sequence[int],
    joint_kind: Ints,
    T_parent_joint: Floats,
    axis: Floats,
    stroke: Sequence[float],
) -> list[float]:
    """Levers of one primitive about the joints of its chain, from the root on [m].

    The distance from the axis of its own body's joint does not depend on the
    configuration. For a joint further up the offset of the next joint's frame is fixed,
    and the rest of the chain may point in any direction.
    """
    ends, radius = np.array([capsule.start, capsule.end]), capsule.radius
    levers: list[float] = []
    beyond = 0.0
    for place in range(len(chain) - 1, -1, -1):
        body = chain[place]
        if place == len(chain) - 1:
            across = max(off_axis(end, axis[body]) for end in ends) + radius
            beyond = float(np.linalg.norm(ends, axis=1).max()) + radius
        else:
            offset = T_parent_joint[chain[place + 1], [3, 7, 11]]
            shift = stroke[place + 1]
            across = off_axis(offset, axis[body]) + shift + beyond
            beyond = float(np.linalg.norm(offset)) + shift + beyond
        levers.append(1.0 if joint_kind[body] == PRISMATIC else across)
    return levers[::-1]


def off_axis(point: Floats, axis: Floats) -> float:
    """Distance of a point from an axis through the origin [m]."""
    return float(np.linalg.norm(point - axis * float(point @ axis)))


def anchor(kind: int, row: Floats) -> Anchor:
    """Capsule that contains a primitive."""
    radius, origin = float(row[0]), row[1:4]
    if kind == ShapeKind.SPHERE:
        return Anchor(origin, origin, radius)
    if kind == ShapeKind.CAPSULE:
        return Anchor(origin, row[4:7], radius)
    if kind == ShapeKind.HALF_SPACE:
        return Anchor(origin, origin, np.inf)
    if kind == ShapeKind.TRIANGLE:
        corners = row[1:10].reshape(3, 3)
        middle = corners.mean(axis=0)
        reach = float(np.linalg.norm(corners - middle, axis=1).max())
        return Anchor(middle, middle, radius + reach)
    R = row[7:16].reshape(3, 3)
    if kind in (ShapeKind.BOX, ShapeKind.ELLIPSOID):
        half = row[4:7]
        long = int(np.argmax(half))
        others = np.delete(half, long)
        across = np.hypot(*others) if kind == ShapeKind.BOX else others.max()
        along = half[long] * R[:, long]
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        across = max(row[4], row[6])
        along = row[5] * R[:, 2]
    else:
        # A hull or a shape by its support function: a ball about its origin.
        across = row[6]
        along = np.zeros(3)
    return Anchor(origin - along, origin + along, radius + float(across))
