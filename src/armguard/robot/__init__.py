"""Joint angles to link poses: trees, URDF and SRDF, limits, fitted capsules."""

from armguard.robot.model import FittedLink, RobotModel
from armguard.robot.named import find_named_robot
from armguard.robot.urdf import load_urdf

__all__ = ["FittedLink", "RobotModel", "find_named_robot", "load_urdf"]
