"""Attachment of held objects: tables that make a body a child of a gripper's body."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.grips import Grips
from armguard.guard.static_errors import (
    STATIC_ERRORS,
    errors_at,
    set_static_errors,
)
from armguard.guard.watch import Watch
from armguard.motion.chains import anchor, primitive_levers, strokes
from armguard.motion.outermost import true_limits
from armguard.motion.state import Motion
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.hold_tables import Graspable, GripperPart
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def carry(
    item: Graspable,
    part: GripperPart,
    tables: SceneTables,
    watch: Watch,
    motion: Motion,
    T_world: Floats,
) -> None:
    """Attach an object's body to a gripper's body, with all joints above that."""
    body, carrier = item.body, part.body
    T = np.linalg.inv(as_matrix(T_world[carrier])) @ as_matrix(T_world[body])
    tables.parent[body] = carrier
    tables.T_parent_joint[body] = T[:3].reshape(12)
    for own in (motion.joints, motion.length, motion.shared, motion.shared.T):
        own[body] = own[carrier]
    motion.shared[body, body] = motion.shared[carrier, carrier]
    chain = motion.joints[carrier, : motion.length[carrier]].tolist()
    ways = strokes_of(chain, tables)
    first, end = tables.holds.places[item.name]
    rows = tables.standing[item.name].rows(T)
    errors, pushes = (
        np.abs(tables.gain[chain, 0])
        * motion.joint_figures[figure][tables.q_index[chain]]
        for figure in ("position_error", "acceleration")
    )
    reach = reach_of(carrier, tables)
    for i, row in zip(range(first, end), rows, strict=True):
        capsule = anchor(int(tables.kinds[i]), row)
        levers = primitive_levers(
            capsule, chain, tables.joint_kind, tables.T_parent_joint, tables.axis,
            ways,
        )  # fmt: skip
        motion.levers[i] = 0.0
        motion.levers[i, : len(levers)] = levers
        motion.blur[i], motion.push[i] = levers @ errors, levers @ pushes
        far = np.linalg.norm([capsule.start, capsule.end], axis=1).max()
        tables.base_reach[i] = reach + float(far + capsule.radius)
        tables.robot_of_primitive[i] = part.robot
        errors = errors_at(part.robot, float(tables.base_reach[i]), tables)
        set_static_errors(slice(i, i + 1), np.array([errors]).T, watch)


def set_down(
    item: Graspable,
    tables: SceneTables,
    watch: Watch,
    motion: Motion,
    T_world: Floats,
) -> None:
    """Detach an object's body: it is static in the world at its present pose."""
    body = item.body
    tables.parent[body] = -1
    tables.T_parent_joint[body] = T_world[body]
    motion.joints[body] = -1
    motion.length[body] = 0
    motion.shared[body] = motion.shared[:, body] = 0
    own = slice(*tables.holds.places[item.name])
    motion.levers[own] = 0.0
    motion.blur[own] = motion.push[own] = motion.rate[own] = 0.0
    motion.reach[:, own] = 0.0
    tables.base_reach[own] = 0.0
    tables.robot_of_primitive[own] = -1
    set_static_errors(own, np.zeros((len(STATIC_ERRORS), own.stop - own.start)), watch)


def reach_of(body: int, tables: SceneTables) -> float:
    """Greatest distance of a body's frame from its robot's root [m]."""
    radius = 0.0
    while tables.parent[body] >= 0:
        if tables.joint_kind[body] != FIXED:
            radius += strokes_of([body], tables)[0]
        radius += float(np.linalg.norm(tables.T_parent_joint[body, [3, 7, 11]]))
        body = int(tables.parent[body])
    return radius


def strokes_of(chain: Sequence[int], tables: SceneTables) -> list[float]:
    """Strokes of the joints above some bodies, see `strokes`."""
    limits = true_limits(tables)
    return strokes(chain, tables.joint_kind, tables.gain, tables.q_index, *limits)


def speed_of(item: Graspable, part: GripperPart, m: Motion, T_world: Floats) -> float:
    """Speed at which a gripper would move an object that it is about to hold [m/s]."""
    p = T_world[item.body, [3, 7, 11]]
    chain = m.joints[part.body, : m.length[part.body]]
    q, axes, origins = m.q_index[chain], m.axes[chain, :3], m.axes[chain, 3:]
    slides = m.joint_kind[chain, None] == PRISMATIC
    ways = np.where(slides, axes, np.cross(axes, p - origins))
    speeds = m.gain[chain, 0] * 0.5 * (m.v_low[q] + m.v_high[q])
    return float(np.linalg.norm(speeds @ ways))


def as_held(
    holders: Mapping[str, Sequence[str]],
    exempt: Sequence[tuple[int, int]],
    tables: SceneTables,
    motion: Motion,
    grips: Grips,
) -> dict[str, NDArray[Any]]:
    """Tables as they are if these robots hold these objects, by 'ledger.name'.

    Only tables of indices and counts; nothing is written.

    Args:
        holders: Robots that hold each object; the first one carries it.
        exempt: Pairs of groups that are not checked then.
        tables: The scene.
        motion: Motion.
        grips: Contracts and grippers.
    """
    holds = tables.holds
    numbers_of = {part.name: g for g, part in enumerate(holds.grippers)}
    parent, length = tables.parent.copy(), motion.length.copy()
    robot_of = tables.robot_of_primitive.copy()
    joints = motion.joints.copy()
    grippers: Any = grips.grippers.copy()
    objects: Any = grips.objects.copy()
    grippers["held_count"] = 0
    carrier = np.arange(len(parent))
    free = []
    for o, (name, item) in enumerate(holds.objects.items()):
        numbers = [numbers_of[robot] for robot in holders.get(name, ())]
        body, own = item.body, slice(*holds.places[name])
        grippers["held_count"][numbers] += 1
        objects[o].holder, objects[o].second_holder = [*numbers, -1, -1][:2]
        if numbers:
            part = holds.grippers[numbers[0]]
            carrier[body], parent[body] = part.body, part.body
            robot_of[own] = part.robot
        else:
            free.append(body)
            parent[body] = robot_of[own] = -1
    joints, length = joints[carrier], length[carrier]
    shared = motion.shared[np.ix_(carrier, carrier)]
    joints[free], length[free] = -1, 0
    shared[free], shared[:, free] = 0, 0
    return {
        "tables.parent": parent,
        "tables.checked": holds.checked(holders, exempt),
        "tables.robot_of_primitive": robot_of,
        "motion.joints": joints,
        "motion.length": length,
        "motion.shared": shared,
        "grips.grippers": grippers,
        "grips.objects": objects,
    }


def as_matrix(T: Floats) -> Floats:
    """A pose of twelve numbers as a matrix of shape (4, 4)."""
    out = np.eye(4)
    out[:3] = T.reshape(3, 4)
    return out
