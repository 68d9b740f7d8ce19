"""From a scene to flat tables."""

import logging
from collections.abc import Iterator, Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.robot.kinematics import KinematicTable, reach_bounds
from armguard.robot.limits import joint_limits
from armguard.robot.tree import tool_link
from armguard.scene.allowed import PairRules, allowed_pairs, pair_rules
from armguard.scene.blocks import (
    Block,
    blocks_of,
    extent,
    index_owners,
    stacked_rows,
)
from armguard.scene.coarse_gripper import coarse_gripper, gripper_members
from armguard.scene.exact import ExactPart, exact_tables, repeated
from armguard.scene.gripping import Grasp
from armguard.scene.hold_tables import (
    COARSE,
    Graspable,
    GripperPart,
    HoldTables,
    free_coarse,
)
from armguard.scene.layout import Layout, PrimitiveNames
from armguard.scene.objects import NAMED_STRANGE
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.schema import BRIEF
from armguard.scene.sensing import SENSED
from armguard.scene.standing import standing_objects
from armguard.scene.tables import LinkFrame, RobotPart, SceneTables

log = logging.getLogger("armguard")

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
    if not isinstance(scene, Scene):
        raise SceneError(
            f"{BRIEF.repr(scene)} is no Scene; read a scene file with load_scene(FILE)"
        )
    scene.validate()
    if scene.strange_count > NAMED_STRANGE:
        log.warning(
            "%d objects look like millimetres; %d of them are named above",
            scene.strange_count,
            NAMED_STRANGE,
        )
    layout = Layout.of(scene)
    blocks = sorted(
        [*link_blocks(layout), *object_blocks(layout)],
        key=lambda b: b.body if b.body >= 0 else np.iinfo(np.int32).max,
    )
    rules, holds = rules_and_holds(layout, blocks)
    joined, rows = layout.joined(), stacked_rows(blocks)
    kinds = np.concatenate([np.zeros(0, np.int32), *(b.kinds for b in blocks)])
    bodies = repeated(np.array([b.body for b in blocks], dtype=np.int32), blocks)
    group = [rules.group_of[b.owner] for b in blocks]
    groups = repeated(np.array(group, dtype=np.int32), blocks)
    moving = int(np.count_nonzero(bodies >= 0))
    limits = limits_of(scene)
    cube = root_cube(layout, kinds, bodies, rows)
    return SceneTables(
        q_names=scene.q_names,
        lower=limits[0],
        upper=limits[1],
        home=scene.home,
        parent=joined.parent,
        joint_kind=joined.joint_kind,
        q_index=joined.q_index,
        gain=joined.gain,
        T_parent_joint=joined.T_parent_joint,
        axis=joined.axis,
        kinds=kinds,
        bodies=bodies,
        owners=index_owners(blocks),
        local_rows=rows,
        groups=groups,
        checked=holds.checked(),
        buffers=rules.buffers,
        growth=np.where(bodies >= 0, scene.margin, 0.0),
        margin=scene.margin,
        moving_count=moving,
        checkable_pairs=count_checkable(groups, holds.rules, moving),
        body_names=PrimitiveNames(blocks, numbered=False),
        labels=PrimitiveNames(blocks, numbered=True),
        model_errors=np.concatenate([[], *(b.model_errors for b in blocks)]),
        shapes=tuple(shape for b in blocks for shape in b.shapes),
        standing=standing_objects(scene.objects, holds.places, layout.own),
        exact=exact_tables(blocks, exact_parts(layout)),
        cube_centre=cube[0],
        cube_edge=cube[1],
        index=scene.index,
        notes=tuple(scene.notes),
        robots=robot_parts(scene),
        links=link_frames(layout),
        robot_of_primitive=robots_of(layout, bodies[:moving]),
        base_reach=base_reaches(layout, kinds[:moving], bodies[:moving], rows),
        top_speeds=top_speeds(scene, blocks),
        people=tuple(name for name, item in scene.objects.items() if item.person),
        period=scene.period,
        late=scene.late,
        holds=holds,
        sensing=scene.sensing,
        sensors=tuple(scene.sensors),
    )


def limits_of(scene: Scene) -> tuple[Floats, Floats]:
    """Lower and upper limits of all joints, each of shape (n,) [rad or m]."""
    limits = zip(*(joint_limits(r.model) for r in scene.robots.values()), strict=True)
    lower, upper = map(np.concatenate, limits)
    return lower, upper


