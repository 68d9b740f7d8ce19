"""Which link of a robot is its tool, if none is declared."""

from armguard.robot.model import JointKind, RobotModel

TURNING = (JointKind.REVOLUTE, JointKind.CONTINUOUS)


def tool_link(model: RobotModel) -> str:
    """The link that most joints turn, and as few as can be slide; of these the last.

    That is the hand, not a finger of it, nor the flange before it.
    """
    above = {joint.child: joint for joint in model.joints.values()}

    def rank(link: str) -> tuple[int, int, int]:
        turning = sliding = fixed = 0
        while link in above:
            kind = above[link].kind
            turning += kind in TURNING
            sliding += kind is JointKind.PRISMATIC
            fixed += kind is JointKind.FIXED
            link = above[link].parent
        return turning, -sliding, fixed

    return max(model.links, key=rank)
