"""Unknown planar worlds: random polygons, an arm with a skin, and whether a way exists.

Distances are those of segments to segments; the search for ways is by a grid of the
joint torus. Neither shares code with the follower.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from armguard.geometry import Capsule, Pose
from armguard.respond.following import PlanarArm
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ARMS = {
    "two links": PlanarArm((0.6, 0.5), 0.05),
    "third prismatic": PlanarArm((0.5, 0.4), 0.05, travel=0.3),
}

# Distance at which surfaces are followed [m].
STANDOFF = 0.125

# Clearance of a way that is sure to exist between neighbouring nodes of the grid, and
# what is taken from the radius of the arm to be sure that none exists [m].
SURE, THINNER = 0.16, 0.03

# Starts and goals that are tried in a world.
PAIRS = 40

# How far a prismatic joint may go beyond its travel, so that no limit slows it [m].
BEYOND = 0.1

# Nodes of the grid for each joint.
NODES = {"two links": (180, 180), "third prismatic": (120, 120, 7)}

# A module has two fans of eight zones. Half the angle of a fan, the way from module to
# module along a link [m], the range [m], and the noise of a distance d, a + b d.
FAN, PITCH, RANGE, NOISE = np.radians(22.5), 0.08, 0.35, (0.002, 0.006)
ZONES = 8


class World(NamedTuple):
    """Polygons in the plane of an arm, and a start and a goal.

    Attributes:
        parts: Convex polygons, each of shape (n, 2), counter-clockwise [m].
        start: Joint positions, shape (2,) or (3,) [rad or m].
        goal: Joint positions, of that shape.
    """

    parts: list[Floats]
    start: Floats
    goal: Floats

    @property
    def edges(self) -> Floats:
        """Edges of all polygons, shape (e, 2, 2) [m]."""
        rings = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in self.parts]
        return np.concatenate(rings)


def links_of(arm: PlanarArm, q: Floats) -> Floats:
    """Axes of the links, shape (..., 2, 2, 2): link, end, coordinate [m]."""
    second = q[..., 0] + q[..., 1]
    reach = arm.lengths[1] + (q[..., 2] if arm.travel else 0.0 * second)
    elbow = arm.lengths[0] * np.stack([np.cos(q[..., 0]), np.sin(q[..., 0])], -1)
    tip = elbow + reach[..., None] * np.stack([np.cos(second), np.sin(second)], -1)
    first = np.stack([np.zeros_like(elbow), elbow], axis=-2)
    return np.stack([first, np.stack([elbow, tip], axis=-2)], axis=-3)


def distances(arm: PlanarArm, q: Floats, parts: list[Floats]) -> Floats:
    """Distances of the arm to polygons at joint positions (k, n), shape (k,) [m].

    They are minus the radius where an axis of a link meets a polygon.
    """
    rings = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in parts]
    sizes = np.cumsum([0, *map(len, rings)])
    found = np.empty(len(q))
    to_parts(links_of(arm, q), np.concatenate(rings), sizes, found)
    return found - arm.radius


@numba.njit(cache=True)
def aside(a: Floats, b: Floats, c: Floats) -> float:
    """Twice the area of a triangle, positive if c is to the left of a b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@numba.njit(cache=True)
def gap(p: Floats, a: Floats, b: Floats) -> float:
    """Distance of a point to a segment [m]."""
    x, y = b[0] - a[0], b[1] - a[1]
    share = ((p[0] - a[0]) * x + (p[1] - a[1]) * y) / (x * x + y * y)
    share = min(max(share, 0.0), 1.0)
    return np.hypot(p[0] - a[0] - share * x, p[1] - a[1] - share * y)


@numba.njit(cache=True)
def to_parts(axes: Floats, edges: Floats, sizes: Ints, out: Floats) -> None:
    """Distances of segments to convex polygons, by all their edges.

    Args:
        axes: Segments of each arm, shape (k, 2, 2, 2) [m].
        edges: Edges of all polygons, counter-clockwise, shape (e, 2, 2) [m].
        sizes: Number of the first edge of each polygon, and of all edges.
        out: Distances, 0 where a segment meets a polygon; overwritten, shape (k,).
    """
    for k in range(len(axes)):
        out[k] = np.inf
        for link in range(2):
            a, b = axes[k, link]
            for part in range(len(sizes) - 1):
                inside = True
                for e in range(sizes[part], sizes[part + 1]):
                    c, d = edges[e]
                    inside &= aside(c, d, b) > 0.0
                    crossed = aside(a, b, c) * aside(a, b, d) < 0.0
                    if crossed and aside(c, d, a) * aside(c, d, b) < 0.0:
                        out[k] = 0.0
                    ends = min(gap(c, a, b), gap(d, a, b), gap(a, c, d), gap(b, c, d))
                    out[k] = min(out[k], ends)
                if inside:
                    out[k] = 0.0


