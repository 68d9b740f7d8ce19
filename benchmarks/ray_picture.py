"""Pictures of capsules, spheres and boxes by casting a ray through every pixel.

Exact outlines and smooth shading without a mesh; a light from above throws shadows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from arrays import Floats

# Where the light comes from, world [-].
LIGHT = np.array([-0.64, -0.24, 0.73])
LIGHT /= np.linalg.norm(LIGHT)

# Share of the light that reaches a surface from all sides [-].
AMBIENT = 0.66

# A shadow ray starts this far above its surface, lest it meet it again [m].
LIFT = 1e-4

# Rays in each direction through one pixel; their mean smooths the outlines.
SAMPLES = 2


@dataclass(frozen=True)
class Solid:
    """Something to draw.

    Attributes:
        size: Radius and axis length of a capsule along z, radius of a sphere, or the
            full sizes of a box [m].
        rotation: Its axes in the world, shape (3, 3).
        middle: Its middle in the world [m].
        colour: Red, green, blue in [0, 1].
        shell: Seen through, as a buffer is; it throws no shadow.
    """

    size: tuple[float, ...]
    rotation: Floats
    middle: Floats
    colour: tuple[float, float, float]
    shell: bool = False

    def hit(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats]:
        """Where rays enter.

        Args:
            origin: Starts, shape (n, 3) [m].
            ray: Unit directions, shape (n, 3).

        Returns:
            Distance along each ray, infinite where it misses, shape (n,) [m]; outward
            unit normal there, shape (n, 3).
        """
        o, d = (origin - self.middle) @ self.rotation, ray @ self.rotation
        far, normals = np.full(len(o), np.inf), np.zeros_like(o)
        # Only rays that meet the sphere around the solid are looked at.
        along = -np.sum(o * d, axis=1)
        near = np.sum(o * o, axis=1) - along * along <= self.reach**2
        if near.any():
            enter = box_hit if len(self.size) == 3 else capsule_hit
            far[near], local = enter(self.size, o[near], d[near])
            normals[near] = local @ self.rotation.T
        return far, normals

    @cached_property
    def reach(self) -> float:
        """Distance from the middle to the farthest point [m]."""
        if len(self.size) == 3:
            return float(np.linalg.norm(self.size)) / 2
        return self.size[0] + sum(self.size[1:]) / 2


def capsule_hit(size: tuple[float, ...], o: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Rays into a capsule about the origin, along z; without length, a sphere."""
    radius, half = size[0], sum(size[1:]) / 2
    far = np.full(len(o), np.inf)
    flat = d[:, 0] ** 2 + d[:, 1] ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        across = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1]
        outside = o[:, 0] ** 2 + o[:, 1] ** 2 - radius**2
        side = (-across - np.sqrt(across**2 - flat * outside)) / flat
        valid = (side > 0.0) & (np.abs(o[:, 2] + side * d[:, 2]) <= half)
    far[valid] = side[valid]
    for end in (-half, half):
        p = o - (0.0, 0.0, end)
        along = np.sum(p * d, axis=1)
        with np.errstate(invalid="ignore"):
            cap = -along - np.sqrt(along**2 - np.sum(p * p, axis=1) + radius**2)
        valid = (cap > 0.0) & (cap < far)
        far[valid] = cap[valid]
    hits = np.isfinite(far)
    normals = np.zeros_like(o)
    points = o[hits] + far[hits, None] * d[hits]
    points[:, 2] -= np.clip(points[:, 2], -half, half)
    normals[hits] = points / radius
    return far, normals


