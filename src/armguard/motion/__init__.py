"""What comes next: how far everything may move, and whether it can still stop."""

from armguard.motion.displacement import displacement_bounds
from armguard.motion.prepare import motion_of
from armguard.motion.state import Motion

__all__ = ["Motion", "displacement_bounds", "motion_of"]
