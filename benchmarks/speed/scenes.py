"""The bay with many more fixtures around it, and smooth motion through it."""

from dataclasses import replace

import numpy as np

from armguard.geometry import Box, Capsule, Pose, ShapeKind
from armguard.geometry.pose import rotation_from_rpy
from armguard.geometry.shapes import ROW_WIDTH
from armguard.index import World
from armguard.scene import Scene, SceneTables, bay_scene
from arrays import Floats

# Time from one cycle to the next [s].
PERIOD = 1e-3

BAY_PRIMITIVES = 35

# Where the boxes of a crowded world are: distance of their centres from the origin,
# and halves of their edges [m].
SHELL = (3.0, 40.0)
HALF_EDGES = (0.005, 0.1)

# Fixtures are in a shell around the bay's cube, so that the arms move among as many
# neighbours as before while the world grows [m].
INNER, OUTER = 1.15, 3.0


def crowded_bay(primitives: int, seed: int = 0) -> Scene:
    """The bay with fixtures added until it has so many primitives.

    A tenth of the added fixtures are inside the arms' reach but clear of both arms
    at home, the rest farther out.

    Args:
        primitives: All primitives, the bay's 35 included.
        seed: Of the places.
    """
    scene = bay_scene()
    rng = np.random.default_rng(seed)
    for k in range(max(primitives - BAY_PRIMITIVES, 0)):
        inside = k % 10 == 0
        while True:
            span = INNER if inside else OUTER
            x, y, z = rng.uniform(-span, span, 3)
            away = max(abs(x), abs(y), abs(z))
            if inside and np.hypot(x + 0.55, abs(y) - 0.42) > 0.75:
                break
            if not inside and away > INNER + 0.2:
                break
        size = rng.uniform(0.005, 0.02, 3).tolist()
        turn = rng.uniform(-np.pi, np.pi, 3).tolist()
        shape = (
            Box(size=tuple(2.0 * s for s in size))
            if k % 2
            else Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.05), radius=size[0])
        )
        pose = Pose(xyz=(float(x), float(y), float(z + 1.28)), rpy=tuple(turn))
        scene.add(shape, name=f"fixture{k}", pose=pose)
    return scene


def bay_among_boxes(primitives: int, seed: int = 0) -> Scene:
    """The bay with boxes in a wide shell around it until it has so many primitives.

    Half of the boxes are aligned with the world, half turned at random; their edges are
    1 to 20 cm. None is in reach of an arm: what the arms meet stays the same while the
    world grows.

    Args:
        primitives: All primitives, the bay's 35 included.
        seed: Of places, sizes and turns.
    """
    scene = bay_scene()
    # The cube of the bay's file does not hold the shell.
    if primitives > BAY_PRIMITIVES:
        scene.index = replace(scene.index, cube=None)
    boxes = np.stack(shell_boxes(primitives - BAY_PRIMITIVES, seed), axis=1).tolist()
    for k, (centre, half, turn) in enumerate(boxes):
        pose = Pose(xyz=tuple(centre), rpy=tuple(turn))
        scene.add(Box(size=tuple(2.0 * h for h in half)), name=f"box{k}", pose=pose)
    return scene


def shell_boxes(count: int, seed: int) -> tuple[Floats, Floats, Floats]:
    """Boxes spread evenly over a shell about the origin, each array of shape (k, 3).

    Returns:
        Centres [m]; half extents [m]; roll, pitch and yaw, 0 for every other box [rad].
    """
    rng = np.random.default_rng(seed)
    count = max(count, 0)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radius = np.cbrt(rng.uniform(SHELL[0] ** 3, SHELL[1] ** 3, (count, 1)))
    halves = rng.uniform(*HALF_EDGES, (count, 3))
    turns = rng.uniform(-np.pi, np.pi, (count, 3))
    turns[::2] = 0.0
    return direction * radius, halves, turns


def boxes_world(movers: int, boxes: int, growth: float, seed: int = 0) -> World:
    """Moving boxes among fixed ones, for an index alone.

    Args:
        movers: Boxes that move; they come first, within 2 m of the origin.
        boxes: Fixed boxes in the shell.
        growth: Of those that move [m].
        seed: Of places, sizes and turns.
    """
    count = movers + boxes
    centres, halves, turns = shell_boxes(count, seed)
    rng = np.random.default_rng(seed + 1)
    centres[:movers] = rng.uniform(-2.0, 2.0, (movers, 3))
    R = np.array([rotation_from_rpy(*turn) for turn in turns]).reshape(-1, 3, 3)
    rows = np.zeros((count, ROW_WIDTH))
    rows[:, 1:4], rows[:, 4:7], rows[:, 7:] = centres, halves, R.reshape(-1, 9)
    reach = np.einsum("nij,nj->ni", np.abs(R), halves)
    return World(
        kinds=np.full(count, int(ShapeKind.BOX), dtype=np.int32),
        rows=rows,
        boxes=np.hstack([centres - reach, centres + reach]),
        owners=np.arange(count, dtype=np.int32),
        growth=np.where(np.arange(count) < movers, growth, 0.0),
    )


def sway(tables: SceneTables, cycles: int, period: float = PERIOD) -> Floats:
    """Every joint swings about home at its own pace, within its limits.

    Args:
        tables: Of the scene.
        cycles: Rows.
        period: Time between rows [s].

    Returns:
        Configurations, shape (cycles, n) [rad].
    """
    n = len(tables.home)
    t = np.arange(cycles)[:, None] * period
    pace = 0.25 + 0.05 * (np.arange(n) * 7 % 11)
    phase = np.arange(n) * 0.9
    q = tables.home + 0.35 * (np.sin(pace * t + phase) - np.sin(phase))
    return np.ascontiguousarray(np.clip(q, tables.lower, tables.upper))


def only_last(q: Floats, home: Floats, moving: int, arms: int) -> Floats:
    """The same motion with all but the last joints held at home.

    Args:
        q: Configurations, shape (k, n); the arms' joints one arm after the other.
        home: Where the others are held.
        moving: Links that move: the last of the first arm, then more of it, then the
            last of the second, and so on.
        arms: Number of arms.
    """
    held = np.tile(home, (len(q), 1))
    per_arm = q.shape[1] // arms
    left = moving
    for arm in range(arms):
        count = min(left, per_arm)
        end = (arm + 1) * per_arm
        held[:, end - count : end] = q[:, end - count : end]
        left -= count
    return held