def link_blocks(layout: Layout) -> Iterator[Block]:
    """Primitives of all links; those of a robot's root body stand still."""
    for name, robot in layout.scene.robots.items():
        table = layout.tables[name]
        for link, fit in robot.fits.items():
            body = layout.body(name, link) if table.body_of_link[link] else -1
            frame = link_frame(robot, table, link)
            yield from blocks_of(f"{name}/{link}", fit.shapes, (), frame, body)
        if robot.gripper is not None and robot.gripper.coarse:
            link = robot.gripper.link
            box = coarse_gripper(robot, table)
            owner, body = f"{name}/{link}{COARSE}", layout.body(name, link)
            yield from blocks_of(owner, (box,), (), np.eye(4), body)


def link_frame(robot: SceneRobot, table: KinematicTable, link: str) -> Floats:
    """Frame of a link in its body; of the root body's links, in the world."""
    T = table.T_body_link[link]
    return robot.base.matrix() @ T if table.body_of_link[link] == 0 else T


def object_blocks(layout: Layout) -> Iterator[Block]:
    """Primitives of all objects; attached ones ride on their link's body.

    What may be gripped has a body of its own.
    """
    for name, item in layout.scene.objects.items():
        T, body = item.pose.matrix(), layout.own.get(name, -1)
        if body >= 0:
            T = np.eye(4)
        elif item.attached_to is not None:
            robot, link = item.attached_to.split("/", 1)
            T = layout.tables[robot].T_body_link[link] @ T
            if layout.tables[robot].body_of_link[link]:
                body = layout.body(robot, link)
            else:
                T = layout.scene.robots[robot].base.matrix() @ T
        yield from blocks_of(name, item.shapes, item.surfaces, T, body)


def rules_and_holds(
    layout: Layout, blocks: Sequence[Block]
) -> tuple[PairRules, HoldTables]:
    """Which bodies are checked, grippers, and what they may grip."""
    scene = layout.scene
    places: dict[str, tuple[int, int]] = {}
    start = 0
    for block in blocks:
        first, _ = places.get(block.owner, (start, start))
        start += len(block)
        places[block.owner] = (first, start)
    moving = {block.owner for block in blocks if block.body >= 0}
    owners = [*places, *(() if scene.sensing is None else (SENSED,))]
    rules = pair_rules(scene, allowed_pairs(scene), owners=owners, moving=moving)
    grippers = gripper_parts(layout)
    free_coarse(rules.checked, rules.buffers, rules.group_of, grippers)
    still = np.ones(len(rules.checked), dtype=np.uint8)
    still[[rules.group_of[owner] for owner in moving]] = 0
    objects = {
        name: Graspable(
            name=name,
            body=body,
            group=rules.group_of[name],
            grasp=scene.objects[name].graspable or Grasp(),
            rests_on=scene.objects[name].rests_on,
        )
        for name, body in layout.own.items()
    }
    holds = HoldTables(
        grippers=grippers,
        objects=objects,
        places=places,
        group_of=rules.group_of,
        rules=rules.checked,
        still=still,
    )
    return rules, holds


def gripper_parts(layout: Layout) -> tuple[GripperPart, ...]:
    """The grippers of a scene."""
    return tuple(
        GripperPart(
            robot=r,
            name=name,
            link=f"{name}/{gripper.link}",
            body=layout.body(name, gripper.link),
            fingers=tuple(f"{name}/{f}" for f in gripper.fingers if f in robot.fits),
            members=tuple(f"{name}/{m}" for m in gripper_members(robot)),
            coarse=f"{name}/{gripper.link}{COARSE}" if gripper.coarse else None,
            swap=gripper.swap,
        )
        for r, (name, robot) in enumerate(layout.scene.robots.items())
        if (gripper := robot.gripper) is not None
    )


def robot_parts(scene: Scene) -> tuple[RobotPart, ...]:
    """Each robot's part of q, and how it is guarded."""
    parts: list[RobotPart] = []
    for name, robot in scene.robots.items():
        joints = robot.model.q_names
        parts.append(
            RobotPart(
                name=name,
                first_joint=sum(part.joint_count for part in parts),
                joint_count=len(joints),
                joints=joints,
                mode=robot.mode,
                stopping=robot.stopping,
                response=robot.response,
                tool=f"{name}/{tool_link(robot.model)}",
            )
        )
    return tuple(parts)


