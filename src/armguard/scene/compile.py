"""From a scene to flat tables."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armguard.robot.kinematics import (
    FIXED,
    KinematicTable,
    concatenate,
    kinematic_table,
    reach_bounds,
)
from armguard.robot.limits import joint_limits
from armguard.robot.tool import tool_link
from armguard.scene.allowed import allowed_pairs
from armguard.scene.blocks import (
    Block,
    blocks_of,
    extent,
    index_owners,
    stacked_rows,
)
from armguard.scene.coarse_gripper import coarse_gripper, gripper_members
from armguard.scene.exact import ExactPart, exact_tables
from armguard.scene.gripping import Grasp
from armguard.scene.hold_tables import (
    COARSE,
    Graspable,
    GripperPart,
    HoldTables,
    free_coarse,
)
from armguard.scene.names import PrimitiveNames
from armguard.scene.rules import pair_rules
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.settings import CubeSettings
from armguard.scene.standing import standing_objects
from armguard.scene.tables import LinkFrame, RobotPart, SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# The root cube is this much larger than what it must hold, so that nothing lies on
# its faces [-].
CUBE_SLACK = 1.02


def compile_scene(scene: Scene) -> SceneTables:
    """Flat tables of a scene.

    Raises:
        SceneError: The scene contradicts itself.
    """
    scene.validate()
    names = list(scene.robots)
    tables = {name: kinematic_table(scene.robots[name].model) for name in names}
    bases = [scene.robots[name].base.matrix() for name in names]
    carried = [name for name, thing in scene.objects.items() if thing.graspable]
    joined = with_objects(
        concatenate([tables[name] for name in names], bases),
        [scene.objects[name].pose.matrix() for name in carried],
    )
    robot_bodies = len(joined.parent) - len(carried)
    body_of = {name: robot_bodies + k for k, name in enumerate(carried)}
    first_body = dict(
        zip(
            names,
            np.cumsum([0, *(len(tables[n].parent) for n in names[:-1])]).tolist(),
            strict=True,
        )
    )
    blocks = sorted(
        [
            *robot_blocks(scene, tables, first_body),
            *object_blocks(scene, tables, first_body, body_of),
        ],
        key=lambda b: b.body if b.body >= 0 else np.iinfo(np.int32).max,
    )
    sizes = [len(b) for b in blocks]
    moving_count = sum(len(b) for b in blocks if b.body >= 0)
    rules = pair_rules(
        scene,
        allowed_pairs(scene),
        owners=list(dict.fromkeys(b.owner for b in blocks)),
        moving={b.owner for b in blocks if b.body >= 0},
    )
    grippers = gripper_parts(scene, tables, first_body)
    free_coarse(rules.checked, rules.buffers, rules.group_of, grippers)
    holds = hold_tables(scene, blocks, rules.group_of, rules.checked, grippers, body_of)
    groups = repeated([rules.group_of[b.owner] for b in blocks], sizes)
    kinds = np.concatenate([np.zeros(0, dtype=np.int32), *(b.kinds for b in blocks)])
    bodies = repeated([b.body for b in blocks], sizes)
    local_rows = stacked_rows(blocks)
    margin = scene.margin
    growth = np.zeros(len(kinds))
    growth[:moving_count] = margin
    lower, upper, home = stack_limits(scene)
    centre, edge = root_cube(scene, tables, first_body, kinds, bodies, local_rows)
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
        kinds=kinds,
        bodies=bodies,
        owners=index_owners(blocks),
        local_rows=local_rows,
        groups=groups,
        checked=holds.checked(),
        buffers=rules.buffers,
        growth=growth,
        margin=margin,
        moving_count=moving_count,
        checkable_pairs=count_checkable(groups, holds.rules, moving_count),
        body_names=PrimitiveNames(blocks, numbered=False),
        labels=PrimitiveNames(blocks, numbered=True),
        model_errors=np.concatenate([np.zeros(0), *(b.model_errors for b in blocks)]),
        shapes=tuple(shape for b in blocks for shape in b.shapes),
        standing=standing_objects(blocks, scene.objects),
        exact=exact_tables(
            [b.owner for b in blocks], sizes, exact_parts(scene, tables)
        ),
        cube_centre=centre,
        cube_edge=edge,
        index=scene.index,
        notes=tuple(scene.notes),
        robots=robot_parts(scene),
        links=link_frames(tables, first_body),
        robot_of_primitive=np.where(
            bodies[:moving_count] < robot_bodies,
            robots_of(bodies[:moving_count], first_body),
            -1,
        ).astype(np.int32),
        base_reach=base_reaches(
            scene, tables, kinds[:moving_count], bodies[:moving_count], local_rows
        ),
        top_speeds=top_speeds(scene, blocks),
        people=tuple(name for name, thing in scene.objects.items() if thing.person),
        period=scene.period,
        late=scene.late,
        holds=holds,
    )


def with_objects(table: KinematicTable, poses: Sequence[Floats]) -> KinematicTable:
    """A table with a body more for each object that may be gripped, in the world."""
    count = len(poses)
    frames = np.array([T[:3].reshape(12) for T in poses]).reshape(-1, 12)
    still = np.full(count, -1, dtype=np.int32)
    return replace(
        table,
        parent=np.concatenate([table.parent, still]),
        joint_kind=np.append(table.joint_kind, [FIXED] * count).astype(np.int32),
        q_index=np.concatenate([table.q_index, still]),
        gain=np.concatenate([table.gain, np.tile([1.0, 0.0], (count, 1))]),
        T_parent_joint=np.concatenate([table.T_parent_joint, frames]),
        axis=np.concatenate([table.axis, np.tile([1.0, 0.0, 0.0], (count, 1))]),
    )


def gripper_parts(
    scene: Scene, tables: Mapping[str, KinematicTable], first_body: Mapping[str, int]
) -> tuple[GripperPart, ...]:
    """The grippers of a scene."""
    parts = []
    for r, (name, robot) in enumerate(scene.robots.items()):
        gripper = robot.gripper
        if gripper is None:
            continue
        parts.append(
            GripperPart(
                robot=r,
                name=name,
                link=f"{name}/{gripper.link}",
                body=first_body[name] + tables[name].body_of_link[gripper.link],
                fingers=tuple(
                    f"{name}/{f}" for f in gripper.fingers if f in robot.fits
                ),
                members=tuple(f"{name}/{m}" for m in gripper_members(robot)),
                coarse=f"{name}/{gripper.link}{COARSE}" if gripper.coarse else None,
                swap=gripper.swap,
            )
        )
    return tuple(parts)


def hold_tables(
    scene: Scene,
    blocks: Sequence[Block],
    group_of: Mapping[str, int],
    rules: NDArray[np.uint8],
    grippers: tuple[GripperPart, ...],
    body_of: Mapping[str, int],
) -> HoldTables:
    """Grippers, what they may grip, and where every body stands in the tables."""
    places: dict[str, tuple[int, int]] = {}
    still = np.ones(len(rules), dtype=np.uint8)
    start = 0
    for block in blocks:
        first, _ = places.get(block.owner, (start, start))
        start += len(block)
        places[block.owner] = (first, start)
        if block.body >= 0:
            still[group_of[block.owner]] = 0
    return HoldTables(
        grippers=grippers,
        objects={
            name: Graspable(
                name=name,
                body=body,
                group=group_of[name],
                grasp=scene.objects[name].graspable or Grasp(),
                rests_on=scene.objects[name].rests_on,
            )
            for name, body in body_of.items()
        },
        places=places,
        group_of=group_of,
        rules=rules,
        still=still,
    )


def robot_parts(scene: Scene) -> tuple[RobotPart, ...]:
    """Each robot's part of q, and how it is guarded."""
    parts = []
    first = 0
    for name, robot in scene.robots.items():
        joints = robot.model.q_names
        parts.append(
            RobotPart(
                name=name,
                first_joint=first,
                joint_count=len(joints),
                joints=joints,
                mode=robot.mode,
                stopping=robot.stopping,
                response=robot.response,
                tool=f"{name}/{tool_link(robot.model)}",
            )
        )
        first += len(joints)
    return tuple(parts)


