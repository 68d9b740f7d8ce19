"""Contracts in force, grippers, and what they may grip: arrays the kernels share."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.scene.tables import SceneTables
from armguard.table import ByteMatrix, LongMatrix, Matrix, Vector, table

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]
Bytes = NDArray[np.uint8]

# Contracts there is room for beside those by intent, of which each finger may have one.
SPARE_CONTRACTS = 64

# Places in the row of a contract. It is one between two bodies, A and B.
STATE = 0
KIND = 1
FIRST_A = 2  # first primitive of A
END_A = 3  # the one after its last
FIRST_B = 4
END_B = 5
GROUP_A = 6
GROUP_B = 7
DEPTH = 8  # how far they may overlap; negative: distance they must keep [m]
CREEP = 9  # greatest closing speed at contact [m/s]
GAIN = 10  # how much it may be more for each metre of distance [1/s]
UNTIL = 11  # when it expires [s]
REARM = 12  # distance from which on it is over [m]
NEAREST = 13  # least distance of the two in this cycle, infinite if not measured [m]
RELIED = 14  # 1 if a pair needed it in this cycle
NORMAL = 15  # normal of the nearest pair from A to B, 3 numbers
POINT = 18  # witness point of it on A, 3 numbers [m]
REGION = 21  # body the region stands in, see WORLD
HALF = 22  # half of the region's sizes, 3 numbers [m]
T_REGION = 25  # its frame in that body, 12 numbers
GRIPPER = 37  # gripper it is about, -1 if none
NEAR = 38  # distance at which `SPEED` may be had [m]
SPEED = 39  # what is faster than that does not mean it [m/s]
LIFT = 40  # distance from which on what is held has lifted clear [m]
CONTRACT = 41

# States of a contract; of several the lowest counts.
NONE = 0
IN_FORCE = 1
ENDING = 2  # over as soon as its pairs keep all they need without it
EXPIRED = 3  # over, and its pairs may still be nearer than that
DORMANT = 4  # of what a held object may be put down on, while it is carried elsewhere

# Kinds.
BY_INTENT = 1  # fingers approach what they are meant to grip
STANDING = 2  # a held object has not lifted clear, or is put down
BESIDE = 3  # it was nearer to something than it may be when it was gripped or let go
LET_GO = 4  # fingers round what was released
ASKED = 5  # somebody called `allow`

# Places of `REGION` that are no body.
NOWHERE = -2  # there is no region: anywhere will do
WORLD = -1

# Places in the row of a gripper.
ROBOT = 0
BODY = 1
FIRST_FINGER = 2  # its rows in `fingers`
END_FINGER = 3
FIRST_MEMBER = 4  # its rows in `members`
END_MEMBER = 5
SLOT = 6  # its first contract by intent; each finger has one
BOX = 7  # primitive of its coarse box, -1 if it has none
MODEL = 8  # which model is asked for
COARSE_NOW = 9  # 1 while the box stands for it
INTENDED = 10  # object its approach is meant for, -1 if none
SPENT_ON = 11  # object a contract by intent has expired for, -1 if none
HOLDS = 12  # how many objects it holds
GRIPPER_WIDTH = 13

# Models that may be asked for.
AUTO = 0
COARSE = 1
DETAILED = 2

# Places in the row of an object.
FIRST = 0
END = 1
OBJECT_BODY = 2
GROUP = 3
HOLDER = 4  # gripper that carries it, -1 if none
SECOND = 5  # gripper that holds it as well, -1 if none
OBJECT_NEAR = 6
INTENT_SPEED = 7
OBJECT_CREEP = 8
OBJECT_DEPTH = 9
AIM = 10
EXPIRY = 11
OBJECT_WIDTH = 12


@table
class Grips(NamedTuple):
    """All that contracts and grippers need in a cycle.

    Attributes:
        contracts: Contracts, shape (c, CONTRACT).
        may: 1 for groups with a contract between any of their bodies, shape (g, g).
        grippers: Grippers, shape (k, GRIPPER_WIDTH).
        swap: Distance at which the box of each gripper is replaced, shape (k,) [m].
        fingers: First primitive of each finger, the one after its last, and its group,
            shape (f, 3).
        members: First primitive of each link of a gripper, and the one after its last,
            shape (l, 2).
        objects: What may be gripped, shape (o, OBJECT_WIDTH).
        velocity: Scratch for velocities of joints, shape (n,).
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
    """Arrays for a scene: nothing is held, and no contract is in force."""
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
