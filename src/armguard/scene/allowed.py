"""Pairs that need no check, with reasons; rules and distances of all others."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.robot.model import JointKind
from armguard.robot.tree import rigid_groups
from armguard.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class PairRule:
    """A pair that is not checked.

    Attributes:
        body_a: One body.
        body_b: The other.
        reason: Why.
        source: Where that is from: "rigid", "adjacent", "srdf" or "scene".
    """

    body_a: str
    body_b: str
    reason: str
    source: str


def allowed_pairs(scene: Scene) -> list[PairRule]:
    """All pairs of bodies that are not checked although one of them moves.

    1. Rigid: both belong to one group of links that fixed joints hold together;
       attached objects belong to their link's group.
    2. Adjacent: their groups are joined by one moving joint. A link without geometry
       in between is a group of its own: what lies beyond it is checked.
    3. SRDF: the robot's `disable_collisions`.
    4. Scene: allowed explicitly.

    Pairs of two robots, and of a robot and an object, are only ever allowed
    explicitly.
    """
    rules: list[PairRule] = []
    for name, robot in scene.robots.items():
        groups = rigid_groups(robot.model)
        riders: dict[str, list[str]] = {}
        for link, group in groups.items():
            riders.setdefault(group, []).append(f"{name}/{link}")
        for item in scene.objects.values():
            if item.attached_to and item.attached_to.startswith(f"{name}/"):
                link = item.attached_to.split("/", 1)[1]
                riders[groups[link]].append(item.name)
        for members in riders.values():
            rules += [
                PairRule(a, b, "they do not move against each other", "rigid")
                for k, a in enumerate(members)
                for b in members[k + 1 :]
            ]
        for joint in robot.model.joints.values():
            if joint.kind is JointKind.FIXED:
                continue
            rules += [
                PairRule(a, b, f"joined by '{joint.name}'", "adjacent")
                for a in riders[groups[joint.parent]]
                for b in riders[groups[joint.child]]
            ]
        rules += [
            PairRule(f"{name}/{p.link_a}", f"{name}/{p.link_b}", p.reason, "srdf")
            for p in robot.model.disabled_pairs
        ]
    rules += [PairRule(a.a, a.b, a.reason, "scene") for a in scene.allowances]
    return rules


@dataclass(frozen=True, slots=True)
class PairRules:
    """Rules by group, so that twenty thousand like fixtures are one row.

    Bodies share a group if every rule treats them alike; a body that moves has a
    group of its own.

    Attributes:
        group_of: Group of each body.
        checked: 1 where two groups are checked, shape (g, g).
        buffers: Required distance of two groups, shape (g, g) [m].
    """

    group_of: Mapping[str, int]
    checked: NDArray[np.uint8]
    buffers: NDArray[np.float64]


def pair_rules(
    scene: Scene,
    allowed: Sequence[PairRule],
    *,
    owners: Sequence[str],
    moving: Set[str],
) -> PairRules:
    """Rules of a scene for the bodies in the tables.

    Args:
        scene: The scene.
        allowed: Pairs that need no check.
        owners: Names of the bodies that have primitives.
        moving: Those of them that move.
    """
    special = {name for rule in allowed for name in (rule.body_a, rule.body_b)}
    for a, b in scene.pair_buffers:
        special |= {a, b}
    group_of: dict[str, int] = {}
    shared: dict[float, int] = {}
    members: list[str] = []
    for name in owners:
        buffer = scene.buffer_of(name)
        own_group = name in moving or name in special
        if not own_group and buffer in shared:
            group_of[name] = shared[buffer]
            continue
        group_of[name] = len(members)
        members.append(name)
        if not own_group:
            shared[buffer] = group_of[name]

    single = np.array([scene.buffer_of(name) for name in members])
    buffers = np.maximum(single[:, None], single[None, :])
    for (a, b), value in scene.pair_buffers.items():
        if a in group_of and b in group_of:
            buffers[group_of[a], group_of[b]] = value
            buffers[group_of[b], group_of[a]] = value

    moves = np.array([name in moving for name in members])
    checked = (moves[:, None] | moves[None, :]).astype(np.uint8)
    np.fill_diagonal(checked, 0)
    for rule in allowed:
        if rule.body_a in group_of and rule.body_b in group_of:
            checked[group_of[rule.body_a], group_of[rule.body_b]] = 0
            checked[group_of[rule.body_b], group_of[rule.body_a]] = 0
    return PairRules(group_of, checked, buffers)
