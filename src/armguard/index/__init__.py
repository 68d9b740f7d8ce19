"""Broad phase: indices that find the pairs of primitives that may be near."""

from armguard.index.base import Index
from armguard.index.brute_force import BruteForce
from armguard.index.joint_table import JointTable
from armguard.index.octree import Octree
from armguard.index.world import World

__all__ = ["BruteForce", "Index", "JointTable", "Octree", "World"]
