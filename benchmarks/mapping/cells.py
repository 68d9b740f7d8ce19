"""Cells of two Pandas, and random plans that lead into the space of both."""

from dataclasses import dataclass
from functools import cache

import numpy as np

import armguard as ag
from armguard.maps.cell_plan import CellPlan
from armguard.maps.coordination import Coordinator
from armguard.plans.coal_world import CoalWorld
from armguard.scene import Scene, Trajectory
from armguard.scene.restricted import restricted, riders
from arrays import Floats
from batch_planning import primitives_of

ROBOTS = ("left", "right")

# A plan has so many moves, each of so many rows, at an even pace [s].
MOVES, ROWS, STEP = 4, 5, 0.5

# Joint 1 of the left arm away from the other arm, and towards it [rad].
AWAY, TOWARDS = 0.4, -1.2

# How far all joints vary about that [rad].
VARIES = 0.35

# How joints 2 and 4 differ where an arm reaches out [rad].
OUT = {1: 0.6, 3: 0.75}


@dataclass(frozen=True, slots=True)
class Cell:
    """Two Pandas side by side.

    Attributes:
        scene: The scene.
        coordinator: Makes maps.
        oracle: Coal on Pinocchio's kinematics.
        sides: Primitives of each robot.
        checker: Checks pairs of both robots; where these come nearer with errors.
    """

    scene: Scene
    coordinator: Coordinator
    oracle: CoalWorld
    sides: tuple[list[int], list[int]]
    checker: ag.Checker


@cache
def cell_of(apart: float) -> Cell:
    """Two Pandas so far apart, by their primitives, which Coal has as well."""
    scene = ag.Scene(mode="fixed", buffer=0.0)
    for name, y in zip(ROBOTS, (0.5 * apart, -0.5 * apart), strict=True):
        scene.add_robot("panda", name=name, base=ag.Pose(xyz=(0.0, y, 0.0)))
    tables = primitives_of(scene)
    moving = tables.robot_of_primitive.tolist()
    sides = tuple([i for i, r in enumerate(moving) if r == k] for k in range(2))
    return Cell(
        scene,
        Coordinator(tables, ROBOTS),
        CoalWorld(tables),
        (sides[0], sides[1]),
        ag.Checker(restricted(tables, riders(tables), lambda a, b: {a, b} == {0, 1})),
    )


def rows_of(cell: Cell, robot: str, rng: np.random.Generator) -> Floats:
    """Rows of one arm between places by its side and in the other's reach."""
    names = cell.scene.q_names
    own = [k for k, name in enumerate(names) if name.startswith(f"{robot}/panda_joint")]
    mirrored = 1.0 if robot == "left" else -1.0
    goals = np.tile(cell.scene.home[own], (MOVES + 1, 1))
    goals += rng.uniform(-VARIES, VARIES, goals.shape)
    goals[::2, 0] = mirrored * (AWAY + rng.uniform(-VARIES, VARIES, MOVES // 2 + 1))
    goals[1::2, 0] = mirrored * (TOWARDS + rng.uniform(-VARIES, VARIES, MOVES // 2))
    for joint, more in OUT.items():
        goals[1::2, joint] += more
    at = np.linspace(0.0, MOVES, MOVES * ROWS + 1)
    found = np.tile(cell.scene.home, (len(at), 1))
    for k, goal in zip(own, goals.T, strict=True):
        found[:, k] = np.interp(at, np.arange(MOVES + 1), goal)
    return found


def plans_of(
    cell: Cell, seed: int, following: float, skew: float
) -> dict[str, CellPlan]:
    """Plans of both arms, 20 segments each, with their errors."""
    rng, found = np.random.default_rng([seed, 91]), {}
    times = STEP * np.arange(MOVES * ROWS + 1)
    for robot in ROBOTS:
        rows = rows_of(cell, robot, rng)
        motion = Trajectory(cell.scene.q_names, rows, times, f"{robot} {seed}")
        plan = ag.Plan.of(motion, cell.scene, interpolation="cubic")
        found[robot] = CellPlan(plan, following_error=following, skew=skew)
    return found
