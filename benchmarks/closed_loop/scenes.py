"""The scenes of the campaign, with figures declared for their arms."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from armguard.geometry import Box, Capsule, Cylinder, PlacedShape, Pose, Sphere
from armguard.robot.stopping import StoppingFigures, stopping_figures
from armguard.scene import Scene, bay_scene
from closed_loop.settings import Setting

# Objects that move in the scene "movers": they start here, and bounce within ROOM.
MOVERS = {
    "ball": (Sphere(radius=0.06), (0.05, 0.0, 1.45)),
    "crate": (Box(size=(0.16, 0.12, 0.1)), (0.0, 0.55, 1.3)),
}

# Corners of the box in which they bounce [m].
ROOM = ((-0.75, -0.85, 0.75), (0.25, 0.85, 1.65))


def declared(setting: Setting, scene: Scene) -> dict[str, StoppingFigures]:
    """Figures of each arm of a scene, as a setting declares them."""
    return {
        name: stopping_figures(robot.model, **setting.figures)
        for name, robot in scene.robots.items()
    }


def build_scene(setting: Setting) -> Scene:
    """The scene of a setting."""
    bare = bare_scene(setting.scene)
    scene = Scene(
        mode=setting.mode,
        period=setting.period,
        late=setting.late,
        buffer=setting.floor,
        index=bare.index,
    )
    figures = declared(setting, bare)
    speeds = dict.fromkeys(movers_of(bare), setting.top_speed)
    return filled(
        scene,
        bare,
        lambda name: {"stopping": figures[name]},
        lambda name: {"top_speed": speeds.get(name, 0.0)},
    )


def filled(
    scene: Scene,
    bare: Scene,
    robots: Callable[[str], dict[str, Any]],
    objects: Callable[[str], dict[str, Any]] = lambda _: {},
) -> Scene:
    """An empty scene with all that is in another one.

    Cylinders that stand upright become the boxes round them, for the guard as for the
    judge, which has no cylinders.

    Args:
        scene: The empty scene.
        bare: The other one.
        robots: Further arguments of `Scene.add_robot` by the robot's name.
        objects: Further arguments of `Scene.add` by the object's name.
    """
    for name, robot in bare.robots.items():
        where = {"base": robot.base, "home": robot.home}
        scene.add_robot(robot.model, name=name, **where, **robots(name))
    for name, seen in bare.objects.items():
        shapes = [*map(boxed, seen.shapes), *seen.surfaces]
        scene.add(shapes, name=name, pose=seen.pose, **objects(name))
    for pair in bare.allowances:
        scene.allow(pair.a, pair.b, reason=pair.reason)
    return scene


def boxed(part: PlacedShape) -> PlacedShape:
    """A placed shape; a cylinder as the box round it."""
    shape = part.shape
    if not isinstance(shape, Cylinder):
        return part
    size = (2.0 * shape.radius, 2.0 * shape.radius, shape.height)
    return PlacedShape(Box(size=size), part.pose)


@cache
def bare_scene(name: str) -> Scene:
    """A scene without figures."""
    if name == "pandas":
        return two_pandas()
    scene = bay_scene()
    if name == "movers":
        for item, (shape, xyz) in MOVERS.items():
            scene.add(shape, name=item, pose=Pose(xyz=xyz))
    return scene


def two_pandas() -> Scene:
    """Two Pandas face to face at a table, a box and a post between them."""
    scene = Scene()
    scene.add_robot("panda", name="near", base=Pose(xyz=(-0.55, 0.0, 0.0)))
    scene.add_robot(
        "panda", name="far", base=Pose(xyz=(0.55, 0.0, 0.0), rpy=(0, 0, 3.14159265))
    )
    # Its top lies 40 mm below the bases: nothing of a Panda's first links reaches it.
    scene.add(Box(size=(1.8, 1.2, 0.04)), name="table", pose=Pose(xyz=(0, 0, -0.06)))
    scene.add(Box(size=(0.16, 0.24, 0.16)), name="box", pose=Pose(xyz=(0, 0.3, 0.04)))
    scene.add(
        Capsule(start=(0, 0, 0), end=(0, 0, 0.6), radius=0.03),
        name="post",
        pose=Pose(xyz=(0.0, -0.35, 0.0)),
    )
    return scene


def movers_of(scene: Scene) -> Iterator[str]:
    """Names of the objects of a scene that move."""
    return (name for name in scene.objects if name in MOVERS)
