"""Motion: displacement bounds, stop prediction and proofs of the stop path."""

from armguard.motion.displacement import displacement_bounds
from armguard.motion.prepare import motion_of
from armguard.motion.state import Motion

__all__ = ["Motion", "displacement_bounds", "motion_of"]
