"""Tables with objects to grip, walls and a shelf between them, drawn at random."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armguard.geometry import Box, Cylinder, Pose
from armguard.scene import Gripper, Scene
from armguard.scene.settings import IndexSettings
from arrays import Floats
from gripping.gantry import BELOW, CLOSED, FIGURES, FINGER, HAND, WIDEST, gantry


@dataclass(frozen=True, slots=True)
class Solid:
    """A box along the axes, or an upright cylinder.

    Attributes:
        half: Half of its sizes along x, y, z; of a cylinder 0, 0 and half its height,
            shape (3,) [m].
        radius: Radius of a cylinder; 0 of a box [m].
        at: Its middle in the world, shape (3,), or in each of n cycles, (n, 3) [m].
    """

    half: Floats
    radius: float
    at: Floats

    def moved_to(self, at: Floats) -> "Solid":
        """The same elsewhere."""
        return replace(self, at=np.asarray(at, dtype=np.float64))

    @property
    def reach(self) -> float:
        """How far it reaches from its middle in the plane [m]."""
        return float(np.hypot(self.half[0], self.half[1])) + self.radius


def box(half, at) -> Solid:
    """A box by half of its sizes and its middle [m]."""
    return Solid(np.asarray(half, dtype=np.float64), 0.0, np.asarray(at, dtype=float))


def cylinder(radius: float, half_height: float, at) -> Solid:
    """An upright cylinder, by its middle [m]."""
    half = np.array([0.0, 0.0, half_height])
    return Solid(half, radius, np.asarray(at, dtype=np.float64))


def gaps(a: Solid, b: Solid) -> Floats:
    """Signed distance of two solids in each cycle, shape () or (n,) [m].

    Exact while they are apart. Where they overlap it is the least depth along z or in
    the plane, negative; in the plane exact unless the axis of a cylinder is inside the
    other solid.
    """
    apart = np.abs(b.at - a.at) - (a.half + b.half)
    plane = _signed(apart[..., 0], apart[..., 1]) - (a.radius + b.radius)
    return np.asarray(_signed(plane, apart[..., 2]))


def _signed(u: Floats, v: Floats) -> Floats:
    """Signed distance from two that are at right angles."""
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return np.where(np.maximum(u, v) > 0.0, outside, np.maximum(u, v))


# Time from one cycle to the next, and how the gantry stops: it is as late as that [s].
PERIOD = 0.004
STOPPING = {**FIGURES, "sensing": PERIOD, "command": PERIOD}

# Half of the sizes of the table; its top is at z = 0 [m].
TABLE = (1.0, 1.0, 0.05)

# Objects are no farther from the middle than this along x and y [m].
FIELD = 0.35

# How far fingers are open beside what they are to grip, and off their widest [m].
BESIDE, OFF_WIDEST = 0.015, 0.004

# Least distance of fingers from the table, and of the hand from what it grips [m].
OVER_TABLE, OVER_OBJECT = 0.01, 0.012

# An operator who grips or puts down keeps at least this to all other objects [m].
ROOM = 0.012

# What is carried passes above everything by this [m].
ABOVE = 0.04

# Distance of objects side by side [m].
SIDE_BY_SIDE = 0.02


@dataclass(frozen=True)
class Tool:
    """Sizes of a hand that looks down, and of its fingers, about the hand's frame.

    Attributes:
        tips: How far below it the tips of the fingers are [m].
        palm: How far below it the hand ends [m].
        hand: Half of the hand's sizes along x and y [m].
        finger: Half of a finger's size along x, and its size along y [m].
        widest: Position of both fingers at which they are open farthest; at 0 they
            touch each other [m].
    """

    tips: float
    palm: float
    hand: tuple[float, float]
    finger: tuple[float, float]
    widest: float

    def opening(self, solid: Solid) -> float:
        """Position of both fingers that are open beside something [m]."""
        return min(half_width(solid) + BESIDE, self.widest - OFF_WIDEST)

    def height_over(self, solid: Solid) -> float:
        """Height of the hand that grips what is on the table [m]."""
        over_object = 2.0 * float(solid.half[2]) + self.palm + OVER_OBJECT
        return max(self.tips + OVER_TABLE, over_object)

    def columns(self, solid: Solid, xy: Floats) -> tuple[Solid, Solid, Solid]:
        """What tool and object sweep where the object is gripped or put down at xy."""
        low, tall = self.height_over(solid), 1.0
        out = self.opening(solid) + self.finger[1]
        tips, palm = low - self.tips, low - self.palm
        fingers = box((self.finger[0], out, tall), (*xy, tips + tall))
        hand = box((*self.hand, tall), (*xy, palm + tall))
        return fingers, hand, solid.moved_to(np.array([*xy, solid.half[2]]))

    def is_free(self, solid: Solid, xy: Floats, others: list[Solid]) -> bool:
        """Whether an object can be gripped or put down at xy, straight from above."""
        return all(
            gaps(part, other) >= ROOM
            for part in self.columns(solid, xy)
            for other in others
        )


# The gantry's.
GANTRY = Tool(
    tips=BELOW + FINGER[2],
    palm=HAND[2],
    hand=(HAND[0], HAND[1]),
    finger=(FINGER[0], CLOSED + FINGER[1]),
    widest=WIDEST,
)


@dataclass(frozen=True)
class Workplace:
    """What is where.

    Attributes:
        objects: Objects to grip, by name.
        fixtures: Everything else.
        response: What the robot does about what is near.
        index: Kind of the index.
        coarse: Whether one box is taken for the gripper where nothing is near.
        home: Where the robot is at first, shape (5,) [m].
    """

    objects: dict[str, Solid]
    fixtures: dict[str, Solid]
    response: str
    index: str
    coarse: bool
    home: Floats

    def scene(self) -> Scene:
        """The scene, with its robot named 'arm'."""
        scene = Scene(mode="path", period=PERIOD, index=IndexSettings(kind=self.index))
        model, known = self.robot()
        scene.add_robot(model, name="arm", response=self.response, **known)
        for name, solid in {**self.fixtures, **self.objects}.items():
            shape = (
                Cylinder(radius=solid.radius, height=2.0 * float(solid.half[2]))
                if solid.radius
                else Box(size=tuple((2.0 * solid.half).tolist()))
            )
            pose = Pose(xyz=tuple(solid.at.tolist()))
            scene.add(shape, name=name, pose=pose, graspable=name in self.objects)
        return scene

    def robot(self) -> tuple[Any, dict[str, Any]]:
        """The robot's model, and what else `Scene.add_robot` is to know of it."""
        names = ("x", "y", "z", "open_left", "open_right")
        return gantry(), {
            "stopping": STOPPING,
            "home": dict(zip(names, self.home.tolist(), strict=True)),
            "gripper": Gripper(
                link="hand", fingers=("left", "right"), coarse=self.coarse
            ),
        }

    def travel(self, tool: Tool) -> float:
        """Height of a hand that carries something above everything [m]."""
        solids = [*self.objects.values(), *self.fixtures.values()]
        top = max(float(s.at[2] + s.half[2]) for s in solids)
        return top + tool.tips + HAND[2] + ABOVE


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


def cluttered(
    rng: np.random.Generator, tool: Tool = GANTRY
) -> tuple[Workplace, str, Floats]:
    """A table with clutter, the object that is intended, and a free place for it.

    Args:
        rng: Draws them.
        tool: What grips it.

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
        target = objects[name]
        rest = [s for n, s in objects.items() if n != name] + walls
        clear = [w for w in walls if all(gaps(w, o) >= ROOM for o in objects.values())]
        goal = rng.uniform(-FIELD, FIELD, 2)
        if clear != walls or not tool.is_free(target, target.at[:2], rest):
            continue
        if not tool.is_free(target, goal, rest):
            continue
        fixtures = {f"wall{k}": wall for k, wall in enumerate(walls)}
        fixtures["table"] = table()
        home = np.array([*rng.uniform(-FIELD, FIELD, 2), 0.0, 0.03, 0.03])
        place = Workplace(objects, fixtures, home=home, **settings(rng))
        home[2] = place.travel(tool)
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
    """Objects on a table in two rows, 20 mm beside each other along x and along y."""
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
