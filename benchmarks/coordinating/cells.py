"""Pandas at a belt, and random plans that pick from it and place at its sides."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

import armguard as ag
from armguard.maps.cell_plan import CellPlan
from armguard.maps.job import LineJobModel, LinePlanEntry, line_plans
from armguard.maps.line_cell import RUN_UP, Conveyor, LinePlan, Track
from armguard.plans.coal_world import CoalWorld
from armguard.respond.tool import Tool, tool_of
from armguard.scene import Scene, SceneTables, Trajectory
from armguard.scene.conveyor import FOLDER, conveyor_job_path, conveyor_path
from armguard.scene.schema import model_of
from armguard.scene.yaml_source import YamlSource
from arrays import Floats
from batch_planning import primitives_of
from peers.pinocchio_coal import build_models

# Bases of arms, x across the belt and y along it [m], and how they are turned [rad].
ARMS = {"left": (-0.52, -0.2, 0.0), "right": (0.52, 0.2, np.pi)}

# A third one beside the left one, and the places at which three put items, x and y [m]:
# left and third reach across each other's way, and each meets the right one.
THIRD = {"third": (-0.52, 0.5, 0.0)}
PLACES = {"left": (-0.16, 0.2), "right": (0.16, 0.6), "third": (-0.16, 0.08)}

# Items arrive at y = BEGIN [m].
BEGIN = -1.6

# Where arms rest, drawn back from the belt [rad].
REST = {"panda_joint2": -1.4, "panda_joint4": -2.6, "panda_joint6": 1.6}

# The belt as it is declared, and the speed that plans are made for [m/s].
CONVEYOR, MADE_FOR = Conveyor(0.155, 0.245), 0.3

# Joints go at about this speed on their ways to and from the belt [rad/s], with stops
# in between of so long [s].
PACE, LEAST = 0.6, 0.8

# How long plans follow an item, and slow down behind that, and time between two rows
# meanwhile [s].
FOLLOWS, SLOWS, EVERY = 1.0, 0.5, 0.1

# Where arms may begin to follow, along y from their bases [m].
FIRST = (-0.15, 0.05)

# Height of tools while they grip, and above [m].
LOW, HIGH = 0.12, 0.24

# Links of both arms keep this distance [m].
FLOOR = 0.03

# Joints are so far off [rad], clocks so late [s].
FOLLOWING, SKEW = 0.005, 0.02

# Period of a cycle [s].
PERIOD = 0.008

# Inverse kinematics: steps, damping, the error that ends it [m and rad], and the
# greatest step of a joint [rad].
STEPS, DAMPING, EXACT, MOST = 200, 1e-3, 1e-5, 0.2


@dataclass(frozen=True, slots=True)
class Cell:
    """Pandas at a belt.

    Attributes:
        scene: The scene.
        tables: The scene, links by their primitives.
        oracle: Coal on Pinocchio's kinematics.
        sides: Primitives of each arm, by name.
        still: Primitives that do not move.
        model: Pinocchio's model.
        tools: Tool of each arm, by name.
    """

    scene: Scene
    tables: SceneTables
    oracle: CoalWorld
    sides: dict[str, list[int]]
    still: list[int]
    model: Any
    tools: dict[str, Tool]


@cache
def opposite() -> Cell:
    """Two arms at the two sides of a belt."""
    return standing(ARMS)


@cache
def three_arms() -> Cell:
    """Three arms at a belt; each two of them meet."""
    return standing(ARMS | THIRD)


def standing(arms: Mapping[str, tuple[float, float, float]]) -> Cell:
    """The cell of arms with some bases, by their primitives, which Coal has."""
    scene = ag.Scene(mode="path", period=PERIOD)
    for name, (x, y, turn) in arms.items():
        base = ag.Pose(xyz=(x, y, 0.0), rpy=(0.0, 0.0, turn))
        scene.add_robot("panda", name=name, base=base, home=REST)
    belt = ag.Box(size=(0.3, 3.4, 0.04))
    scene.add(belt, name="belt", pose=ag.Pose(xyz=(0.0, 0.0, -0.02)))
    return cell_of(scene)


@cache
def side_by_side() -> Cell:
    """The bundled cell: both arms at one side of a belt, with a tray between them."""
    scene = ag.load_scene(conveyor_path())
    scene.period = PERIOD
    return cell_of(scene)


def cell_of(scene: Scene) -> Cell:
    """The cell of a scene."""
    tables = primitives_of(scene)
    moving = tables.robot_of_primitive.tolist()
    names = [part.name for part in tables.robots]
    sides = {
        n: [i for i, r in enumerate(moving) if r == k] for k, n in enumerate(names)
    }
    return Cell(
        scene,
        tables,
        CoalWorld(tables),
        sides,
        list(range(len(moving), len(tables.kinds))),
        build_models(tables)[0],
        {name: tool_of(tables, name) for name in names},
    )


def reached(one: Cell, robot: str, goals: Floats) -> Floats:
    """Rows of a scene at which an arm's tool points down at places, shape (k, n).

    Args:
        one: The cell.
        robot: The arm.
        goals: Places, shape (k, 3) [m].
    """
    tool, model = one.tools[robot], one.model
    data, q = model.createData(), one.scene.home.copy()
    rows = np.empty((len(goals), len(q)))
    joint = model.getJointId(f"body{tool.body}")
    at = pin.SE3(tool.R_body, tool.p_body)
    side = np.sign(PLACES[robot][0])
    turn = np.diag([-side, side, -1.0])
    own = np.array([n.startswith(f"{robot}/panda_joint") for n in one.scene.q_names])
    source, _ = of_joints(one)
    for k, goal in enumerate(goals):
        wanted = pin.SE3(turn, goal)
        for _ in range(STEPS):
            pin.computeJointJacobians(model, data, joint_places(one, q))
            error = pin.log6((data.oMi[joint] * at).actInv(wanted)).vector
            if np.abs(error).max() < EXACT:
                break
            J = at.toActionMatrixInverse() @ pin.getJointJacobian(
                model, data, joint, pin.ReferenceFrame.LOCAL
            )
            J = J[:, own[source]]
            square = J @ J.T + DAMPING**2 * np.eye(6)
            # What is left of the joints leads towards home.
            rest = one.scene.home[own] - q[own]
            step = rest + J.T @ np.linalg.solve(square, error - J @ rest)
            q[own] += np.clip(step, -MOST, MOST)
        else:
            raise ValueError(f"no arm reaches {goal}")
        rows[k] = q
    return rows


def of_joints(one: Cell) -> tuple[Any, Floats]:
    """Joint of a scene that each of Pinocchio's follows, and how it does."""
    tables = one.tables
    moving = np.flatnonzero(tables.joint_kind != 0)
    return tables.q_index[moving], tables.gain[moving]


