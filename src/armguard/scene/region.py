"""The sensed region beside what the arms reach."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.robot.kinematics import forward_kinematics, kinematic_table
from armguard.robot.limits import joint_limits
from armguard.scene.robots import SceneRobot
from armguard.scene.sensing import SceneSensing

# Random joint positions of each arm whose links have to be inside the region. Space
# outside it counts as not seen, so that a missed position makes no motion less safe.
SAMPLES = 512


def check_region(sensing: SceneSensing, robots: Iterable[SceneRobot]) -> None:
    """Check that arms stay inside of the sensed region.

    Args:
        sensing: Sensed space of the scene.
        robots: Its robots.

    Raises:
        SceneError: An arm reaches out of it.
    """
    for robot in robots:
        points = reached_points(robot)
        way = np.abs(points - sensing.region.centre).max(axis=1)
        k = int(way.argmax())
        if way[k] > 0.5 * sensing.edge:
            at = ", ".join(f"{x:.2f}" for x in points[k])
            raise SceneError(
                f"the region is a cube of {sensing.edge:g} m about "
                f"{list(sensing.region.centre)}; robot '{robot.name}' reaches ({at}), "
                "outside it: move the centre, or raise `size` or `cell`"
            )


def check_modes(robots: Iterable[SceneRobot]) -> None:
    """Check that every robot has a mode that reads cells.

    Args:
        robots: Robots of a scene with sensed space.

    Raises:
        SceneError: A robot is in mode "fixed".
    """
    for robot in robots:
        if robot.mode == "fixed":
            raise SceneError(
                f"robot '{robot.name}' is in mode 'fixed', which reads no cells: give "
                "it mode 'path' or 'speed', or leave `sensing` out"
            )


def reached_points(robot: SceneRobot) -> NDArray[np.float64]:
    """Origins of a robot's bodies at random positions, world, shape (k, 3) [m]."""
    table = kinematic_table(robot.model)
    lower, upper = joint_limits(robot.model)
    lower, upper = np.maximum(lower, -2.0 * np.pi), np.minimum(upper, 2.0 * np.pi)
    T_world = np.zeros((SAMPLES, len(table.parent), 12))
    draw = np.random.default_rng(0)
    for out in T_world:
        forward_kinematics(
            draw.uniform(lower, upper), table.parent, table.joint_kind, table.q_index,
            table.gain, table.T_parent_joint, table.axis, out,
        )  # fmt: skip
    origins = T_world[..., [3, 7, 11]].reshape(-1, 3)
    base = robot.base.matrix()
    return np.asarray(origins @ base[:3, :3].T + base[:3, 3])