def link_frames(
    tables: Mapping[str, KinematicTable], first_body: Mapping[str, int]
) -> dict[str, LinkFrame]:
    """Where each link is on its body, by 'robot/link'."""
    return {
        f"{name}/{link}": LinkFrame(
            body=first_body[name] + body, T_body_link=table.T_body_link[link]
        )
        for name, table in tables.items()
        for link, body in table.body_of_link.items()
    }


def robots_of(bodies: Ints, first_body: Mapping[str, int]) -> Ints:
    """Robot of each moving primitive, shape (m,)."""
    firsts = np.array(list(first_body.values()))
    return (np.searchsorted(firsts, bodies, side="right") - 1).astype(np.int32)


def base_reaches(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    kinds: Ints,
    bodies: Ints,
    rows: Floats,
) -> Floats:
    """Radius about its robot's base that no point of a primitive leaves, (m,) [m]."""
    frames = np.concatenate(
        [
            reach_bounds(tables[name], *joint_limits(robot.model))
            for name, robot in scene.robots.items()
        ]
    )
    reach = np.zeros(len(kinds))
    box = np.zeros(6)
    for i, body in enumerate(bodies):
        if body >= len(frames):
            continue
        extent(kinds[i : i + 1], rows[i : i + 1], box)
        corner = np.maximum(np.abs(box[:3]), np.abs(box[3:]))
        reach[i] = frames[body] + float(np.linalg.norm(corner))
    return reach


