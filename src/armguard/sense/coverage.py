"""Parts of links that no sensor sees, and the largest body that can hide there.

The surface of a link is sampled by the nearest points of a grid around each of its
shapes. The nearest point of a convex shape moves no farther than the grid point does,
so no point of the surface is farther than `1 / √2` of the grid's edge from a sample.
"""

from collections.abc import Iterator
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import shape_row
from armguard.geometry.shapes.registry import Shape
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.sensors import SceneSensor
from armguard.sense.eye import Eye, unseen
from armguard.sense.patches import connected, extent, near
from armguard.sense.ranging import AT_SURFACE, cast, nearest, touching
from armguard.sense.view import View
from armguard.sense.world import balls_about

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Size above which a patch is named [m].
LEAST = 0.02

# Edge of the grid about a shape, and of its parts near patches of a size that is not
# decided by it [m].
EDGE, FINE = 0.004, 0.0003

# Distance of the grid from the box about a shape [m].
ASIDE = 0.005

# Samples of a patch at which bodies are tried, and the greatest diameter of these [m].
TRIED, FAR = 100, 100.0

# Forms of sensors whose view is known, and which measure distances.
SEEING = ("zones", "image", "beam", "infrared")


class Patch(NamedTuple):
    """A part of a link's surface that no sensor sees.

    Attributes:
        link: 'robot/link'.
        size: Largest distance of two of its points [m].
        body: Diameter of the largest ball that touches it and that no sensor sees;
            infinite if no sensor bounds it [m].
        centre: Mean of its points in the frame of the link, shape (3,) [m].
        facing: Its mean normal in the frame of the link, a unit vector, shape (3,).
        points: Samples of it in the frame of the link, shape (n, 3) [m].
    """

    link: str
    size: float
    body: float
    centre: Floats
    facing: Floats
    points: Floats


class Coverage(NamedTuple):
    """What the sensors of a scene see about its links.

    Attributes:
        standoff: Distance from the surface at which a body has to be seen [m].
        seen: Share of each link's surface before which it is seen, by 'robot/link' [-].
        patches: Patches larger than the least size, the largest first.
    """

    standoff: float
    seen: dict[str, float]
    patches: tuple[Patch, ...]


class Samples(NamedTuple):
    """Points of the surface of one shape.

    Attributes:
        point: The points, shape (n, 3) [m].
        normal: Unit normals, outwards, shape (n, 3).
        grid: Points of the grid whose nearest points they are, shape (n, 3) [m].
        across: Directions of the grid, shape (n, 2, 3).
    """

    point: Floats
    normal: Floats
    grid: Floats
    across: Floats

    def of(self, chosen: Bools | Ints) -> "Samples":
        """Some of them."""
        return Samples(*(part[chosen] for part in self))


def coverage(
    scene: Scene,
    q: ArrayLike | None = None,
    *,
    standoff: float | None = None,
    least: float = LEAST,
) -> Coverage:
    """Find the parts of the links that no sensor sees.

    A point of a surface is seen if the point before it, at the standoff along its
    normal, is in the view of a sensor, within the distance at which this surely sees
    `sensing.intruder.size`, and no link or object is between them. Where a link or an
    object is nearer than twice the standoff, the middle of the gap has to be seen; a
    gap of less than `least` counts as seen. Links are their primitives; points in other
    shapes have no part in it.
    Of clouds the view is not known, and pads measure no distance: they see nothing.
    SciPy finds which points are connected: the extra `meshes` brings it.

    Args:
        scene: The scene, with sensors and a sensed space.
        q: Joint positions, shape (n,) [rad or m]; home by default.
        standoff: That distance [m]; by default `reflex.distance`, or without a reflex
            the least distance at which a sensor surely sees that size.
        least: Size above which a patch is named [m]. A blind disc of that diameter is
            always named, one of a millimetre less never. Patches nearer to each other
            than 14 mm may count as one.
    """
    assert scene.sensing is not None
    body = scene.sensing.intruder.size
    eyes = [one for one in scene.sensors.values() if one.form in SEEING]
    views = {one.name: View(one, body, scene.sensing.cell).reach for one in eyes}
    if standoff is None:
        reach = min(views.values(), default=body)
        standoff = scene.reflex.distance if scene.reflex is not None else reach
    look = Look(scene, np.asarray(scene.home if q is None else q, np.float64))
    look.eyes = [Eye(one, look.frame_of(one), views[one.name]) for one in eyes]
    look.standoff, look.least = standoff, least
    seen, patches = {}, list[Patch]()
    for link in dict.fromkeys(filter(None, look.links)):
        seen[link], found = look.link(link)
        patches += found
    patches.sort(key=lambda one: -one.size)
    return Coverage(standoff, seen, tuple(patches))