def grid_of(name: str) -> Floats:
    """Joint positions of the nodes of the grid, shape (..., n)."""
    arm, nodes = ARMS[name], NODES[name]
    axes = [np.arange(n) * 2.0 * np.pi / n for n in nodes[:2]]
    axes += [np.linspace(0.0, arm.travel, n) for n in nodes[2:]]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def clearances(name: str, parts: list[Floats]) -> Floats:
    """Distances at the nodes of the grid [m]."""
    grid = grid_of(name)
    flat = grid.reshape(-1, grid.shape[-1])
    return distances(ARMS[name], flat, parts).reshape(grid.shape[:-1])


def regions(free: Bools) -> Ints:
    """Connected regions of the grid, numbered from 1; both angles are periodic."""
    labels, count = ndimage.label(free)
    joined = np.arange(count + 1)

    def root(k: int) -> int:
        while joined[k] != k:
            k = joined[k]
        return k

    for axis in (0, 1):
        first, last = labels.take(0, axis=axis), labels.take(-1, axis=axis)
        for a, b in np.unique(np.stack([first.ravel(), last.ravel()], 1), axis=0):
            if a and b:
                joined[root(a)] = root(b)
    return np.asarray(np.array([root(k) for k in range(count + 1)])[labels])


def polygon(rng: np.random.Generator, middle: Floats, size: float) -> list[Floats]:
    """An obstacle in convex parts: a convex polygon, an L, or a U."""
    turn = rng.uniform(0.0, 2.0 * np.pi)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    kind = rng.integers(0, 3)
    if kind == 0:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, rng.integers(4, 8)))
        shape = size * np.stack([np.cos(angles), np.sin(angles)], 1)
        return [middle + shape * (1.0, rng.uniform(0.4, 1.0)) @ R.T]
    wall = rng.uniform(0.15, 0.35) * size
    high = [1.0, 1.0] if kind == 2 else [1.0]
    boxes = [((-size, -size), (size, -size + wall))]
    boxes += [((-size, -size), (-size + wall, size * high[0]))]
    if kind == 2:
        boxes += [((size - wall, -size), (size, size * rng.uniform(0.2, 1.0)))]
    return [
        middle + np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) @ R.T
        for (x0, y0), (x1, y1) in boxes
    ]


def random_parts(rng: np.random.Generator, reach: float, dense: bool) -> list[Floats]:
    """Polygons about an arm, not too near to its first joint."""
    parts: list[Floats] = []
    while not parts or rng.random() < (0.85 if dense else 0.7):
        angle, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.05, 0.2)
        far = rng.uniform(0.35, reach + 0.1)
        some = polygon(rng, far * np.array([np.cos(angle), np.sin(angle)]), size)
        near = min(
            gap(np.zeros(2), e, f)
            for p in some
            for e, f in zip(p, np.roll(p, -1, axis=0), strict=True)
        )
        if near > 0.05 + SURE + 0.03:
            parts += some
    return parts


def world(name: str, seed: int, reachable: bool) -> World:
    """A world whose goal is surely reachable at the standoff, or surely not at all."""
    arm, grid = ARMS[name], grid_of(name)
    for trial in range(1_000):
        rng = np.random.default_rng((seed, trial, reachable, len(name)))
        parts = random_parts(rng, sum(arm.lengths) + arm.travel, not reachable)
        gaps = clearances(name, parts)
        ample = np.argwhere(gaps > SURE)
        if len(ample) < PAIRS:
            continue
        labels = regions(gaps > (SURE if reachable else -THINNER))
        ends = ample[rng.choice(len(ample), (PAIRS, 2))]
        for start, goal in ends:
            one = World(parts, grid[tuple(start)], grid[tuple(goal)])
            joined = labels[tuple(start)] == labels[tuple(goal)]
            if joined == reachable and (not reachable or is_blocked(arm, one)):
                return one
    raise AssertionError("no such world was found")


