"""Random shapes and worlds for tests: seeded, hard cases drawn on purpose."""

import numpy as np
from scipy.spatial.transform import Rotation

from adding_a_shape import Superellipsoid
from armguard.geometry import SHAPES, Box, Capsule, ShapeKind, Sphere
from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import shape_row
from armguard.index import World

# What robots are made of.
SIMPLE = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.BOX)

CLASS_OF = {shape.kind: shape for shape in SHAPES.values()}
assert CLASS_OF[ShapeKind.SUPPORT] is Superellipsoid


def random_pose(rng, spread=0.6):
    """A random pose; one in four keeps its axes along the world's."""
    T = np.eye(4)
    if rng.random() > 0.25:
        T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-spread, spread, 3)
    return T


def random_shape(rng, kind, size):
    """A shape of about the given size [m]: thin, fat, sharp or rounded."""
    if kind == ShapeKind.SPHERE:
        return Sphere(radius=size * rng.uniform(0.1, 0.6))
    if kind == ShapeKind.CAPSULE:
        length = size * rng.uniform(0.0, 1.0)
        return Capsule(
            start=(0, 0, -length / 2),
            end=(0, 0, length / 2),
            radius=size * rng.uniform(0.02, 0.4),
        )
    if kind == ShapeKind.BOX:
        half = size * 10.0 ** rng.uniform(-2.0, -0.2, 3)
        rounding = float(rng.choice([0.0, size * 0.1]))
        return Box(size=tuple((2.0 * half).tolist()), rounding=rounding)
    return CLASS_OF[kind].example(rng, 0.6 * size)


def random_world(seed, count, moving, growth=0.05, kinds=SIMPLE):
    """A world of random primitives, with what is needed to move them."""
    rng = np.random.default_rng(seed)
    shapes, poses = [], []
    for _ in range(count):
        kind = kinds[int(rng.integers(len(kinds)))]
        shapes.append(random_shape(rng, kind, 10.0 ** rng.uniform(-1.5, -0.2)))
        poses.append(random_pose(rng, spread=1.0))
    rows = np.array([shape_row(s, T) for s, T in zip(shapes, poses, strict=True)])
    world = World(
        kinds=np.array([int(s.kind) for s in shapes], dtype=np.int32),
        rows=rows,
        boxes=np.zeros((count, 6)),
        owners=np.arange(count, dtype=np.int32),
        growth=np.where(np.arange(count) < moving, growth, 0.0),
    )
    for i in range(count):
        row_bounds(world.kinds[i], rows[i], 0.0, world.boxes[i])
    return rng, shapes, poses, world


def move(rng, i, shapes, poses, world, step, teleport=1.6):
    """Move a primitive: by about `step` [m], or somewhere else if step is 0."""
    T = poses[i]
    if step == 0.0:
        T[:3, 3] = rng.uniform(-teleport, teleport, 3)
    else:
        T[:3, 3] += rng.normal(size=3) * step
        turn = Rotation.from_rotvec(rng.normal(size=3) * step).as_matrix()
        T[:3, :3] = turn @ T[:3, :3]
    world.rows[i] = shape_row(shapes[i], T)
    row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