class Look:
    """Links and objects of a scene at joint positions, and what is seen of them.

    Attributes:
        links: 'robot/link' of each shape, "" for objects.
        eyes: The sensors.
        standoff: Distance from the surface at which a body has to be seen [m].
        least: Size above which a patch is named [m].

    Args:
        scene: The scene.
        q: Joint positions [rad or m].
    """

    eyes: list[Eye]
    standoff: float
    least: float

    def __init__(self, scene: Scene, q: Floats) -> None:
        t = compile_scene(scene)
        T = np.zeros((len(t.parent), 12))
        forward_kinematics(
            q, t.parent, t.joint_kind, t.q_index, t.gain, t.T_parent_joint, t.axis, T
        )
        self._T = {"": np.eye(4)}
        for link, frame in t.links.items():
            self._T[link] = np.eye(4)
            if frame.body >= 0:
                self._T[link][:3] = T[frame.body].reshape(3, 4)
            self._T[link] = self._T[link] @ frame.T_body_link
        found = list(self._shapes_of(scene))
        self.links = [link for link, _, _ in found]
        # Rows of hulls have the addresses of their vertices, so their shapes are kept.
        self._shapes = [shape for _, shape, _ in found]
        self._kinds = np.array([int(one.kind) for one in self._shapes], dtype=np.int32)
        self._rows = np.array([shape_row(shape, T) for _, shape, T in found])
        self._balls = balls_about(self._kinds, self._rows)
        self._seen: tuple[Floats, Floats, Floats] | None = None

    def _shapes_of(self, scene: Scene) -> Iterator[tuple[str, Shape, Floats]]:
        """Link, shape and frame in the world of all shapes."""
        for link in self._T:
            if not link:
                continue
            robot, name = link.split("/", 1)
            fit = scene.robots[robot].fits.get(name)
            for placed in fit.shapes if fit is not None else ():
                yield link, placed.shape, self._T[link] @ placed.pose.matrix()
        for item in scene.objects.values():
            T = self._T[item.attached_to or ""] @ item.pose.matrix()
            for placed in item.shapes if item.present else ():
                yield "", placed.shape, T @ placed.pose.matrix()

    def frame_of(self, sensor: SceneSensor) -> Floats:
        """Frame of a sensor in the world, shape (4, 4)."""
        return np.asarray(self._T[sensor.on or ""] @ sensor.pose.matrix())

    def link(self, link: str) -> tuple[float, list[Patch]]:
        """Share of a link's surface that is seen, and its patches."""
        own = [i for i, name in enumerate(self.links) if name == link]
        parts = [(i, self._outer(i, self._sampled(i))) for i in own]
        blind = [(i, some.of(self._blind(some))) for i, some in parts]
        total = sum(len(some.point) for _, some in parts)
        missing = sum(len(some.point) for _, some in blind)
        share = 1.0 - missing / total if total else 1.0
        points = np.concatenate([some.point for _, some in blind])
        normals = np.concatenate([some.normal for _, some in blind])
        labels = connected(points, EDGE)
        found = list[tuple[Floats, Floats]]()
        small = np.zeros(len(points), dtype=np.bool_)
        for label in range(labels.max(initial=-1) + 1):
            chosen = labels == label
            if extent(points[chosen]) > self.least:
                found.append((points[chosen], normals[chosen]))
            else:
                small |= chosen
        large = points[~small]
        for i, some in parts if small.any() else ():
            close = near(some.point, points[small], 2.0 * EDGE)
            if not close.any():
                continue
            fine = self._outer(i, self._finer(i, some.of(close)))
            fine = fine.of(self._blind(fine))
            labels = connected(fine.point, FINE)
            beside = near(fine.point, large, 2.0 * EDGE)
            for label in range(labels.max(initial=-1) + 1):
                chosen = labels == label
                # A sample may be missing at each end, by twice the way to the next one.
                decided = self.least - 2.0 * sqrt(2.0) * FINE
                if not beside[chosen].any() and extent(fine.point[chosen]) >= decided:
                    found.append((fine.point[chosen], fine.normal[chosen]))
        return share, [self._patch(link, *one) for one in found]

    def _patch(self, link: str, points: Floats, normals: Floats) -> Patch:
        """A patch of these points."""
        T, mean = self._T[link], normals.mean(axis=0)
        facing = mean / max(float(np.linalg.norm(mean)), 1e-9)
        local = (points - T[:3, 3]) @ T[:3, :3]
        return Patch(
            link,
            extent(points),
            self._largest(points, normals),
            local.mean(axis=0),
            facing @ T[:3, :3],
            local,
        )

    def _sampled(self, i: int) -> Samples:
        """Samples of a shape, by the grid on all sides of a box about it."""
        box = np.zeros(6)
        row_bounds(int(self._kinds[i]), self._rows[i], ASIDE, box)
        low, high = box[:3], box[3:]
        grids, ways = [], []
        for k in range(3):
            u, v = (k + 1) % 3, (k + 2) % 3
            lines = [
                np.linspace(
                    low[n], high[n], int(np.ceil((high[n] - low[n]) / EDGE)) + 1
                )
                for n in (u, v)
            ]
            a, b = (part.ravel() for part in np.meshgrid(*lines))
            for side in (low, high):
                grid = np.full((len(a), 3), side[k])
                grid[:, u], grid[:, v] = a, b
                grids.append(grid)
                ways.append(np.tile(np.eye(3)[[u, v]], (len(a), 1, 1)))
        return self._nearest(i, np.concatenate(grids), np.concatenate(ways))

    def _finer(self, i: int, some: Samples) -> Samples:
        """The samples of a finer grid about those of some samples."""
        parts = int(np.ceil(EDGE / FINE))
        steps = (np.arange(parts) + 0.5) / parts - 0.5
        shift = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2) * EDGE
        grid = some.grid[:, None] + (shift @ some.across[:, None].reshape(
            len(some.grid), 1, 2, 3)).reshape(len(some.grid), -1, 3)  # fmt: skip
        ways = np.repeat(some.across, len(shift), axis=0)
        return self._nearest(i, grid.reshape(-1, 3), ways)

    def _nearest(self, i: int, grid: Floats, ways: Floats) -> Samples:
        """The nearest points of a shape to points of its grid."""
        found, own = np.zeros((len(grid), 4)), slice(i, i + 1)
        nearest(grid, self._kinds[own], self._rows[own], self._balls[own], 1e9, found)
        point = grid - found[:, :1] * found[:, 1:]
        return Samples(point, found[:, 1:].copy(), grid, ways)

    def _outer(self, i: int, some: Samples) -> Samples:
        """The samples of a shape that are in no other shape."""
        others, found = np.arange(len(self.links)) != i, np.zeros((len(some.point), 4))
        nearest(
            some.point, self._kinds[others], self._rows[others], self._balls[others],
            AT_SURFACE, found,
        )  # fmt: skip
        return some.of(~(found[:, 0] < AT_SURFACE))

    def _cast(self, origin: Floats, ways: Floats, reach: float) -> Floats:
        """Distances at which rays from a point enter a shape, infinite for none."""
        out = np.zeros((len(ways), 2))
        cast(origin, ways, self._kinds, self._rows, self._balls, reach, out)
        return out[:, 0]

    def _gaps(self, points: Floats, normals: Floats, reach: float) -> Floats:
        """Distances from surfaces to the next shape along their normals [m]."""
        gaps = np.empty(len(points))
        for k, point in enumerate(points):
            gaps[k] = self._cast(point, normals[k : k + 1], reach)[0]
        return gaps

    def _blind(self, some: Samples) -> Bools:
        """Before which samples no sensor sees a body."""
        gap = self._gaps(some.point, some.normal, 2.0 * self.standoff)
        height = np.minimum(self.standoff, 0.5 * gap)
        probe = some.point + height[:, None] * some.normal
        blind = gap >= self.least
        for eye in self.eyes:
            left = np.flatnonzero(blind)
            left = left[eye.in_view(probe[left])]
            blind[left[~self._hidden(eye.origin, probe[left])]] = False
        return blind

    def _hidden(self, origin: Floats, points: Floats) -> Bools:
        """Which points a shape hides from a place; one that the place is in does not.

        Rays count as met a little before a surface and beside it, so those that are met
        are measured as segments.
        """
        ways = points - origin
        far = np.linalg.norm(ways, axis=1)
        ways /= far[:, None]
        met = self._cast(origin, ways, float(far.max(initial=0.0))) < far
        apart = np.zeros((len(self.links), 4))
        for i in range(len(apart)):
            own = slice(i, i + 1)
            nearest(
                origin[None], self._kinds[own], self._rows[own], self._balls[own], FAR,
                apart[own],
            )  # fmt: skip
        others = apart[:, 0] > AT_SURFACE
        across = np.eye(3)[np.abs(ways[met]).argmin(axis=1)]
        side = np.cross(ways[met], across)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        rows = np.zeros((len(side), 16))
        rows[:, 1:4], rows[:, 6] = 0.5 * (points[met] + origin), 0.5 * far[met]
        axes = side, np.cross(ways[met], side), ways[met]
        rows[:, 7:16] = np.stack(axes, axis=2).reshape(-1, 9)
        touched = np.zeros(len(rows), dtype=np.bool_)
        touching(
            rows, self._kinds[others], self._rows[others], self._balls[others], touched
        )
        met[met] = touched
        return np.asarray(met)

    def _looks(self) -> tuple[Floats, Floats, Floats]:
        """Origins, directions and lengths of rays of all sensors, to what they meet."""
        if self._seen is None:
            origins, ways, lengths = (
                [np.zeros((0, 3))],
                [np.zeros((0, 3))],
                [np.zeros(0)],
            )
            for eye in self.eyes:
                rays = eye.rays()
                far = np.linalg.norm(rays, axis=1)
                ways.append(rays / far[:, None])
                first = self._cast(eye.origin, ways[-1], float(far.max()))
                lengths.append(np.minimum(first, far))
                origins.append(np.tile(eye.origin, (len(rays), 1)))
            self._seen = (
                np.concatenate(origins), np.concatenate(ways), np.concatenate(lengths),
            )  # fmt: skip
        return self._seen

    def _largest(self, points: Floats, normals: Floats) -> float:
        """Diameter of the largest ball that touches one of some points unseen [m]."""
        origins, ways, lengths = self._looks()
        some = np.arange(0, len(points), -(-len(points) // TRIED))
        gaps = self._gaps(points[some], normals[some], FAR)
        return max(
            min(float(gap), unseen(origins - points[k], ways, lengths, normals[k]))
            for k, gap in zip(some, gaps, strict=True)
        )