def is_blocked(arm: PlanarArm, one: World) -> bool:
    """Whether the straight way in joint space comes nearer than the standoff."""
    way = (one.goal - one.start + np.pi) % (2.0 * np.pi) - np.pi
    way[2:] = (one.goal - one.start)[2:]
    line = one.start + np.linspace(0.0, 1.0, 100)[:, None] * way
    return bool(distances(arm, line, one.parts).min() <= STANDOFF)


def skin(arm: PlanarArm, q: Floats) -> tuple[Floats, Floats]:
    """Origins and directions of the zones of all modules, shapes (n, 2) [m]."""
    slopes = FAN * (2.0 * (np.arange(ZONES) + 0.5) / ZONES - 1.0)
    axes = links_of(arm, q)
    origins, ways = [], []

    def fan(origin: Floats, angle: float) -> None:
        angles = angle + slopes
        origins.append(np.tile(origin, (ZONES, 1)))
        ways.append(np.stack([np.cos(angles), np.sin(angles)], axis=1))

    for a, b in axes:
        along = (b - a) / np.linalg.norm(b - a)
        angle = float(np.arctan2(along[1], along[0]))
        length = float(np.linalg.norm(b - a))
        # Modules of a link that slides out of another ride on its end.
        places = length - PITCH * np.arange(0.5, (length + arm.travel) / PITCH)
        for place in places[places > 0.0]:
            for side in (0.5 * np.pi, -0.5 * np.pi):
                out = np.array([np.cos(angle + side), np.sin(angle + side)])
                fan(a + place * along + arm.radius * out, angle + side)
        for turn in np.radians([-67.5, -22.5, 22.5, 67.5]):
            out = np.array([np.cos(angle + turn), np.sin(angle + turn)])
            fan(b + arm.radius * out, angle + turn)
    return np.concatenate(origins), np.concatenate(ways)


def sensed(
    arm: PlanarArm, q: Floats, edges: Floats, rng: np.random.Generator
) -> Floats:
    """Points that the zones see, each at its noisy distance, shape (m, 2) [m]."""
    origins, ways = skin(arm, q)
    a, way = edges[:, 0], edges[:, 1] - edges[:, 0]
    apart = a - origins[:, None]
    cross = ways[:, None, 0] * way[:, 1] - ways[:, None, 1] * way[:, 0]
    cross = np.where(np.abs(cross) < 1e-12, 1e-12, cross)
    far = (apart[..., 0] * way[:, 1] - apart[..., 1] * way[:, 0]) / cross
    share = apart[..., 0] * ways[:, None, 1] - apart[..., 1] * ways[:, None, 0]
    share /= cross
    met = (share >= 0.0) & (share <= 1.0) & (far > 0.0) & (far <= RANGE)
    first = np.where(met, far, np.inf).min(axis=1)
    seen = np.isfinite(first)
    first = first[seen]
    first += (NOISE[0] + NOISE[1] * first) * rng.normal(size=len(first))
    return np.asarray(origins[seen] + first[:, None] * ways[seen])


def planar_robot(arm: PlanarArm) -> RobotModel:
    """The arm as a robot, whose first two joints turn without limits."""
    lengths = [*arm.lengths, *([0.0] if arm.travel else [])]
    links, joints = {"base": Link(name="base")}, {}
    above, before = "base", 0.0
    for k, length in enumerate(lengths):
        slides = k == 2
        # A link that slides rides on the end of the second one, and is all of it.
        start = -arm.lengths[1] if slides else 0.0
        shape = Capsule(start=(start, 0, 0), end=(length, 0, 0), radius=arm.radius)
        element = CollisionElement(geometry=shape, T_link_geometry=Pose().matrix())
        links[f"link{k}"] = Link(name=f"link{k}", collisions=(element,))
        joints[f"joint{k}"] = Joint(
            name=f"joint{k}",
            kind=JointKind.PRISMATIC if slides else JointKind.CONTINUOUS,
            parent=above, child=f"link{k}",
            T_parent_joint=Pose(xyz=(before, 0, 0)).matrix(),
            axis=np.array([1.0, 0.0, 0.0] if slides else [0.0, 0.0, 1.0]),
            lower=-BEYOND if slides else -np.inf,
            upper=arm.travel + BEYOND if slides else np.inf,
        )  # fmt: skip
        above, before = f"link{k}", length
    return RobotModel(name="arm", path=None, links=links, joints=joints, root="base")
