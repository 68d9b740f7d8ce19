"""From a scene to flat tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import ROW_WIDTH, PlacedShape, shape_row
from armguard.robot.kinematics import (
    KinematicTable,
    concatenate,
    kinematic_table,
    reach_bounds,
)
from armguard.robot.limits import joint_limits
from armguard.scene.allowed import allowed_pairs
from armguard.scene.rules import pair_rules
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.settings import CubeSettings
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# The root cube is this much larger than what it must hold, so that nothing lies on
# its faces [-].
CUBE_SLACK = 1.02


@dataclass(frozen=True, slots=True)
class Primitive:
    """One primitive on its way into the tables.

    Attributes:
        owner: 'robot/link' or an object's name.
        label: Its own name.
        body: Kinematic body it rides on, -1 if it stands still.
        row: Row in the body's frame, or in the world, shape (16,).
        kind: ShapeKind as a number.
        model_error: How far it may reach beyond what it stands for [m].
    """

    owner: str
    label: str
    body: int
    row: Floats
    kind: int
    model_error: float


def compile_scene(scene: Scene) -> SceneTables:
    """Flat tables of a scene.

    Raises:
        SceneError: The scene contradicts itself.
    """
    scene.validate()
    names = list(scene.robots)
    tables = {name: kinematic_table(scene.robots[name].model) for name in names}
    bases = [scene.robots[name].base.matrix() for name in names]
    joined = concatenate([tables[name] for name in names], bases)
    first_body = dict(
        zip(
            names,
            np.cumsum([0, *(len(tables[n].parent) for n in names[:-1])]).tolist(),
            strict=True,
        )
    )
    primitives = sorted(
        [
            *robot_primitives(scene, tables, first_body),
            *object_primitives(scene, tables, first_body),
        ],
        key=lambda p: p.body if p.body >= 0 else np.iinfo(np.int32).max,
    )
    moving_count = sum(p.body >= 0 for p in primitives)
    rules = pair_rules(
        scene,
        allowed_pairs(scene),
        owners=list(dict.fromkeys(p.owner for p in primitives)),
        moving={p.owner for p in primitives if p.body >= 0},
    )
    groups = np.array([rules.group_of[p.owner] for p in primitives], dtype=np.int32)
    margin = scene.margin
    growth = np.zeros(len(primitives))
    growth[:moving_count] = margin
    lower, upper, home = stack_limits(scene)
    centre, edge = root_cube(scene, tables, first_body, primitives)
    return SceneTables(
        q_names=scene.q_names,
        lower=lower,
        upper=upper,
        home=home,
        parent=joined.parent,
        joint_kind=joined.joint_kind,
        q_index=joined.q_index,
        gain=joined.gain,
        T_parent_joint=joined.T_parent_joint,
        axis=joined.axis,
        kinds=np.array([p.kind for p in primitives], dtype=np.int32),
        bodies=np.array([p.body for p in primitives], dtype=np.int32),
        local_rows=np.array([p.row for p in primitives]).reshape(-1, ROW_WIDTH),
        groups=groups,
        checked=rules.checked,
        buffers=rules.buffers,
        growth=growth,
        margin=margin,
        moving_count=moving_count,
        checkable_pairs=count_checkable(groups, rules.checked, moving_count),
        body_names=tuple(p.owner for p in primitives),
        labels=tuple(p.label for p in primitives),
        model_errors=np.array([p.model_error for p in primitives]),
        cube_centre=centre,
        cube_edge=edge,
        index=scene.index,
        notes=tuple(scene.notes),
    )


def labels_of(owner: str, shapes: Sequence[PlacedShape]) -> list[str]:
    """Names of a body's primitives: numbered if there are several."""
    if len(shapes) == 1:
        return [owner]
    return [f"{owner}[{k}]" for k in range(len(shapes))]


def robot_primitives(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    first_body: Mapping[str, int],
) -> list[Primitive]:
    """Primitives of all links; those of a robot's root body stand still."""
    found = []
    for name, robot in scene.robots.items():
        table = tables[name]
        base = robot.base.matrix()
        for link, fit in robot.fits.items():
            body = table.body_of_link[link]
            T_link = table.T_body_link[link]
            if body == 0:
                T_link = base @ T_link
            found += placed(
                f"{name}/{link}",
                fit.shapes,
                T_link,
                -1 if body == 0 else first_body[name] + body,
            )
    return found


