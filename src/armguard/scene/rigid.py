"""Links that do not move against each other, or are joined by one joint."""

from collections.abc import Mapping

from armguard.robot.model import JointKind, RobotModel


def rigid_groups(model: RobotModel) -> Mapping[str, str]:
    """For each link the first link of the group that fixed joints hold together."""
    fixed_parent = {
        joint.child: joint.parent
        for joint in model.joints.values()
        if joint.kind is JointKind.FIXED
    }
    groups = {}
    for link in model.links:
        top = link
        while top in fixed_parent:
            top = fixed_parent[top]
        groups[link] = top
    return groups