def box_hit(size: tuple[float, ...], o: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Rays into a box about the origin."""
    half = np.array(size) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        enter = (-np.sign(d) * half - o) / d
        leave = (np.sign(d) * half - o) / d
    first, last = enter.max(axis=1), leave.min(axis=1)
    far = np.where((first > 0.0) & (first <= last), first, np.inf)
    face = enter.argmax(axis=1)
    rows = np.arange(len(o))
    normals = np.zeros_like(o)
    normals[rows, face] = -np.sign(d[rows, face])
    return far, normals


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from.

    Attributes:
        centre: What it looks at, world [m].
        azimuth: Of the eye as seen from there, about z, from x [deg].
        elevation: Of the eye, above the horizon [deg].
        distance: From the centre to the eye [m].
        height: What the picture shows at the centre, from bottom to top [m].
        width_px: Width of the picture [pixels].
        height_px: Height of the picture [pixels].
    """

    centre: tuple[float, float, float]
    azimuth: float
    elevation: float
    distance: float
    height: float
    width_px: int
    height_px: int

    @property
    def axes(self) -> Floats:
        """Right, up and backwards, unit rows, shape (3, 3)."""
        a, e = np.radians((self.azimuth, self.elevation))
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.cross((0.0, 0.0, 1.0), back)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(back, right), back], dtype=np.float64)

    @property
    def eye(self) -> Floats:
        """Where all rays start, world [m]."""
        return np.asarray(np.array(self.centre) + self.distance * self.axes[2])

    def pixel(self, point: Floats) -> tuple[float, float]:
        """Column and row at which a point of the world is seen [pixels]."""
        right, up, back = self.axes @ (point - self.eye)
        scale = self.height_px / self.height * self.distance / -back
        return (
            self.width_px / 2 - 0.5 + scale * right,
            self.height_px / 2 - 0.5 - scale * up,
        )

    def rays(self, row: int) -> Floats:
        """Unit directions through a row of fine pixels, shape (n, 3)."""
        fine = self.height / (self.height_px * SAMPLES)
        x = np.arange(self.width_px * SAMPLES) + 0.5 - self.width_px * SAMPLES / 2
        y = self.height_px * SAMPLES / 2 - row - 0.5
        local = np.column_stack(
            (x * fine, np.full_like(x, y * fine), np.full_like(x, -self.distance))
        )
        world = local @ self.axes
        return np.asarray(world / np.linalg.norm(world, axis=1, keepdims=True))


def render(solids: Sequence[Solid], camera: Camera) -> Floats:
    """The picture on white, shape (height_px, width_px, 3), in [0, 1]."""
    opaque = [solid for solid in solids if not solid.shell]
    shells = [solid for solid in solids if solid.shell]
    rows = [
        cast(opaque, shells, camera.eye, camera.rays(row))
        for row in range(camera.height_px * SAMPLES)
    ]
    fine = np.array(rows).reshape(
        camera.height_px, SAMPLES, camera.width_px, SAMPLES, 3
    )
    return np.asarray(fine.mean(axis=(1, 3)))


def cast(
    opaque: Sequence[Solid], shells: Sequence[Solid], eye: Floats, ray: Floats
) -> Floats:
    """Colours seen along rays, shape (n, 3)."""
    origin = np.broadcast_to(eye, ray.shape)
    far, normals = np.full(len(ray), np.inf), np.zeros_like(ray)
    colours = np.ones_like(ray)
    for solid in opaque:
        distance, normal = solid.hit(origin, ray)
        nearer = distance < far
        far[nearer], normals[nearer] = distance[nearer], normal[nearer]
        colours[nearer] = solid.colour
    seen = np.isfinite(far)
    points = origin[seen] + far[seen, None] * ray[seen]
    light = np.clip(normals[seen] @ LIGHT, 0.0, 1.0)
    start = points + LIFT * normals[seen]
    towards = np.broadcast_to(LIGHT, start.shape)
    for solid in opaque:
        light[np.isfinite(solid.hit(start, towards)[0])] = 0.0
    sky = AMBIENT * (0.88 + 0.12 * normals[seen, 2])
    colours[seen] *= (sky + (1.0 - AMBIENT) * light)[:, None]
    for shell in shells:
        distance, normal = shell.hit(origin, ray)
        front = distance < far
        # Like glass: the rim, seen at a slant, hides more than the middle.
        slant = 1.0 - np.abs(np.sum(normal[front] * ray[front], axis=1))
        cover = (0.16 + 0.60 * slant**2)[:, None]
        colours[front] = (1.0 - cover) * colours[front] + cover * np.array(shell.colour)
    return colours
