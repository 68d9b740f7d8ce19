"""Following of sensed surfaces to a goal."""

from armguard.respond.following.arm import PlanarArm
from armguard.respond.following.planar import PlanarFollower
from armguard.respond.following.state import State
from armguard.respond.following.tangent import SurfaceFollower

__all__ = ["PlanarArm", "PlanarFollower", "State", "SurfaceFollower"]
