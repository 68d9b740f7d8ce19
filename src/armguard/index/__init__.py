"""Broad phase: which primitives are near each other."""

from armguard.index.base import Index
from armguard.index.brute_force import BruteForce
from armguard.index.octree import Octree
from armguard.index.world import World

__all__ = ["BruteForce", "Index", "Octree", "World"]