def object_primitives(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    first_body: Mapping[str, int],
) -> list[Primitive]:
    """Primitives of all objects; attached ones ride on their link's body."""
    found = []
    for name, thing in scene.objects.items():
        T, body = thing.pose.matrix(), -1
        if thing.attached_to is not None:
            robot, link = thing.attached_to.split("/", 1)
            table = tables[robot]
            local = table.body_of_link[link]
            T = table.T_body_link[link] @ T
            if local == 0:
                T = scene.robots[robot].base.matrix() @ T
            else:
                body = first_body[robot] + local
        found += placed(name, thing.shapes, T, body)
    return found


def placed(
    owner: str, shapes: Sequence[PlacedShape], T: Floats, body: int
) -> list[Primitive]:
    """Primitives of one owner whose frame stands at T in its body or the world."""
    return [
        Primitive(
            owner=owner,
            label=label,
            body=body,
            row=shape_row(s.shape, T @ s.pose.matrix()),
            kind=int(s.shape.kind),
            model_error=s.model_error,
        )
        for label, s in zip(labels_of(owner, shapes), shapes, strict=True)
    ]


def stack_limits(scene: Scene) -> tuple[Floats, Floats, Floats]:
    """Lower limits, upper limits and home of all joints, each shape (n,)."""
    lower, upper = [], []
    for robot in scene.robots.values():
        low, high = joint_limits(robot.model)
        lower.append(low)
        upper.append(high)
    return np.concatenate(lower), np.concatenate(upper), scene.home


def count_checkable(
    groups: NDArray[np.int32], checked: NDArray[np.uint8], moving_count: int
) -> int:
    """Pairs of primitives that are checked: one moving, groups not exempt."""
    size = checked.shape[0]
    everyone = np.bincount(groups, minlength=size).astype(np.int64)
    movers = np.bincount(groups[:moving_count], minlength=size).astype(np.int64)
    open_groups = checked.astype(np.int64)
    # Two moving primitives meet in both orders here.
    both_move = int(movers @ open_groups @ movers)
    return int(movers @ open_groups @ everyone) - both_move // 2


def root_cube(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    first_body: Mapping[str, int],
    primitives: Sequence[Primitive],
) -> tuple[Floats, float]:
    """Cube that holds everything the scene can contain: centre and edge [m].

    The cube of the scene's settings is taken if it holds what stands still; otherwise
    it grows about that. An arm may reach out of it: the outermost leaves have no end.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    box = np.zeros(6)
    for p in primitives:
        if p.body < 0:
            row_bounds(p.kind, p.row, 0.0, box)
            low, high = np.minimum(low, box[:3]), np.maximum(high, box[3:])
    chosen = scene.index.cube
    if chosen is not None:
        if holds(chosen, low, high):
            return np.array(chosen.centre, dtype=np.float64), chosen.edge
        half = np.full(3, chosen.edge / 2.0)
        low = np.minimum(low, np.array(chosen.centre) - half)
        high = np.maximum(high, np.array(chosen.centre) + half)
        return (low + high) / 2.0, float((high - low).max()) * CUBE_SLACK
    for name, robot in scene.robots.items():
        origin = robot.base.matrix()[:3, 3]
        reach = robot_reach(robot, tables[name], primitives, first_body[name])
        low = np.minimum(low, origin - reach - scene.margin)
        high = np.maximum(high, origin + reach + scene.margin)
    return (low + high) / 2.0, float((high - low).max()) * CUBE_SLACK


def robot_reach(
    robot: SceneRobot,
    table: KinematicTable,
    primitives: Sequence[Primitive],
    first_body: int,
) -> float:
    """Radius about a robot's base that no primitive riding on it can leave [m]."""
    frames = reach_bounds(table, *joint_limits(robot.model))
    box = np.zeros(6)
    reach = 0.0
    for p in primitives:
        body = p.body - first_body
        if p.body >= 0 and 0 <= body < len(frames):
            row_bounds(p.kind, p.row, 0.0, box)
            corner = np.maximum(np.abs(box[:3]), np.abs(box[3:]))
            reach = max(reach, frames[body] + float(np.linalg.norm(corner)))
    return reach


def holds(cube: CubeSettings, low: Floats, high: Floats) -> bool:
    """Whether a cube holds a box."""
    half = cube.edge / 2.0
    centre = np.array(cube.centre)
    return bool((centre - half <= low).all() and (high <= centre + half).all())
