"""Sensed space of a guard: its cells, and slots for those that are near a robot.

Cells of four kinds are obstacles. Each kind has some slots: primitives at the end of
the tables that are boxes around cells while these are near a robot.
"""

from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np

from armguard.cells.clearance import Query
from armguard.cells.state import (
    NONE,
    Bits,
    Claims,
    Triple,
    Words,
    empty_bits,
)
from armguard.record import Records, record, records
from armguard.scene.sensing import SceneSensing
from armguard.scene.tables import SceneTables
from armguard.table import TABLE, ByteVector, IntMatrix, IntVector, table


class CellKind(IntEnum):
    """Kind of an obstacle that consists of cells.

    Attributes:
        STILL: Occupied cells that stand still.
        MOVING: Occupied cells that may move as an intruder does, since their stamp.
        UNSEEN: Cells that are not known free, and stand still.
        GROWING: Cells that are not known free, from which an intruder may come.
    """

    STILL = 0
    MOVING = 1
    UNSEEN = 2
    GROWING = 3


# Kind of cells that are not known free, by `unknown` of the scene; -1 for none.
KIND_OF = {"free": -1, "still": CellKind.UNSEEN, "moving": CellKind.GROWING}

# Kinds that grow at the intruder's speed.
GROWS = (CellKind.MOVING, CellKind.GROWING)

# Slots of each kind for each robot. A slot in use has a row of the answer, and the
# program of a robot has room for the rows of 48 near pairs.
SLOTS = (48, 48, 96, 96)

# What becomes one slot: the cells of a word, or what lies behind a plane; and that the
# cells near a robot are not judged at all.
BY_WORD, BY_PLANE, GIVEN_UP = 0, 1, 2

# Boxes of cells near a primitive that are listed at most.
LISTED = 2048


@record
class Knowledge:
    """What is known of all cells together.

    Attributes:
        stamp: Time at which the claims of all cells hold, -inf before the first [s].
        newest: Newest stamp of a claim [s].
        oldest: Oldest stamp of a moving cell, inf if none moves [s].
        error: Greatest error of a claim [m].
        speed: Greatest speed of an intruder [m/s].
        stale: Age from which on all robots stop [s].
        outside: `CellKind` of space outside the region, -1 for free space.
        used: Slots in use, of the kind and the robot that are judged.
        spent: 1 where slots or work did not suffice for them.
        limit: Work of the robot at which it does not suffice.
        listed: Boxes in `Sensed.listed`.
    """

    stamp: float
    newest: float
    oldest: float
    error: float
    speed: float
    stale: float
    outside: int
    used: int
    spent: int
    limit: int
    listed: int


@record
class Search:
    """What the cells near a primitive are compared with.

    Attributes:
        primitive: The primitive.
        robot: Its robot.
        kind: `CellKind` that is judged.
        level: What becomes one slot, BY_WORD or BY_PLANE.
        low: Lower corner of the box that its cells meet if they matter, world [m].
        high: Its upper corner [m].
        look: Distance beyond which cells do not matter [m].
        need: Distance that cells have to keep at rest [m].
        middle: Centre of the ball round the primitive, half way through a stop [m].
        astray: Greatest way of that centre from there, along each axis [m].
        clear: Distance beyond that way at which cells do not matter, inf where twists
            bound no way [m].
    """

    primitive: int
    robot: int
    kind: int
    level: int
    low: Triple
    high: Triple
    look: float
    need: float
    middle: Triple
    astray: Triple
    clear: float


@record
class Demand:
    """What a robot had to do before cells were judged.

    Attributes:
        must: 1 if it had to stop.
        cause: Why, a `Reason`.
        time_left: Least time left of its pairs [s].
        tests: Intervals of stops that were tested in the cycle.
        notes: Pairs that were noted, see `note_pair`.
    """

    must: int
    cause: int
    time_left: float
    tests: int
    notes: int


@record
class CellBox:
    """A box around cells.

    Attributes:
        low: Its lower corner, world [m].
        high: Its upper corner [m].
        gap: Distance of the primitive from it, less the error of its cells [m].
        stamp: Oldest stamp of its cells [s].
        error: Greatest of their errors [m].
        source: Sensor from which they are, see `Claims`.
        open: 1 until the box is in a slot.
    """

    low: Triple
    high: Triple
    gap: float
    stamp: float
    error: float
    source: int
    open: int