def link_frames(layout: Layout) -> dict[str, LinkFrame]:
    """Where each link is on its body, by 'robot/link'."""
    return {
        f"{name}/{link}": LinkFrame(body=layout.body(name, link), T_body_link=T)
        for name, table in layout.tables.items()
        for link, T in table.T_body_link.items()
    }


def exact_parts(layout: Layout) -> dict[str, ExactPart]:
    """Exact geometry of the links that have another than their primitives."""
    return {
        f"{name}/{link}": ExactPart(
            fit.exact, link_frame(robot, layout.tables[name], link)
        )
        for name, robot in layout.scene.robots.items()
        for link, fit in robot.fits.items()
        if fit.exact
    }


def robots_of(layout: Layout, bodies: Ints) -> Ints:
    """Robot of each moving primitive, -1 of an object's, shape (m,)."""
    firsts = np.array(list(layout.first.values()))
    robots = np.searchsorted(firsts, bodies, side="right") - 1
    robots[np.isin(bodies, list(layout.own.values()))] = -1
    return robots.astype(np.int32)


def top_speeds(scene: Scene, blocks: Sequence[Block]) -> Floats:
    """Greatest speed of each primitive, shape (p,), or (0,) if no object moves."""
    if not any(item.top_speed > 0.0 for item in scene.objects.values()):
        return np.zeros(0)
    known = scene.objects
    speed = [known[b.owner].top_speed if b.owner in known else 0.0 for b in blocks]
    return repeated(np.array(speed), blocks)


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


def base_reaches(layout: Layout, kinds: Ints, bodies: Ints, rows: Floats) -> Floats:
    """Radius about its robot's base that no point of a primitive leaves, (m,) [m]."""
    frames = np.concatenate([frame_reaches(layout, name) for name in layout.tables])
    reach = np.zeros(len(kinds))
    for i, body in enumerate(bodies):
        if body < len(frames):
            own = slice(i, i + 1)
            reach[i] = frames[body] + farthest_corner(kinds[own], rows[own])
    return reach


def frame_reaches(layout: Layout, name: str) -> Floats:
    """Radius about a robot's base within which each of its bodies' frames stays [m]."""
    limits = joint_limits(layout.scene.robots[name].model)
    return reach_bounds(layout.tables[name], *limits)


def farthest_corner(kinds: Ints, rows: Floats) -> float:
    """Distance from the origin to the farthest corner of a box around primitives [m].

    Infinite if one of them has no end, or if there is none.
    """
    box = np.zeros(6)
    extent(kinds, rows, box)
    return float(np.linalg.norm(np.maximum(np.abs(box[:3]), np.abs(box[3:]))))


def root_cube(
    layout: Layout, kinds: Ints, bodies: Ints, rows: Floats
) -> tuple[Floats, float]:
    """Cube that holds everything the scene can contain: centre and edge [m].

    The cube of the scene's settings is taken if it holds what is static; otherwise
    it grows about that. An arm may reach out of it, and a half-space always does: the
    outermost leaves have no end.
    """
    scene = layout.scene
    box = np.zeros(6)
    first = int(np.count_nonzero(bodies >= 0))
    extent(kinds[first:], rows[first:], box)
    low, high = box[:3], box[3:]
    chosen = scene.index.cube
    if chosen is not None:
        middle, half = np.array(chosen.centre, dtype=np.float64), chosen.edge / 2.0
        if (middle - half <= low).all() and (high <= middle + half).all():
            return middle, chosen.edge
        low = np.minimum(low, middle - half)
        high = np.maximum(high, middle + half)
        return (low + high) / 2.0, float((high - low).max()) * CUBE_SLACK
    for name, robot in scene.robots.items():
        origin = robot.base.matrix()[:3, 3]
        reach = robot_reach(layout, name, kinds[:first], bodies[:first], rows[:first])
        low = np.minimum(low, origin - reach - scene.margin)
        high = np.maximum(high, origin + reach + scene.margin)
    return (low + high) / 2.0, float((high - low).max()) * CUBE_SLACK


def robot_reach(
    layout: Layout, name: str, kinds: Ints, bodies: Ints, rows: Floats
) -> float:
    """Radius about a robot's base that no primitive riding on it can leave [m].

    Half-spaces, which have no end, are left out.
    """
    reach = 0.0
    first = layout.first[name]
    for body, frame in enumerate(frame_reaches(layout, name), start=first):
        riders = bodies == body
        corner = farthest_corner(kinds[riders], rows[riders])
        if isfinite(corner):
            reach = max(reach, frame + corner)
    return reach