def joint_places(one: Cell, q: Floats) -> Floats:
    """Positions of Pinocchio's joints."""
    source, gain = of_joints(one)
    return np.asarray(q[source] * gain[:, 0] + gain[:, 1])


def pick(
    one: Cell, robot: str, first: float, across: float, place: tuple[float, float]
) -> LinePlan:
    """A plan that picks an item from the belt and places it at a side.

    Args:
        one: The cell.
        robot: The arm.
        first: Where the tool begins to follow, y [m].
        across: Where the item is on the belt, x [m].
        place: Where it is placed, x and y [m].
    """
    follow = np.arange(-RUN_UP, FOLLOWS + SLOWS, EVERY)
    late = np.maximum(follow - FOLLOWS, 0.0)
    along = first + MADE_FOR * (follow - late**2 / (2.0 * SLOWS))
    # Down before the item is gripped, up behind it.
    share = np.clip((follow + 0.3) / 0.6, 0.0, 1.0)
    up = 1.0 - share**2 * (3.0 - 2.0 * share) + 0.5 * (late / SLOWS) ** 2
    belt = np.column_stack(
        (np.full_like(along, across), along, LOW + (HIGH - LOW) * up)
    )
    over, at = [*place, HIGH], [*place, LOW]
    goals = np.vstack((belt, [over, at, over]))
    rows = reached(one, robot, goals)
    home = one.scene.home[None]
    every = np.vstack((home, rows, home))
    needs = np.abs(np.diff(every, axis=0)).max(axis=1) / PACE
    needs = np.maximum(needs, LEAST)
    needs[1 : len(belt)] = EVERY
    times = np.concatenate(([0.0], np.cumsum(needs)))
    motion = Trajectory(tuple(one.scene.q_names), every, times, "pick")
    plan = ag.Plan.of(motion, one.scene, interpolation="cubic")
    start = float(times[1]) + RUN_UP
    track = Track(start, start + FOLLOWS, first - BEGIN, MADE_FOR)
    return LinePlan(robot, CellPlan(plan, FOLLOWING, SKEW), track)


def bundled_plans(alternatives: int) -> dict[str, LinePlan]:
    """Plans of the bundled cell, and one of each arm that goes there without an item.

    Args:
        alternatives: How many alternatives each has.
    """
    source = YamlSource(conveyor_job_path())
    job = model_of(source, LineJobModel, LinePlanEntry)
    given = line_plans(source, job, FOLDER, side_by_side().scene)
    found = {n: replace(one, alternatives=alternatives) for n, one in given.items()}
    for robot in side_by_side().sides:
        one = found[f"{robot} late"]
        found[f"{robot} without item"] = replace(one, track=None)
    return found


def plans_of(seed: int) -> dict[str, LinePlan]:
    """Random plans of two opposite arms."""
    rng, found = np.random.default_rng([seed, 95]), dict[str, LinePlan]()
    for name, (_, along, _) in ARMS.items():
        across = rng.uniform(-0.03, 0.03)
        end = float(rng.choice([-1, 1]) * rng.uniform(0.36, 0.44))
        side = float(np.sign(PLACES[name][0]))
        place = side * rng.uniform(0.12, 0.2), along + end
        found |= plans_to(opposite(), name, along, across, place)
    return found


def three_plans() -> dict[str, LinePlan]:
    """Plans of three arms."""
    found = dict[str, LinePlan]()
    for name, (_, along, _) in (ARMS | THIRD).items():
        found |= plans_to(three_arms(), name, along, 0.0, PLACES[name])
    return found


def plans_to(
    one: Cell, name: str, along: float, across: float, place: tuple[float, float]
) -> dict[str, LinePlan]:
    """Plans of an arm, one for each place at which it may begin to follow.

    A last one goes the same way without an item.

    Args:
        one: The cell.
        name: The arm.
        along: Place of its base along the belt, y [m].
        across: Where items are on the belt, x [m].
        place: Where it puts them, x and y [m].
    """
    found = {
        f"{name} at {first:+.2f}": pick(one, name, along + first, across, place)
        for first in FIRST
    }
    last = [*found.values()][-1]
    return found | {f"{name} without item": LinePlan(name, last.plan)}
