"""Which links of a robot move together: chains, rigid groups, the tool."""

from collections import Counter
from collections.abc import Mapping

from armguard.robot.model import Joint, JointKind, RobotModel


def joints_above(model: RobotModel, link: str) -> list[Joint]:
    """Joints from a link up to the root, the nearest first."""
    above = {joint.child: joint for joint in model.joints.values()}
    found: list[Joint] = []
    while link in above:
        found.append(above[link])
        link = above[link].parent
    return found


def rigid_groups(model: RobotModel) -> Mapping[str, str]:
    """For each link the first link of the group that fixed joints hold together."""
    groups = {}
    for link in model.links:
        groups[link] = link
        for joint in joints_above(model, link):
            if joint.kind is not JointKind.FIXED:
                break
            groups[link] = joint.parent
    return groups


def tool_link(model: RobotModel) -> str:
    """The link that most joints turn, and as few as can be slide; of these the last.

    That is the hand, not a finger of it, nor the flange before it.
    """

    def rank(link: str) -> tuple[int, int, int]:
        kinds = Counter(joint.kind for joint in joints_above(model, link))
        turning = kinds[JointKind.REVOLUTE] + kinds[JointKind.CONTINUOUS]
        return turning, -kinds[JointKind.PRISMATIC], kinds[JointKind.FIXED]

    return max(model.links, key=rank)
