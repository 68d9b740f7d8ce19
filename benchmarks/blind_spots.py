"""Links with blind spots; MuJoCo's rays find the spots."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from armguard.geometry import Box, Capsule, Cylinder, Pose
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Plate: its edges, and the distance from its surface at which bodies are seen [m].
PLATE, PLATE_STANDOFF = (0.3, 0.3, 0.02), 0.05

# Capsule: radius and length, and that distance [m].
RADIUS, LENGTH, STANDOFF = 0.05, 0.3, 0.1

# Edge of the grid of the rays, on the capsule twice that [m].
GRID = 0.0005

# Width of the rim of a spot [m].
RIM = 0.004


class Spot(NamedTuple):
    """A connected part of a surface before which no ray of a sensor gets.

    Attributes:
        size: Largest distance of two of its points [m].
        points: Its points in the frame of the link, shape (n, 3) [m].
        core: Those farther than `RIM` from points that are seen, shape (k, 3) [m].
    """

    size: float
    points: Floats
    core: Floats


def one_link(shape: Box | Capsule) -> Scene:
    """A scene of one link of this shape, at the origin."""
    element = CollisionElement(geometry=shape, T_link_geometry=Pose().matrix())
    joint = Joint(
        name="joint", kind=JointKind.PRISMATIC, parent="base", child="link",
        T_parent_joint=Pose().matrix(), axis=np.array([0.0, 0.0, 1.0]),
        lower=0.0, upper=0.1,
    )  # fmt: skip
    links = {
        "base": Link(name="base"),
        "link": Link(name="link", collisions=(element,)),
    }
    model = RobotModel(
        name="one", path=None, links=links, joints={"joint": joint}, root="base"
    )
    scene = Scene(mode="path")
    scene.add_robot(model, "arm", stopping={"deceleration": 5.0, "velocity": 1.0})
    scene.set_sensing(
        region={"centre": (0, 0, 0), "size": 64}, cell=0.02, unknown="still",
        intruder={"speed": 0.0, "size": 0.05},
    )  # fmt: skip
    return scene


def plate(discs: list[tuple[float, float, float, float]], cameras: list[Pose]) -> Scene:
    """A plate below discs and depth cameras.

    Args:
        discs: Place of each, and its diameter [m].
        cameras: Frames of the cameras.
    """
    scene = one_link(Box(size=PLATE))
    for k, (x, y, z, diameter) in enumerate(discs):
        disc = Cylinder(radius=0.5 * diameter, height=0.001)
        scene.add(disc, f"disc{k}", pose=Pose(xyz=(x, y, z)))
    for k, pose in enumerate(cameras):
        scene.add_sensor(
            f"top{k}", kind="depth", size=(320, 320), focal=150, range=(0.1, 3.0),
            pose=pose,
        )  # fmt: skip
    return scene


def random_plate(rng: np.random.Generator) -> Scene:
    """A plate below one or two cameras and three to six discs."""
    discs = []
    for _ in range(rng.integers(3, 7)):
        x, y = rng.uniform(-0.11, 0.11, 2)
        discs.append((x, y, rng.uniform(0.13, 0.25), rng.uniform(0.012, 0.04)))
    cameras = [
        Pose(
            xyz=(*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.6, 1.0)), rpy=(np.pi, 0, 0)
        )
        for _ in range(rng.integers(1, 3))
    ]
    return plate(discs, cameras)


def random_capsule(rng: np.random.Generator) -> Scene:
    """A capsule with rings of arrays of zones."""
    scene = one_link(
        Capsule(start=(0, 0, -LENGTH / 2.0), end=(0, 0, LENGTH / 2.0), radius=RADIUS)
    )
    for k in range(rng.integers(2, 5)):
        scene.add_sensor(
            f"ring{k}", kind="tof", on="arm/link", view=tuple(rng.uniform(0.7, 1.8, 2)),
            range=(0.02, float(rng.uniform(0.2, 0.35))),
            ring={
                "count": int(rng.integers(3, 9)), "radius": RADIUS + 0.01,
                "height": float(rng.uniform(-0.14, 0.14)),
            },
        )  # fmt: skip
    return scene


def lit(scene: Scene, probes: Floats, fill: float = 0.25) -> Bools:
    """Which points a sensor sees, by MuJoCo's rays and angles of the view, shape (n,).

    Args:
        scene: One link and discs.
        probes: The points, shape (n, 3) [m].
        fill: Share of a zone that has to be filled, of arrays of zones.
    """
    spec = mujoco.MjSpec()
    for item in scene.objects.values():
        (placed,) = item.shapes
        assert isinstance(placed.shape, Cylinder)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, pos=item.pose.matrix()[:3, 3],
            size=(placed.shape.radius, placed.shape.height / 2.0, 0.0),
        )  # fmt: skip
    (fit,) = scene.robots["arm"].model.links["link"].collisions
    shape = fit.geometry
    if isinstance(shape, Box):
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=np.array(shape.size) / 2.0
        )
    else:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=(RADIUS, LENGTH / 2.0, 0.0)
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    seen = np.zeros(len(probes), dtype=np.bool_)
    for one in scene.sensors.values():
        T = one.pose.matrix()
        ways = probes - T[:3, 3]
        x, y, z = (ways @ T[:3, :3]).T
        inside = (z > 0.0) & (z <= one.range[1])
        # Half of the view of a camera is 160 pixels of 150.
        half = [160 / 150] * 2 if one.image else np.tan(np.array(one.view) / 2.0)
        inside &= (np.abs(x) <= half[0] * z) & (np.abs(y) <= half[1] * z)
        if not one.image:
            # Four zones in whose common corner a disc is.
            edge = 2.0 * max(half) / 8.0 * z
            inside &= np.pi * 0.025**2 / 4.0 >= fill * edge**2
        chosen = np.flatnonzero(inside & ~seen)
        far = np.linalg.norm(ways[chosen], axis=1)
        ids = np.zeros(len(chosen), dtype=np.int32)
        found = np.zeros(len(chosen))
        mujoco.mj_multiRay(
            model, data, T[:3, 3].copy(), (ways[chosen] / far[:, None]).ravel(), None,
            True, -1, ids, found, None, len(chosen), 20.0,
        )  # fmt: skip
        seen[chosen[(ids < 0) | (found >= far)]] = True
    return seen


def spots(scene: Scene) -> list[Spot]:
    """Blind spots on the upper side of the plate, or on the side of the capsule."""
    (fit,) = scene.robots["arm"].model.links["link"].collisions
    if isinstance(fit.geometry, Box):
        half = PLATE[0] / 2.0 - GRID
        line = np.arange(-half, half, GRID)
        x, y = np.meshgrid(line, line)
        points = np.stack([x, y, np.full_like(x, PLATE[2] / 2.0)], axis=-1)
        probes = points + np.array([0.0, 0.0, PLATE_STANDOFF])
        turns = False
    else:
        count = round(2.0 * np.pi * RADIUS / (2 * GRID))
        angle, z = np.meshgrid(
            np.arange(count) * 2.0 * np.pi / count,
            np.arange(-LENGTH / 2.0, LENGTH / 2.0, 2 * GRID),
        )
        round_ = np.stack([np.cos(angle), np.sin(angle), 0.0 * z], axis=-1)
        points = RADIUS * round_ + z[..., None] * (0.0, 0.0, 1.0)
        probes = points + STANDOFF * round_
        turns = True
    blind = ~lit(scene, probes.reshape(-1, 3)).reshape(points.shape[:2])
    labels, _ = ndimage.label(blind, structure=np.ones((3, 3)))
    step = GRID * (2 if turns else 1)
    wide = np.pad(blind, ((0, 0), (50, 50)), mode="wrap" if turns else "edge")
    within = ndimage.distance_transform_edt(
        np.pad(wide, ((50, 50), (0, 0)), mode="edge")
    )
    inner = within[50:-50, 50:-50] * step > RIM
    if turns:
        for a, b in zip(labels[:, 0], labels[:, -1], strict=True):
            if a and b and a != b:
                labels[labels == b] = a
    return [
        Spot(diameter(points[chosen]), points[chosen], points[chosen & inner])
        for chosen in (labels == label for label in np.unique(labels[labels > 0]))
    ]


def diameter(points: Floats) -> float:
    """Largest distance of two of some points, by those farthest to all sides [m]."""
    rng = np.random.default_rng(0)
    sides = rng.normal(size=(3, 400))
    along = points @ sides
    ends = points[np.unique([along.argmin(axis=0), along.argmax(axis=0)])]
    return float(np.linalg.norm(ends[:, None] - ends, axis=2).max())
