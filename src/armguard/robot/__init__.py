"""Joint angles to link poses: trees, URDF and SRDF, limits, fitted capsules."""
