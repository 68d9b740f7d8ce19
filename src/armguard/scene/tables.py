"""A scene as flat arrays: all a cycle reads, in the order it reads them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import Shape
from armguard.robot.stopping import StoppingFigures
from armguard.scene.exact import ExactTables
from armguard.scene.hold_tables import HoldTables
from armguard.scene.sensing import SceneSensing
from armguard.scene.settings import IndexSettings, Mode, ResponseSettings
from armguard.scene.standing import Standing

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPart:
    """A robot's part of q, and how it is guarded.

    Attributes:
        name: Its name in the scene.
        first_joint: Its first place in q.
        joint_count: How many it has.
        joints: Their names in the URDF.
        mode: What its buffer follows.
        stopping: How it stops; None if not declared, which mode "fixed" allows.
        response: Its response near other bodies.
        tool: Its tool's link, 'robot/link'.
    """

    name: str
    first_joint: int
    joint_count: int
    joints: tuple[str, ...]
    mode: Mode
    stopping: StoppingFigures | None
    response: ResponseSettings
    tool: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFrame:
    """Where a link is on its body.

    Attributes:
        body: The body, in the order of the tables.
        T_body_link: Its frame there, shape (4, 4).
    """

    body: int
    T_body_link: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneTables:
    """Flat tables of a compiled scene.

    Bodies are rigid groups of links, in an order in which a parent comes before its
    children. Primitives are sorted: the `moving_count` that move come first.

    Attributes:
        q_names: 'robot/joint' of each place of q.
        lower: Least joint positions, shape (n,) [rad or m].
        upper: Greatest joint positions, shape (n,) [rad or m].
        home: Home configuration, shape (n,) [rad or m].
        parent: Parent body, -1 for a robot's root, shape (b,).
        joint_kind: 0 fixed, 1 revolute, 2 prismatic, shape (b,).
        q_index: Place in q that moves the body, -1 if none, shape (b,).
        gain: Multiplier and offset of that position, shape (b, 2).
        T_parent_joint: Joint frame in the parent body's, 3×4 by rows, shape (b, 12).
        axis: Unit joint axis, shape (b, 3).
        kinds: ShapeKind of each primitive, shape (p,).
        bodies: Body a primitive rides on, -1 if it is static, shape (p,).
        owners: What the index counts as one object, see `index_owners`, shape (p,).
        local_rows: Rows in the frame of the body, or in the world, shape (p, 16).
        groups: Rule group of each primitive, shape (p,).
        checked: 1 where two groups are checked against each other, shape (g, g).
        buffers: Required distance of two groups, shape (g, g) [m].
        growth: Extra radius in the index, shape (p,) [m].
        margin: Signed distance up to which a pair is reported [m].
        moving_count: Number of moving primitives.
        checkable_pairs: Pairs of primitives that are checked at all.
        body_names: 'robot/link' or object of each primitive, length p.
        labels: Name of each primitive: the body's, with a number if it has several.
        model_errors: How far a primitive may reach beyond the surface it encloses,
            shape (p,) [m].
        shapes: Shapes whose numbers rows lead to; kept so that these live as long.
        standing: Static objects, by name.
        exact: The second stage of links: their collision geometry itself.
        cube_centre: Centre of the octree's root cube, shape (3,) [m].
        cube_edge: Its edge [m].
        index: How near pairs are found.
        notes: What the user should know, one sentence each.
        robots: Robots in the order of q.
        links: Frame of each link, by 'robot/link'.
        robot_of_primitive: Robot each primitive rides on, -1 for none: of what may be
            gripped, while no robot holds it, shape (m,).
        base_reach: Radius about its robot's base that no point of a moving primitive
            leaves, shape (m,) [m].
        top_speeds: Greatest speed of each primitive that no robot moves, shape (p,),
            or of none, shape (0,) [m/s].
        people: Objects that stand for persons.
        period: Time from one cycle to the next [s].
        late: How much later than that it may come [s].
        holds: Grippers and what they may grip.
        sensing: Sensed space; None if the scene has none.
        sensors: Names of the sensors, by their numbers from 1 on.
        slots: Primitives at the end that stand for sensed cells, see `with_slots`.
    """

    q_names: tuple[str, ...]
    lower: Floats
    upper: Floats
    home: Floats
    parent: Ints
    joint_kind: Ints
    q_index: Ints
    gain: Floats
    T_parent_joint: Floats
    axis: Floats
    kinds: Ints
    bodies: Ints
    owners: Ints
    local_rows: Floats
    groups: Ints
    checked: NDArray[np.uint8]
    buffers: Floats
    growth: Floats
    margin: float
    moving_count: int
    checkable_pairs: int
    body_names: Sequence[str]
    labels: Sequence[str]
    model_errors: Floats
    shapes: tuple[Shape, ...]
    standing: Mapping[str, Standing]
    exact: ExactTables
    cube_centre: Floats
    cube_edge: float
    index: IndexSettings
    notes: tuple[str, ...]
    robots: tuple[RobotPart, ...]
    links: Mapping[str, LinkFrame]
    robot_of_primitive: Ints
    base_reach: Floats
    top_speeds: Floats
    people: tuple[str, ...]
    period: float
    late: float
    holds: HoldTables
    sensing: SceneSensing | None
    sensors: tuple[str, ...]
    slots: int = 0

    @property
    def modelled(self) -> int:
        """Number of primitives of the scene; slots for sensed cells come after them."""
        return len(self.kinds) - self.slots
