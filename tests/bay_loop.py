"""The bay with a response, and a loop whose arms follow the commands of a filter."""

import numpy as np

from armguard.geometry import Box, PlacedShape, Pose, Sphere
from armguard.respond import Guard
from armguard.respond.tool import tool_of
from armguard.scene import Scene, bay_scene
from armguard.scene.settings import ResponseSettings
from driven import Driven

# Top speeds of an arm of the bay, by joint [rad/s].
TOP = np.array([1.25, 1.25, 1.25, 1.25, 1.8, 1.8, 2.2])

LEFT, RIGHT = slice(0, 7), slice(7, 14)

# Radius of the ball that comes and goes in the tests [m].
CART = 0.06


def bay_guard(box=False, period=0.001, **response):
    """The bay in mode "path", all arms with one response, and a ball not there yet.

    Args:
        box: Whether an open box is in front of the left arm, its opening towards
            it.
        period: Time of a cycle [s].
        response: Settings.
    """
    bare = bay_scene("path")
    scene = Scene(mode="path", period=period, index=bare.index)
    for robot in bare.robots.values():
        scene.add_robot(
            robot.model,
            name=robot.name,
            base=robot.base,
            home=robot.home,
            stopping=robot.stopping,
            response=ResponseSettings(**response),
        )
    for item in bare.objects.values():
        scene.add([*item.shapes], name=item.name, pose=item.pose)
    for pair in bare.allowances:
        scene.allow(pair.a, pair.b, reason=pair.reason)
    if box:
        scene.add(open_box(), name="box", pose=Pose(xyz=(0.0, 0.42, 1.0)))
    scene.add(Sphere(radius=CART), name="cart", present=False)
    return Guard(scene, self_test=False)


def open_box():
    """A box of walls without the one towards -x, half a metre wide."""
    walls = [((0.02, 0.52, 0.52), (0.25, 0.0, 0.0))]
    for side in (-0.25, 0.25):
        walls.append(((0.26, 0.02, 0.52), (0.13, side, 0.0)))
        walls.append(((0.26, 0.52, 0.02), (0.13, 0.0, side)))
    return [
        PlacedShape(shape=Box(size=size), pose=Pose(xyz=place)) for size, place in walls
    ]


def bay_loop(guard, q=None):
    """A loop that has been let go."""
    loop = Driven(guard, q=q, delay=1)
    loop.still = np.zeros(len(guard.home))
    loop.run(loop.still, 3)
    return loop


def tool_pose(guard, q, name="left"):
    """Pose of an arm's tool at a configuration, shape (4, 4)."""
    guard.judge_at_rest(q)
    tool = tool_of(guard.tables, name)
    T = np.eye(4)
    T_world = guard._workspace.T_world
    T[:3, :3] = T_world[tool.body].reshape(3, 4)[:, :3] @ tool.R_body
    T[:3, 3] = tool.point(T_world)
    return T


def wander(loop):
    """Desired motion of the left arm about in free space for some seconds."""
    v, t = np.zeros(14), loop.t
    v[LEFT] = 0.4 * np.array(
        [np.sin(t), np.cos(1.3 * t), 0.5, np.sin(2 * t), 0.2, -0.4, 0.3]
    )
    return v
