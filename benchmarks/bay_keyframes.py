"""The three tasks of the bay as an operator would drive them, keyframe by keyframe.

A keyframe says how many cycles it lasts, what the operator does, and where the joints
that move end up; all others hold still. No joints, no motion: the operator looks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Keyframe:
    """One stretch of a task, from rest to rest.

    Attributes:
        cycles: Its length in cycles.
        says: What the operator does.
        left: Final position of each joint of the left arm that moves, by its number,
            1 to 7 [rad].
        right: The same for the right arm.
    """

    cycles: int
    says: str
    left: Mapping[int, float] = field(default_factory=dict)
    right: Mapping[int, float] = field(default_factory=dict)


K = Keyframe

TASK_150 = (
    K(1, "both arms at home"),
    K(15, "left lifts its wrist", left={6: 0.3}),
    K(10, "left aims at its unit", left={1: -0.154}),
    K(15, "left lowers its elbow", left={4: 2.096}),
    K(28, "left comes to the unit's front", left={2: 0.528, 6: -0.965}),
    K(12, "left turns its tool to the handle", left={7: 0.8}),
    K(18, "left reaches for the handle; right makes ready",
      left={1: -0.142, 2: 0.708, 4: 1.724, 6: -0.775}, right={1: 0.15, 7: 0.6}),
    K(5, "the operator looks"),
    K(18, "left draws back; right lifts its wrist",
      left={1: -0.154, 2: 0.528, 4: 2.096, 6: -0.965}, right={6: 0.8}),
    K(28, "left goes half way home", left={2: 0.1, 6: 0.0}),
)  # fmt: skip
