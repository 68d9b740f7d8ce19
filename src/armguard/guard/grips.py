"""Arrays of contracts, grippers and graspable objects, as the kernels use them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables
from armguard.table import ByteMatrix, LongMatrix, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

# Rows for contracts other than those by intent, of which each finger has one.
SPARE_CONTRACTS = 64

# Columns of the row of a contract between two bodies A and B.
STATE = 0
KIND = 1
FIRST_A = 2  # first primitive of A
END_A = 3  # index after its last primitive
FIRST_B = 4
END_B = 5
GROUP_A = 6
GROUP_B = 7
DEPTH = 8  # permitted overlap; negative: distance they must keep [m]
CREEP = 9  # greatest closing speed at contact [m/s]
GAIN = 10  # increase of that speed per metre of distance [1/s]
UNTIL = 11  # time of expiry [s]
REARM = 12  # distance beyond which the contract ends [m]
NEAREST = 13  # least distance of A and B in this cycle, infinite if not measured [m]
RELIED = 14  # 1 if a pair needed the contract in this cycle
NORMAL = 15  # normal of the nearest pair from A to B, 3 numbers
POINT = 18  # witness point of the nearest pair on A, 3 numbers [m]
REGION = 21  # body that the region moves with, see WORLD
HALF = 22  # half extents of the region, 3 numbers [m]
T_REGION = 25  # frame of the region in that body, 12 numbers
GRIPPER = 37  # index of its gripper, -1 if none
NEAR = 38  # distance at which `SPEED` is permitted [m]
SPEED = 39  # speed above which no intent is recognised [m/s]
LIFT = 40  # distance beyond which a held object counts as lifted [m]
CONTRACT = 41

# States of a contract; of several contracts the one with the lowest state applies.
NONE = 0
IN_FORCE = 1
ENDING = 2  # ends as soon as its pairs keep their separation without it
EXPIRED = 3  # over, but its pairs may still be too near without it
DORMANT = 4  # with a possible support of a held object that is carried elsewhere

# Kinds.
BY_INTENT = 1  # fingers approach a grasp target
STANDING = 2  # a held object has not lifted off its support, or is put down
BESIDE = 3  # an object was too near to a body when it was grasped or released
LET_GO = 4  # fingers around a released object
ASKED = 5  # requested by `allow`

# Values of `REGION` that are no body.
NOWHERE = -2  # no region: contact is permitted anywhere
WORLD = -1

# Columns of the row of a gripper.
ROBOT = 0
BODY = 1
FIRST_FINGER = 2  # its first row in `fingers`
END_FINGER = 3
FIRST_MEMBER = 4  # its first row in `members`
END_MEMBER = 5
SLOT = 6  # row of its first contract by intent; each finger has one
BOX = 7  # primitive of its box, -1 if it has none
MODEL = 8  # requested model
COARSE_NOW = 9  # 1 while the box represents it
INTENDED = 10  # index of its grasp target, -1 if none
SPENT_ON = 11  # object for which a contract by intent has expired, -1 if none
HOLDS = 12  # count of objects that it holds
GRIPPER_WIDTH = 13

# Models that may be requested.
AUTO = 0
COARSE = 1
DETAILED = 2

# Columns of the row of a graspable object.
FIRST = 0
END = 1
OBJECT_BODY = 2
GROUP = 3
HOLDER = 4  # gripper that carries it, -1 if none
SECOND = 5  # second gripper that holds it, -1 if none
OBJECT_NEAR = 6
INTENT_SPEED = 7
OBJECT_CREEP = 8
OBJECT_DEPTH = 9
AIM = 10
EXPIRY = 11
OBJECT_WIDTH = 12


@table
class Grips(NamedTuple):
    """Contracts, grippers and graspable objects of a scene, for the kernels.

    Attributes:
        contracts: Contracts, see STATE, shape (c, CONTRACT).
        may: 1 where two groups have a contract between their bodies, shape (g, g).
        grippers: Grippers, see ROBOT, shape (k, GRIPPER_WIDTH).
        swap: Distance below which the box of each gripper is replaced, shape (k,) [m].
        fingers: For each finger: first primitive, index after its last primitive, and
            group, shape (f, 3).
        members: For each link of a gripper: first primitive and index after its last
            primitive, shape (l, 2).
        objects: Graspable objects, see FIRST, shape (o, OBJECT_WIDTH).
        velocity: Scratch for joint velocities, shape (n,) [rad/s or m/s].
    """

    contracts: Matrix
    may: ByteMatrix
    grippers: LongMatrix
    swap: Vector
    fingers: LongMatrix
    members: LongMatrix
    objects: Matrix
    velocity: Vector


def grips_of(tables: SceneTables) -> Grips:
    """Arrays for a scene in which no object is held and no contract is in force."""
    holds = tables.holds
    fingers = [(*holds.places[f], holds.group_of[f])
               for part in holds.grippers for f in part.fingers]  # fmt: skip
    members = [holds.places[m] for part in holds.grippers for m in part.members]
    grippers = np.zeros((len(holds.grippers), GRIPPER_WIDTH), dtype=np.int64)
    finger = member = 0
    for row, part in zip(grippers, holds.grippers, strict=True):
        row[ROBOT], row[BODY] = part.robot, part.body
        row[FIRST_FINGER], row[FIRST_MEMBER] = finger, member
        row[SLOT] = finger
        finger += len(part.fingers)
        member += len(part.members)
        row[END_FINGER], row[END_MEMBER] = finger, member
        row[BOX] = -1 if part.coarse is None else holds.places[part.coarse][0]
        row[INTENDED] = row[SPENT_ON] = -1
    objects = np.zeros((len(holds.objects), OBJECT_WIDTH))
    for about, thing in zip(objects, holds.objects.values(), strict=True):
        how = thing.grasp
        about[[FIRST, END]] = holds.places[thing.name]
        about[OBJECT_BODY], about[GROUP] = thing.body, thing.group
        about[HOLDER] = about[SECOND] = -1.0
        about[OBJECT_NEAR], about[INTENT_SPEED] = how.near, how.intent_speed
        about[OBJECT_CREEP], about[OBJECT_DEPTH] = how.creep, how.depth
        about[AIM], about[EXPIRY] = how.aim, how.expiry
    return Grips(
        contracts=np.zeros((finger + SPARE_CONTRACTS, CONTRACT)),
        may=np.zeros(holds.rules.shape, dtype=np.uint8),
        grippers=grippers,
        swap=np.array([part.swap for part in holds.grippers], dtype=np.float64),
        fingers=np.array(fingers, dtype=np.int64).reshape(-1, 3),
        members=np.array(members, dtype=np.int64).reshape(-1, 2),
        objects=objects,
        velocity=np.zeros(len(tables.q_names)),
    )
