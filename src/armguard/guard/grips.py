"""Rows of contracts, grippers and graspable objects, as the kernels use them."""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.record import Records, record, records
from armguard.scene.tables import SceneTables
from armguard.table import ByteMatrix, Vector, table

Floats = NDArray[np.float64]

# Rows for contracts other than those by intent, of which each finger has one.
SPARE_CONTRACTS = 64

# Values of `ContractRow.region` that are no body.
ANYWHERE = -2  # no region: contact is permitted anywhere
WORLD = -1


class ContractState(IntEnum):
    """State of a contract; of several contracts the one with the lowest applies.

    Attributes:
        NONE: The row has no contract.
        IN_FORCE: The contract permits its contact.
        ENDING: It ends as soon as its pairs keep their separation without it.
        EXPIRED: It is over, but its pairs may still be too near without it.
        DORMANT: It is with a possible support of an object that is carried elsewhere.
    """

    NONE = 0
    IN_FORCE = 1
    ENDING = 2
    EXPIRED = 3
    DORMANT = 4


class ContractKind(IntEnum):
    """Why there is a contract.

    Attributes:
        INTENT: Fingers approach a grasp target.
        SUPPORT: A held object has not lifted off its support, or is put down.
        NEIGHBOUR: An object was too near to a body when it was grasped or released.
        RELEASED: Fingers are around a released object.
        REQUESTED: `allow` requested it.
    """

    INTENT = 1
    SUPPORT = 2
    NEIGHBOUR = 3
    RELEASED = 4
    REQUESTED = 5


class GripperModel(IntEnum):
    """Models of a gripper that may be requested, see `Grippers.swap_model`."""

    AUTO = 0
    COARSE = 1
    DETAILED = 2


@record
class ContractRow:
    """A contract between two bodies A and B.

    Attributes:
        state: See `ContractState`.
        kind: See `ContractKind`.
        first_a: First primitive of A.
        end_a: Index after its last primitive.
        first_b: First primitive of B.
        end_b: Index after its last primitive.
        group_a: Rule group of A.
        group_b: Rule group of B.
        depth: Permitted overlap; negative: distance they must keep [m].
        creep: Greatest closing speed at contact [m/s].
        gain: Increase of that speed per metre of distance [1/s].
        until: Time of expiry [s].
        end_distance: Distance beyond which the contract ends [m].
        nearest: Least distance of A and B in this cycle, infinite if not measured [m].
        used: 1 if a pair needed the contract in this cycle.
        normal: Normal of the nearest pair from A to B [-].
        point: Witness point of the nearest pair on A [m].
        region: Body that the region moves with, or ANYWHERE or WORLD.
        half: Half extents of the region [m].
        T_region: Frame of the region in that body.
        gripper: Index of its gripper, -1 if none.
        near: Distance at which `speed` is permitted [m].
        speed: Speed above which no intent is recognised [m/s].
        lift: Distance beyond which a held object counts as lifted [m].
    """

    state: int
    kind: int
    first_a: int
    end_a: int
    first_b: int
    end_b: int
    group_a: int
    group_b: int
    depth: float
    creep: float
    gain: float
    until: float
    end_distance: float
    nearest: float
    used: int
    normal: Annotated[Floats, (3,)]
    point: Annotated[Floats, (3,)]
    region: int
    half: Annotated[Floats, (3,)]
    T_region: Annotated[Floats, (12,)]
    gripper: int
    near: float
    speed: float
    lift: float


@record
class GripperRow:
    """A gripper.

    Attributes:
        robot: Its robot.
        body: Body of its link.
        first_finger: Its first row in `fingers`, and of its contracts by intent.
        end_finger: Row after the last one.
        first_member: Its first row in `members`.
        end_member: Row after the last one.
        box: Primitive of its box, -1 if it has none.
        model: Requested `GripperModel`.
        coarse: 1 while the box represents it.
        target: Its grasp target among the objects, -1 if none.
        expired_target: Object for which a contract by intent has expired, -1 if none.
        held_count: Count of objects that it holds.
    """

    robot: int
    body: int
    first_finger: int
    end_finger: int
    first_member: int
    end_member: int
    box: int
    model: int
    coarse: int
    target: int
    expired_target: int
    held_count: int


