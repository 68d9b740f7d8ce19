"""The three tasks of the bay as an operator would drive them, keyframe by keyframe.

A keyframe says how many cycles it lasts, what the operator does, and where the joints
that move end up; all others hold still. No joints, no motion: the operator looks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

Joints = Mapping[int, float]


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
    left: Joints = field(default_factory=dict)
    right: Joints = field(default_factory=dict)


# Places with a name, for the arm that goes there; joints left out stay as they are.
HOME = {1: 0.0, 2: -0.35, 3: 0.0, 4: 1.7, 5: 0.0, 6: 1.25, 7: 0.0}
PANEL_FRONT = {1: 0.795, 2: -0.175, 4: 2.081, 6: -0.073}
PANEL = {1: 0.795, 2: 0.215, 4: 1.812, 6: -0.194}
UNIT_FRONT = {1: -0.163, 2: 0.146, 4: 1.787, 6: 0.336}
UNIT = {1: -0.143, 2: 0.564, 4: 1.411, 6: 0.293}
RIGHT_UNIT_FRONT = {1: 0.163, 2: 0.123, 4: 1.921, 6: 0.05}
RIGHT_UNIT = {1: 0.143, 2: 0.548, 4: 1.549, 6: -0.002}
TOOL_ABOVE = {1: -0.65, 2: 0.199, 4: 1.032, 6: 1.387}
TOOL = {1: -0.65, 2: 0.145, 4: 1.369, 6: 1.104}
LEFT_MIDDLE = {1: -0.641, 2: 0.025, 4: 1.837, 6: 0.058}
RIGHT_LOW = {1: 0.561, 2: 0.515, 4: 1.602, 6: -0.022}
LEFT_ABOVE = {1: -0.56, 2: 0.257, 4: 1.57, 6: 0.093}
LEFT_OVER = {1: -0.56, 2: 0.319, 4: 1.691, 6: -0.09}
CAMERA = {1: -0.54, 2: 0.323, 4: 1.141, 6: -0.766}

K = Keyframe

TASK_150 = (
    K(1, "both arms at home"),
    K(29, "left turns to the panel", left={1: 0.795}),
    K(36, "left lifts its wrist", left={6: -0.073}),
    K(29, "left folds its elbow", left={2: -0.175, 4: 2.081}),
    K(14, "left turns its tool to the plug", left={7: 0.6}),
    K(22, "left reaches for the plug; right makes ready", left=PANEL, right={1: 0.15}),
    K(3, "the operator looks"),
    K(16, "left draws back; right lifts its wrist", left=PANEL_FRONT, right={6: 0.9}),
)

TASK_700 = (
    K(1, "both arms at home"),
    K(70, "right turns its tool", right={7: 1.4}),
    K(40, "right turns to the middle", right={1: 0.605}),
    K(50, "right lifts its wrist", right={6: 0.057}),
    K(45, "right leans forward", right={2: -0.014}),
    K(30, "right folds its elbow", right={4: 1.877}),
    K(15, "the operator looks"),
    K(60, "left turns its tool", left={7: -1.2}),
    K(35, "left turns to the middle", left={1: -0.471}),
    K(50, "left lifts its wrist", left={6: 0.067}),
    K(35, "left leans forward", left={2: -0.134}),
    K(30, "left folds its elbow", left={4: 1.987}),
    K(20, "the operator looks"),
    K(40, "left comes to the hand-over; right turns", left=LEFT_MIDDLE, right={7: 0.6}),
    K(10, "the operator looks"),
    K(40, "both go up together",
      left={2: -0.086, 4: 1.759, 6: 0.247}, right={2: -0.119, 4: 1.786, 6: 0.253}),
    K(10, "the operator looks"),
    K(40, "the arms part",
      left={1: -0.458, 2: -0.25, 4: 1.9, 6: 0.27}, right={1: 0.458, 2: -0.25, 4: 1.9}),
    K(44, "both go home", left=HOME, right={**HOME, 7: 0.6}),
    K(35, "right turns its tool back", right={7: 0.0}),
)  # fmt: skip

TASK_2000 = (
    K(1, "both arms at home"),
    # Right fetches the tool from its holder.
    K(70, "right turns its tool", right={7: 2.0}),
    K(45, "right turns to the holder", right={1: -0.65}),
    K(25, "right straightens its wrist", right={6: 1.387}),
    K(60, "right opens its elbow", right={4: 1.032}),
    K(60, "right leans forward", right={2: 0.199}),
    K(40, "right comes down to the tool", right=TOOL),
    K(15, "the operator looks"),
    K(70, "right unlocks the tool", right={7: 0.5}),
    K(40, "right goes up again", right=TOOL_ABOVE),
    K(60, "right leans back", right={2: -0.35}),
    K(60, "right folds its elbow", right={4: 1.7}),
    K(40, "right swings its elbow out", right={3: -0.5}),
    K(50, "right turns forward, elbow down", right={1: 0.163, 3: 0.0}),
    K(20, "the operator looks"),
    # Left loosens its unit.
    K(63, "left turns its tool", left={7: 1.5}),
    K(45, "left lifts its wrist", left={6: 0.336}),
    K(25, "left turns to its unit", left={1: -0.163}),
    K(50, "left leans forward", left={2: 0.146}),
    K(20, "left folds its elbow", left={4: 1.787}),
    K(45, "left reaches for the handle", left=UNIT),
    K(80, "left loosens the bolt", left={7: -1.0}),
    K(15, "the operator looks"),
    K(45, "left draws back", left=UNIT_FRONT),
    # Both work: left at the panel, right at its unit.
    K(90, "left goes to the panel, right to its unit",
      left=PANEL_FRONT, right=RIGHT_UNIT_FRONT),
    K(60, "both reach", left=PANEL, right=RIGHT_UNIT),
    K(20, "the operator looks"),
    K(60, "both draw back", left=PANEL_FRONT, right=RIGHT_UNIT_FRONT),
    K(20, "the operator looks"),
    # Left passes over right.
    K(70, "right goes low to the middle", right=RIGHT_LOW),
    K(90, "left swings to the middle", left={1: -0.56}),
    K(50, "left reaches out above right", left=LEFT_ABOVE),
    K(40, "left comes down", left=LEFT_OVER),
    K(20, "the operator looks"),
    K(40, "left goes up", left=LEFT_ABOVE),
    K(70, "right goes home", right={**HOME, 7: 0.5}),
    # Left shows what it holds to the camera.
    K(90, "left goes up to the camera", left=CAMERA),
    K(30, "left rolls its forearm", left={5: 0.6}),
    K(66, "left turns its tool before the camera", left={7: 1.0}),
    K(90, "left goes home", left={**HOME, 7: 1.0}),
    K(50, "both turn their tools back", left={7: 0.0}, right={7: 0.0}),
)  # fmt: skip
