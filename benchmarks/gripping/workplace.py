"""Tables with things to grip, walls and a shelf between them, drawn at random."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.geometry import Box, Cylinder, Pose
from armguard.scene import Gripper, Scene
from armguard.scene.settings import IndexSettings
from gripping.gantry import BELOW, CLOSED, FIGURES, FINGER, HAND, WIDEST, gantry
from gripping.solids import Solid, box, cylinder, gaps

Floats = NDArray[np.float64]

# Time from one cycle to the next, and how the gantry stops: it is as late as that [s].
PERIOD = 0.004
STOPPING = {**FIGURES, "sensing": PERIOD, "command": PERIOD}

# Half of the sizes of the table; its top is at z = 0 [m].
TABLE = (1.0, 1.0, 0.05)

# Things stand no farther from the middle than this along x and y [m].
FIELD = 0.35

# How far fingers are open beside what they are to grip [m].
BESIDE = 0.015

# Least distance of fingers from the table, and of the hand from what it grips [m].
OVER_TABLE, OVER_OBJECT = 0.01, 0.012

# Whoever grips or puts down keeps at least this to all that is not meant [m].
ROOM = 0.012

# What is carried passes above everything by this [m].
ABOVE = 0.04

# Distance of things that stand side by side [m].
SIDE_BY_SIDE = 0.02


@dataclass(frozen=True)
class Workplace:
    """What stands where.

    Attributes:
        objects: Things to grip, by name.
        fixtures: Everything else.
        response: What the robot does about what is near.
        index: Kind of the index.
        coarse: Whether one box stands for the gripper where nothing is near.
        home: Where the robot is at first, shape (5,) [m].
    """

    objects: dict[str, Solid]
    fixtures: dict[str, Solid]
    response: str
    index: str
    coarse: bool
    home: Floats

    def scene(self) -> Scene:
        """The scene, with the gantry named 'arm'."""
        scene = Scene(mode="path", period=PERIOD, index=IndexSettings(kind=self.index))
        names = ("x", "y", "z", "open_left", "open_right")
        scene.add_robot(
            gantry(),
            name="arm",
            stopping=STOPPING,
            home=dict(zip(names, self.home.tolist(), strict=True)),
            gripper=Gripper(link="hand", fingers=("left", "right"), coarse=self.coarse),
            response=self.response,
        )
        for name, solid in {**self.fixtures, **self.objects}.items():
            shape = (
                Cylinder(radius=solid.radius, height=2.0 * float(solid.half[2]))
                if solid.radius
                else Box(half_extents=tuple(solid.half.tolist()))
            )
            pose = Pose(xyz=tuple(solid.at.tolist()))
            scene.add(shape, name=name, pose=pose, graspable=name in self.objects)
        return scene

    @property
    def top(self) -> float:
        """Height of the highest thing [m]."""
        solids = [*self.objects.values(), *self.fixtures.values()]
        return max(float(s.at[2] + s.half[2]) for s in solids)


def drawn_object(rng: np.random.Generator, xy: Floats) -> Solid:
    """A block or a cup on the table."""
    half_height = rng.uniform(0.025, 0.05)
    at = np.array([*xy, half_height])
    if rng.random() < 0.5:
        return cylinder(rng.uniform(0.012, 0.025), half_height, at)
    half = (*rng.uniform(0.012, 0.025, 2), half_height)
    return box(half, at)


def half_width(solid: Solid) -> float:
    """Half of the width fingers have to span [m]."""
    return float(solid.half[1]) + solid.radius


def opening(solid: Solid) -> float:
    """Position of both fingers that are open beside something [m]."""
    return min(half_width(solid) + BESIDE, WIDEST - 0.004)


def height_over(solid: Solid) -> float:
    """Height of the hand that grips what stands on the table [m]."""
    finger = BELOW + FINGER[2] + OVER_TABLE
    return max(finger, 2.0 * float(solid.half[2]) + HAND[2] + OVER_OBJECT)


def columns(solid: Solid, xy: Floats) -> tuple[Solid, Solid, Solid]:
    """What gripper and object sweep where the object is gripped or put down at xy."""
    low, tall = height_over(solid), 1.0
    out = CLOSED + opening(solid) + FINGER[1]
    tips, palm = low - BELOW - FINGER[2], low - HAND[2]
    fingers = box((FINGER[0], out, tall), (*xy, tips + tall))
    hand = box((HAND[0], HAND[1], tall), (*xy, palm + tall))
    return fingers, hand, solid.moved_to(np.array([*xy, solid.half[2]]))


def is_free(solid: Solid, xy: Floats, others: list[Solid]) -> bool:
    """Whether an object can be gripped or put down at xy, straight from above."""
    return all(
        gaps(part, other) >= ROOM for part in columns(solid, xy) for other in others
    )


def table() -> Solid:
    """The table."""
    return box(TABLE, (0.0, 0.0, -TABLE[2]))


def settings(rng: np.random.Generator) -> dict[str, object]:
    """Settings that are nothing to the operator."""
    return {
        "response": "slow" if rng.random() < 0.25 else "deflect",
        "index": "brute_force" if rng.random() < 0.1 else "octree",
        "coarse": bool(rng.random() < 0.8),
    }


def cluttered(rng: np.random.Generator) -> tuple[Workplace, str, Floats]:
    """A table with clutter, the object that is meant, and a free place for it.

    Returns:
        The workplace, the object's name, and where it is to be put, shape (2,) [m].
    """
    while True:
        objects: dict[str, Solid] = {}
        for k in range(int(rng.integers(2, 7))):
            solid = drawn_object(rng, rng.uniform(-FIELD, FIELD, 2))
            if all(gaps(solid, other) >= ROOM for other in objects.values()):
                objects[f"thing{k}"] = solid
        walls = [drawn_wall(rng) for _ in range(int(rng.integers(1, 6)))]
        name = str(rng.choice(list(objects)))
        meant = objects[name]
        rest = [s for n, s in objects.items() if n != name] + walls
        clear = [w for w in walls if all(gaps(w, o) >= ROOM for o in objects.values())]
        goal = rng.uniform(-FIELD, FIELD, 2)
        if clear != walls or not is_free(meant, meant.at[:2], rest):
            continue
        if not is_free(meant, goal, rest):
            continue
        fixtures = {f"wall{k}": wall for k, wall in enumerate(walls)}
        fixtures["table"] = table()
        top = max(float(s.at[2] + s.half[2]) for s in [*objects.values(), *walls])
        z = top + HAND[2] + BELOW + FINGER[2] + ABOVE
        home = np.array([*rng.uniform(-FIELD, FIELD, 2), z, 0.03, 0.03])
        place = Workplace(objects, fixtures, home=home, **settings(rng))
        return place, name, goal


def drawn_wall(rng: np.random.Generator) -> Solid:
    """A wall, a post, or the board of a shelf above the table."""
    xy = rng.uniform(-FIELD, FIELD, 2)
    if rng.random() < 0.25:
        half = (rng.uniform(0.05, 0.1), rng.uniform(0.03, 0.08), 0.008)
        return box(half, (*xy, rng.uniform(0.15, 0.25)))
    thin, long = rng.uniform(0.005, 0.02), rng.uniform(0.02, 0.15)
    tall = rng.uniform(0.03, 0.12)
    half = (thin, long, tall) if rng.random() < 0.5 else (long, thin, tall)
    return box(half, (*xy, tall))


def side_by_side(rng: np.random.Generator) -> Workplace:
    """Things on a table in two rows, 20 mm beside each other along x and along y."""
    half = np.array([*rng.uniform(0.012, 0.025, 2), rng.uniform(0.025, 0.05)])
    round_ones = rng.random() < 0.5
    if round_ones:
        half[1] = half[0]
    step = 2.0 * half[:2] + SIDE_BY_SIDE
    count = int(rng.integers(2, 5))
    objects = {}
    for row in range(int(rng.integers(1, 3))):
        for k in range(count):
            at = np.array([step[0] * (k - 0.5 * (count - 1)), step[1] * row, half[2]])
            objects[f"thing{row}{k}"] = (
                cylinder(float(half[0]), float(half[2]), at)
                if round_ones
                else box(half, at)
            )
    home = np.array([*rng.uniform(-0.1, 0.1, 2), 0.3, 0.03, 0.03])
    return Workplace(objects, {"table": table()}, home=home, **settings(rng))