@record
class LinkRow:
    """A link of a gripper.

    Attributes:
        first: Its first primitive.
        end: Index after its last primitive.
        group: Its rule group.
    """

    first: int
    end: int
    group: int


@record
class ObjectRow:
    """A graspable object.

    Attributes:
        first: Its first primitive.
        end: Index after its last primitive.
        body: Its body.
        group: Its rule group.
        holder: Gripper that carries it, -1 if none.
        second_holder: Second gripper that holds it, -1 if none.
        near: See `Grasp`, from here on.
        intent_speed: See there.
        creep: See there.
        depth: See there.
        aim: See there.
        expiry: See there.
    """

    first: int
    end: int
    body: int
    group: int
    holder: int
    second_holder: int
    near: float
    intent_speed: float
    creep: float
    depth: float
    aim: float
    expiry: float


@table
class Grips(NamedTuple):
    """Contracts, grippers and graspable objects of a scene, for the kernels.

    Attributes:
        contracts: Contracts, first the one by intent of each finger, shape (c,).
        may: 1 where two groups have a contract between their bodies, shape (g, g).
        grippers: Grippers, shape (k,).
        swap: Distance below which the box of each gripper is replaced, shape (k,) [m].
        fingers: Fingers of the grippers, shape (f,).
        members: Links of the grippers, shape (l,).
        objects: Graspable objects, shape (o,).
        velocity: Scratch for joint velocities, shape (n,) [rad/s or m/s].
    """

    contracts: Annotated[Records[ContractRow], 1]
    may: ByteMatrix
    grippers: Annotated[Records[GripperRow], 1]
    swap: Vector
    fingers: Annotated[Records[LinkRow], 1]
    members: Annotated[Records[LinkRow], 1]
    objects: Annotated[Records[ObjectRow], 1]
    velocity: Vector


def grips_of(tables: SceneTables) -> Grips:
    """Arrays for a scene in which no object is held and no contract is in force."""
    holds = tables.holds
    fingers = [name for part in holds.grippers for name in part.fingers]
    members = [name for part in holds.grippers for name in part.members]
    grippers = records(len(holds.grippers), GripperRow)
    finger = member = 0
    for row, part in zip(grippers, holds.grippers, strict=True):
        row.robot, row.body = part.robot, part.body
        row.first_finger, row.first_member = finger, member
        finger += len(part.fingers)
        member += len(part.members)
        row.end_finger, row.end_member = finger, member
        row.box = -1 if part.coarse is None else holds.places[part.coarse][0]
        row.target = row.expired_target = -1
    objects = records(len(holds.objects), ObjectRow)
    for row, item in zip(objects, holds.objects.values(), strict=True):
        row.first, row.end = holds.places[item.name]
        row.body, row.group = item.body, item.group
        row.holder = row.second_holder = -1
        for name in ("near", "intent_speed", "creep", "depth", "aim", "expiry"):
            row[name] = getattr(item.grasp, name)
    return Grips(
        contracts=records(len(fingers) + SPARE_CONTRACTS, ContractRow),
        may=np.zeros(holds.rules.shape, dtype=np.uint8),
        grippers=grippers,
        swap=np.array([part.swap for part in holds.grippers], dtype=np.float64),
        fingers=link_rows(fingers, tables),
        members=link_rows(members, tables),
        objects=objects,
        velocity=np.zeros(len(tables.q_names)),
    )


def link_rows(names: list[str], tables: SceneTables) -> Records[LinkRow]:
    """`LinkRow` of each of some links."""
    rows: Records[LinkRow] = records(len(names), LinkRow)
    for k, name in enumerate(names):
        rows[k].first, rows[k].end = tables.holds.places[name]
        rows[k].group = tables.holds.group_of[name]
    return rows
