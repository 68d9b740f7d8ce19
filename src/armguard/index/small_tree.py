"""Small octree whose changes compile or load the kernels of a tree."""

import numpy as np

from armguard.geometry import Pose, ShapeKind, Sphere
from armguard.geometry.shapes import shape_row
from armguard.index.octree import Octree
from armguard.index.world import World


def small_tree() -> Octree:
    """Octree of eight spheres."""
    places = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 3))
    rows = np.array(
        [shape_row(Sphere(radius=0.1), Pose(xyz=tuple(p)).matrix()) for p in places]
    )
    boxes = np.hstack([places - 0.1, places + 0.1])
    world = World(
        kinds=np.full(8, ShapeKind.SPHERE, dtype=np.int32),
        rows=rows,
        boxes=boxes,
        owners=np.arange(8, dtype=np.int32),
        growth=np.full(8, 0.05),
    )
    return Octree(world, leaf_capacity=1)
