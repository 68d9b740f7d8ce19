"""Joint positions to poses of bodies: flat tables and the kernel."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.robot.model import Joint, JointKind, RobotModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# joint_kind of a body.
FIXED = 0
REVOLUTE = 1
PRISMATIC = 2

KIND_NUMBER = {
    JointKind.FIXED: FIXED,
    JointKind.REVOLUTE: REVOLUTE,
    JointKind.CONTINUOUS: REVOLUTE,
    JointKind.PRISMATIC: PRISMATIC,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicTable:
    """Bodies of one robot or several, a parent always before its children.

    Links that fixed joints hold together are one body; a robot's first body is its
    root.

    Attributes:
        parent: Parent body, -1 for a root, shape (b,).
        joint_kind: FIXED, REVOLUTE or PRISMATIC, shape (b,).
        q_index: Place in q that moves the body, -1 if none, shape (b,).
        gain: Multiplier and offset of that position, shape (b, 2).
        T_parent_joint: Joint frame in the parent body's, rows of [R | p], (b, 12).
        axis: Unit joint axis, shape (b, 3).
        body_of_link: Body of each link.
        T_body_link: Each link's frame in its body's, shape (4, 4).
        q_count: Places of q.
    """

    parent: Ints
    joint_kind: Ints
    q_index: Ints
    gain: Floats
    T_parent_joint: Floats
    axis: Floats
    body_of_link: Mapping[str, int]
    T_body_link: Mapping[str, Floats]
    q_count: int


def kinematic_table(model: RobotModel) -> KinematicTable:
    """Flat table of a robot whose root frame is the world."""
    q_names = model.q_names
    children: dict[str, list[Joint]] = {}
    for joint in model.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    body_of_link = {model.root: 0}
    T_body_link: dict[str, Floats] = {model.root: np.eye(4)}
    parent, kinds, q_index = [-1], [FIXED], [-1]
    gain, frames, axes = [(1.0, 0.0)], [np.eye(4)], [np.array([1.0, 0.0, 0.0])]
    stack = [model.root]
    while stack:
        link = stack.pop()
        body = body_of_link[link]
        for joint in reversed(children.get(link, [])):
            T_body_joint = T_body_link[link] @ joint.T_parent_joint
            stack.append(joint.child)
            if joint.kind is JointKind.FIXED:
                body_of_link[joint.child] = body
                T_body_link[joint.child] = T_body_joint
                continue
            body_of_link[joint.child] = len(parent)
            T_body_link[joint.child] = np.eye(4)
            mimic = joint.mimic
            parent.append(body)
            kinds.append(KIND_NUMBER[joint.kind])
            q_index.append(q_names.index(mimic.joint if mimic else joint.name))
            gain.append((mimic.multiplier, mimic.offset) if mimic else (1.0, 0.0))
            frames.append(T_body_joint)
            axes.append(joint.axis)
    return KinematicTable(
        parent=np.array(parent, dtype=np.int32),
        joint_kind=np.array(kinds, dtype=np.int32),
        q_index=np.array(q_index, dtype=np.int32),
        gain=np.array(gain, dtype=np.float64),
        T_parent_joint=np.array([T[:3].reshape(12) for T in frames]),
        axis=np.array(axes, dtype=np.float64),
        body_of_link=body_of_link,
        T_body_link=T_body_link,
        q_count=len(q_names),
    )


def concatenate(
    tables: Sequence[KinematicTable], bases: Sequence[Floats]
) -> KinematicTable:
    """One table of several robots, each root at its base.

    Args:
        tables: Robots.
        bases: Their bases in the world, each shape (4, 4).

    Returns:
        The joined table; the links keep no names, since robots may share them.
    """
    bodies = np.cumsum([0, *(len(t.parent) for t in tables)])
    places = np.cumsum([0, *(t.q_count for t in tables)])
    frames = []
    for table, base in zip(tables, bases, strict=True):
        own = table.T_parent_joint.copy()
        own[0] = base[:3].reshape(12)
        frames.append(own)
    return KinematicTable(
        parent=np.concatenate(
            [
                np.where(t.parent >= 0, t.parent + first, -1)
                for t, first in zip(tables, bodies, strict=False)
            ]
        ).astype(np.int32),
        joint_kind=np.concatenate([t.joint_kind for t in tables]),
        q_index=np.concatenate(
            [
                np.where(t.q_index >= 0, t.q_index + first, -1)
                for t, first in zip(tables, places, strict=False)
            ]
        ).astype(np.int32),
        gain=np.concatenate([t.gain for t in tables]),
        T_parent_joint=np.concatenate(frames),
        axis=np.concatenate([t.axis for t in tables]),
        body_of_link={},
        T_body_link={},
        q_count=int(places[-1]),
    )


def reach_bounds(
    table: KinematicTable, lower: Floats, upper: Floats
) -> NDArray[np.float64]:
    """Radius about the robot's root within which each body's frame stays [m].

    The sum of the offsets along the chain and of the strokes of prismatic joints:
    never too small, whatever the positions within limits.

    Args:
        table: One robot.
        lower: Least joint positions, shape (n,).
        upper: Greatest joint positions, shape (n,).

    Returns:
        Radii, shape (b,) [m].
    """
    radii = np.zeros(len(table.parent))
    for body in range(1, len(radii)):
        offset = table.T_parent_joint[body, [3, 7, 11]]
        stroke = 0.0
        if table.joint_kind[body] == PRISMATIC:
            multiplier, constant = table.gain[body]
            q = table.q_index[body]
            ends = multiplier * np.array([lower[q], upper[q]]) + constant
            stroke = float(np.abs(ends).max())
        radii[body] = radii[table.parent[body]] + np.linalg.norm(offset) + stroke
    return radii


@kernel(entry=True)
def forward_kinematics(
    q: Floats,
    parent: Ints,
    joint_kind: Ints,
    q_index: Ints,
    gain: Floats,
    T_parent_joint: Floats,
    axis: Floats,
    T_world: Floats,
) -> None:
    """Poses of all bodies; a function of q alone.

    Args:
        q: Joint positions, shape (n,) [rad or m].
        parent: See `KinematicTable`, from here to `axis`.
        joint_kind: Joint kinds.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        T_world: Poses, rows of [R | p], overwritten, shape (b, 12).
    """
    for body in range(parent.shape[0]):
        position = 0.0
        if joint_kind[body] != FIXED:
            position = gain[body, 0] * q[q_index[body]] + gain[body, 1]
        place_body(body, position, parent, joint_kind, T_parent_joint, axis, T_world)


@kernel
def place_body(
    body: int,
    position: float,
    parent: Ints,
    joint_kind: Ints,
    T_parent_joint: Floats,
    axis: Floats,
    T_world: Floats,
) -> None:
    """Write the pose of one body, whose parent has its pose.

    Args:
        body: The body.
        position: Position of its joint [rad or m].
        parent: See `forward_kinematics`, from here on.
        joint_kind: Joint kinds.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        T_world: Poses; that of the body is overwritten.
    """
    frame, out = T_parent_joint[body], T_world[body]
    up = parent[body]
    if up < 0:
        for k in range(12):
            out[k] = frame[k]
    else:
        compose(T_world[up], frame, out)
    kind = joint_kind[body]
    if kind == FIXED:
        return
    x, y, z = axis[body, 0], axis[body, 1], axis[body, 2]
    if kind == PRISMATIC:
        for r in range(3):
            out[4 * r + 3] += position * (
                out[4 * r] * x + out[4 * r + 1] * y + out[4 * r + 2] * z
            )
    else:
        turn(out, x, y, z, sin(position), cos(position))


@kernel
def compose(a: Floats, b: Floats, out: Floats) -> None:
    """Write a · b for two transforms of shape (12,)."""
    for r in range(3):
        x, y, z = a[4 * r], a[4 * r + 1], a[4 * r + 2]
        for k in range(4):
            out[4 * r + k] = x * b[k] + y * b[4 + k] + z * b[8 + k]
        out[4 * r + 3] += a[4 * r + 3]


@kernel
def turn(T: Floats, x: float, y: float, z: float, s: float, c: float) -> None:
    """Turn a frame about one of its own axes, by Rodrigues' formula, in place.

    Args:
        T: Transform, shape (12,), its rotation is replaced.
        x: Unit axis.
        y: Unit axis.
        z: Unit axis.
        s: Sine of the angle.
        c: Cosine of the angle.
    """
    v = 1.0 - c
    xx, xy, xz = v * x * x + c, v * x * y, v * x * z
    yy, yz, zz = v * y * y + c, v * y * z, v * z * z + c
    sx, sy, sz = s * x, s * y, s * z
    for r in range(3):
        a, b, d = T[4 * r], T[4 * r + 1], T[4 * r + 2]
        T[4 * r] = a * xx + b * (xy + sz) + d * (xz - sy)
        T[4 * r + 1] = a * (xy - sz) + b * yy + d * (yz + sx)
        T[4 * r + 2] = a * (xz + sy) + b * (yz - sx) + d * zz