def top_speeds(scene: Scene, blocks: Sequence[Block]) -> Floats:
    """Greatest speed of each primitive, shape (p,), or (0,) if no object moves."""
    if not any(thing.top_speed > 0.0 for thing in scene.objects.values()):
        return np.zeros(0)
    known = scene.objects
    speed = [known[b.owner].top_speed if b.owner in known else 0.0 for b in blocks]
    return np.repeat(np.array(speed), np.array([len(b) for b in blocks], np.intp))


def repeated(values: Sequence[int], sizes: Sequence[int]) -> Ints:
    """A value of each block for each of its primitives, shape (p,)."""
    return np.repeat(np.array(values, dtype=np.int32), np.array(sizes, dtype=np.intp))


def robot_blocks(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    first_body: Mapping[str, int],
) -> Iterator[Block]:
    """Primitives of all links; those of a robot's root body stand still."""
    for name, robot in scene.robots.items():
        table = tables[name]
        for link, fit in robot.fits.items():
            body = table.body_of_link[link]
            yield from blocks_of(
                f"{name}/{link}",
                fit.shapes,
                (),
                link_frame(robot, table, link),
                -1 if body == 0 else first_body[name] + body,
            )
        if robot.gripper is not None and robot.gripper.coarse:
            link = robot.gripper.link
            box = coarse_gripper(robot, table, gripper_members(robot))
            yield from blocks_of(
                f"{name}/{link}{COARSE}",
                (box,),
                (),
                np.eye(4),
                first_body[name] + table.body_of_link[link],
            )


def link_frame(robot: SceneRobot, table: KinematicTable, link: str) -> Floats:
    """Frame of a link in its body; of the root body's links, in the world."""
    T = table.T_body_link[link]
    return robot.base.matrix() @ T if table.body_of_link[link] == 0 else T


def exact_parts(
    scene: Scene, tables: Mapping[str, KinematicTable]
) -> dict[str, ExactPart]:
    """Exact geometry of the links that have another than their primitives."""
    return {
        f"{name}/{link}": ExactPart(fit.exact, link_frame(robot, tables[name], link))
        for name, robot in scene.robots.items()
        for link, fit in robot.fits.items()
        if fit.exact
    }


def object_blocks(
    scene: Scene,
    tables: Mapping[str, KinematicTable],
    first_body: Mapping[str, int],
    body_of: Mapping[str, int],
) -> Iterator[Block]:
    """Primitives of all objects; attached ones ride on their link's body.

    What may be gripped has a body of its own.
    """
    for name, thing in scene.objects.items():
        T, body = thing.pose.matrix(), -1
        if name in body_of:
            T, body = np.eye(4), body_of[name]
        elif thing.attached_to is not None:
            robot, link = thing.attached_to.split("/", 1)
            table = tables[robot]
            local = table.body_of_link[link]
            T = table.T_body_link[link] @ T
            if local == 0:
                T = scene.robots[robot].base.matrix() @ T
            else:
                body = first_body[robot] + local
        yield from blocks_of(name, thing.shapes, thing.surfaces, T, body)


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
    kinds: Ints,
    bodies: Ints,
    rows: Floats,
) -> tuple[Floats, float]:
    """Cube that holds everything the scene can contain: centre and edge [m].

    The cube of the scene's settings is taken if it holds what stands still; otherwise
    it grows about that. An arm may reach out of it, and a half-space always does: the
    outermost leaves have no end.
    """
    first = int(np.count_nonzero(bodies >= 0))
    box = np.zeros(6)
    extent(kinds[first:], rows[first:], box)
    low, high = box[:3], box[3:]
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
        own = bodies[:first] - first_body[name]
        reach = robot_reach(robot, tables[name], kinds[:first], own, rows[:first])
        low = np.minimum(low, origin - reach - scene.margin)
        high = np.maximum(high, origin + reach + scene.margin)
    return (low + high) / 2.0, float((high - low).max()) * CUBE_SLACK


def robot_reach(
    robot: SceneRobot,
    table: KinematicTable,
    kinds: Ints,
    bodies: Ints,
    rows: Floats,
) -> float:
    """Radius about a robot's base that no primitive riding on it can leave [m].

    Half-spaces, which have no end, are left out.

    Args:
        robot: The robot.
        table: Its bodies.
        kinds: Kind of each primitive that moves.
        bodies: Body of each, counted from the robot's first.
        rows: Their rows.
    """
    reach = 0.0
    box = np.zeros(6)
    for body, frame in enumerate(reach_bounds(table, *joint_limits(robot.model))):
        riders = bodies == body
        if riders.any():
            extent(kinds[riders], rows[riders], box)
            corner = np.maximum(np.abs(box[:3]), np.abs(box[3:]))
            if np.isfinite(corner).all():
                reach = max(reach, frame + float(np.linalg.norm(corner)))
    return reach


def holds(cube: CubeSettings, low: Floats, high: Floats) -> bool:
    """Whether a cube holds a box."""
    half = cube.edge / 2.0
    centre = np.array(cube.centre)
    return bool((centre - half <= low).all() and (high <= centre + half).all())
