"""Which bodies are checked against each other, and what distance they must keep."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.scene.allowed import PairRule
from armguard.scene.scene import Scene


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
