"""Scenes in which operators have goals, with a response for all their robots."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from armguard.geometry import Box, Cylinder, PlacedShape
from armguard.scene import Scene, bay_scene, load_scene
from armguard.scene.settings import ResponseName
from closed_loop.scenes import two_pandas

# Where the public planning scenes lie, beside the project.
PUBLIC = Path(__file__).parents[2].parent / "shared" / "motionbench"

# Time from one cycle to the next [s].
PERIOD = 0.001

# Public scenes by name, and the file of each.
FILES: Mapping[str, str] = {
    "panda_table": "table_pick_panda/scene0001.yaml",
    "panda_shelf": "bookshelf_small_panda/scene0001.yaml",
    "baxter_shelf": "bookshelf_tall_both_arms_easy_baxter/scene0001.yaml",
}

SCENES = ("bay", "pandas", *FILES)

# Links operators move, where a robot has more tools than one.
TOOLS: Mapping[str, tuple[str, ...]] = {
    "baxter_shelf": ("baxter/left_gripper", "baxter/right_gripper"),
}


def is_there(name: str) -> bool:
    """Whether what a scene is made of is on this machine."""
    return name not in FILES or (PUBLIC / FILES[name]).exists()


@cache
def bare_scene(name: str) -> Scene:
    """A scene as it is published."""
    if name == "bay":
        return bay_scene("path")
    if name == "pandas":
        return two_pandas()
    return load_scene(PUBLIC / FILES[name])


def build_scene(name: str, response: ResponseName) -> Scene:
    """A scene in mode "path", all its robots with one response.

    Cylinders that stand upright become the boxes round them, for the guard as for the
    judge, which has no cylinders.

    Args:
        name: One of `SCENES`.
        response: What its robots do about what is near.
    """
    bare = bare_scene(name)
    scene = Scene(mode="path", period=PERIOD, index=bare.index)
    for robot in bare.robots.values():
        scene.add_robot(
            robot.model,
            name=robot.name,
            base=robot.base,
            home=robot.home,
            stopping=robot.stopping,
            response=response,
        )
    for body in bare.objects.values():
        assert body.attached_to is None and not body.surfaces, body.name
        scene.add(
            [boxed(part) for part in body.shapes],
            name=body.name,
            pose=body.pose,
        )
    for pair in bare.allowances:
        scene.allow(pair.a, pair.b, reason=pair.reason)
    return scene


def boxed(part: PlacedShape) -> PlacedShape:
    """A placed shape; a cylinder as the box round it."""
    shape = part.shape
    if not isinstance(shape, Cylinder):
        return part
    half = (shape.radius, shape.radius, shape.height / 2.0)
    return PlacedShape(Box(half_extents=half), part.pose)
