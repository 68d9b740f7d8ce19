"""Pictures of capsules, spheres and boxes by casting a ray through every pixel.

MuJoCo casts them: exact outlines and smooth shading without a mesh. A light from above
throws shadows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from arrays import Floats, Ints
from peers.mujoco_margin import GEOM, quaternion_of

# Where the light comes from, world [-].
LIGHT = np.array([-0.64, -0.24, 0.73])
LIGHT /= np.linalg.norm(LIGHT)

# Share of the light that reaches a surface from all sides [-].
AMBIENT = 0.66

# Where shadow rays start [m], and by how much nearer than a surface they meet what
# throws a shadow on it [m].
SUN, LIFT = 1e3 * LIGHT, 1e-4

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


# Kinds of geoms by the number of a solid's sizes.
KINDS = {1: GEOM.mjGEOM_SPHERE, 2: GEOM.mjGEOM_CAPSULE, 3: GEOM.mjGEOM_BOX}


class Rays:
    """Rays at solids."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        spec = mujoco.MjSpec()
        for solid in solids:
            size = np.zeros(3)
            size[: len(solid.size)] = 0.5 * np.array(solid.size)
            if len(solid.size) < 3:
                size[0] = solid.size[0]
            at = {"pos": solid.middle, "quat": quaternion_of(solid.rotation)}
            kind = KINDS[len(solid.size)]
            spec.worldbody.add_geom(type=kind, size=size, **at)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)

    def cast(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats, Ints]:
        """Where rays enter.

        Args:
            origin: Where they start, shape (3,) [m].
            ray: Unit directions, shape (n, 3).

        Returns:
            Distance along each ray, infinite where it misses, shape (n,) [m]; outward
            unit normal there, shape (n, 3); number of the solid, shape (n,).
        """
        far, normals = np.zeros(len(ray)), np.zeros(ray.size)
        solids = np.zeros(len(ray), dtype=np.int32)
        mujoco.mj_multiRay(
            self._model, self._data, origin, ray.ravel(), None, True, -1, solids, far,
            normals, len(ray), mujoco.mjMAXVAL,
        )  # fmt: skip
        far[solids < 0] = np.inf
        return far, normals.reshape(-1, 3), solids


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
    shells = [(solid, Rays([solid])) for solid in solids if solid.shell]
    rays, paint = Rays(opaque), np.array([solid.colour for solid in opaque])
    rows = [
        colours_of(rays, paint, shells, camera.eye, camera.rays(row))
        for row in range(camera.height_px * SAMPLES)
    ]
    fine = np.array(rows).reshape(
        camera.height_px, SAMPLES, camera.width_px, SAMPLES, 3
    )
    return np.asarray(fine.mean(axis=(1, 3)))


def colours_of(
    rays: Rays,
    paint: Floats,
    shells: Sequence[tuple[Solid, Rays]],
    eye: Floats,
    ray: Floats,
) -> Floats:
    """Colours seen along rays from the eye, shape (n, 3).

    Args:
        rays: Rays at all that is opaque.
        paint: Colours of that, shape (k, 3).
        shells: What is seen through, each with rays at it.
        eye: Where rays start [m].
        ray: Unit directions, shape (n, 3).
    """
    far, normals, solids = rays.cast(eye, ray)
    seen = solids >= 0
    colours = np.ones_like(ray)
    colours[seen] = paint[solids[seen]]
    down = eye + far[seen, None] * ray[seen] - SUN
    distance = np.linalg.norm(down, axis=1)
    light = np.clip(normals[seen] @ LIGHT, 0.0, 1.0)
    lit = rays.cast(SUN, down / distance[:, None])[0]
    light[lit < distance - LIFT] = 0.0
    sky = AMBIENT * (0.88 + 0.12 * normals[seen, 2])
    colours[seen] *= (sky + (1.0 - AMBIENT) * light)[:, None]
    for shell, own in shells:
        distance, normal, _ = own.cast(eye, ray)
        front = distance < far
        # Like glass: the rim, seen at a slant, hides more than the middle.
        slant = 1.0 - np.abs(np.sum(normal[front] * ray[front], axis=1))
        cover = (0.16 + 0.60 * slant**2)[:, None]
        colours[front] = (1.0 - cover) * colours[front] + cover * np.array(shell.colour)
    return colours