@table
class Sensed(NamedTuple):
    """Cells that a guard knows.

    Attributes:
        claims: Claims of the map.
        still: Cells of kind STILL, without those that objects claim.
        moving: Cells of kind MOVING, likewise.
        unseen: Cells of kind UNSEEN, likewise.
        growing: Cells of kind GROWING, likewise.
        may_be_unseen: Cells that are of kind UNSEEN while they are not known free,
            shape (words,).
        may_be_growing: The same of kind GROWING.
        claimed: Cells inside objects of the scene, shape (words,).
        carried: Primitives that a robot may carry, shape (k,).
        slots: First slot of each kind for each robot, and the one after the last of the
            kind, shape (4, robots + 1).
        sources: Sensor from which the cells of each slot are, shape (slots,).
        coarse: How the cells of each kind near each robot were last judged in this
            cycle, see `judge_robot`, shape (4, robots).
        work: Work on the cells near each robot in this cycle, see `count_work`, shape
            (robots,).
        evaded: 1 where cells of a cluster that a robot evades are near it, shape
            (robots,).
        before: Scratch: demand of a robot before its cells are judged.
        demand: Scratch: that before a box is judged.
        about: What is known of all cells together.
        query: Scratch: a primitive.
        search: Scratch: what cells near it are compared with.
        box: Scratch: cells that are to be one slot.
        listed: Scratch: boxes near the primitive, shape (k,).
    """

    claims: Annotated[Claims, TABLE]
    still: Annotated[Bits, TABLE]
    moving: Annotated[Bits, TABLE]
    unseen: Annotated[Bits, TABLE]
    growing: Annotated[Bits, TABLE]
    may_be_unseen: Words
    may_be_growing: Words
    claimed: Words
    carried: IntVector
    slots: IntMatrix
    sources: ByteVector
    coarse: IntMatrix
    work: IntVector
    evaded: IntVector
    before: Demand
    demand: Demand
    about: Knowledge
    query: Query
    search: Search
    box: CellBox
    listed: Annotated[Records[CellBox], 1]


def empty_sensed(tables: SceneTables, claims: Claims) -> Sensed:
    """Sensed space of a guard that has seen nothing.

    Args:
        tables: Its tables.
        claims: Claims of a map that has seen nothing.
    """
    words = len(claims.stamp)
    still, moving, unseen, growing = (empty_bits(words, NONE) for _ in range(4))
    masks = [np.zeros(words, dtype=np.uint64) for _ in range(3)]
    robots = len(tables.robots)
    first = tables.modelled + robots * np.cumsum((0, *SLOTS[:-1]))
    slots = first[:, None] + np.outer(SLOTS, np.arange(robots + 1))
    carried = [
        np.arange(*tables.holds.places[name]) for name in tables.holds.objects
    ] or [np.zeros(0, dtype=np.int64)]
    return Sensed(
        claims=claims,
        still=still,
        moving=moving,
        unseen=unseen,
        growing=growing,
        may_be_unseen=masks[0],
        may_be_growing=masks[1],
        claimed=masks[2],
        carried=np.concatenate(carried).astype(np.int32),
        slots=slots.astype(np.int32),
        sources=np.zeros(robots * sum(SLOTS), dtype=np.uint8),
        coarse=np.zeros((len(SLOTS), robots), dtype=np.int32),
        work=np.zeros(robots, dtype=np.int32),
        evaded=np.zeros(robots, dtype=np.int32),
        before=records((), Demand),
        demand=records((), Demand),
        about=knowledge_of(tables.sensing),
        query=records((), Query),
        search=records((), Search),
        box=records((), CellBox),
        listed=records(LISTED, CellBox),
    )


def knowledge_of(sensing: SceneSensing | None) -> Knowledge:
    """Knowledge before the first claims."""
    about = records((), Knowledge)
    about.stamp = about.newest = -np.inf
    about.oldest, about.outside = np.inf, -1
    if sensing is not None:
        about.speed, about.stale = sensing.intruder.speed, sensing.stale
        about.outside = KIND_OF[sensing.unknown]
    found: Knowledge = about
    return found
