"""Arrays that one call of the checker writes."""

from math import inf
from typing import NamedTuple

import numpy as np

from armguard.batch.check import LONGEST
from armguard.batch.near import Listing
from armguard.batch.plan import Plan, open_of
from armguard.batch.pose import CELLS, MOTIONS, ROWS, SPANS, Place
from armguard.batch.prove import WAITING, Walk
from armguard.batch.scratch import ROOM, Scratch, SearchSettings
from armguard.errors import SceneError
from armguard.geometry.shapes import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.lanes import WIDTH
from armguard.record import records
from armguard.table import Ledger

# Near pairs of a part of a batch that there is room for at first.
FIRST_ROOM = 1024


class Sizes(NamedTuple):
    """Sizes of a plan.

    Attributes:
        joints: Joint positions of a configuration.
        bodies: Bodies.
        shapes: Rows of primitives and of the balls around them.
        open: Pairs of parts that wait to be compared.
    """

    joints: int
    bodies: int
    shapes: int
    open: int


class Room(NamedTuple):
    """What one call writes.

    Attributes:
        scratch: See `Scratch`.
        spans: Place for spans of rows.
        rows: Place for rows.
        motions: Place for spans of motions.
        walk: See `Walk`; its `reached` is that of the last call.
    """

    scratch: Ledger
    spans: Ledger
    rows: Ledger
    motions: Ledger
    walk: Ledger


# The sine in lanes is exact up to this angle [rad].
LARGEST_ANGLE = 1e5

# `SearchSettings` of a call.
Settings = tuple[float, int, float, float]

# The array of a walk that a call brings.
REACHED = Walk._fields.index("reached")


def settings_of(margin: float, strict: int, drop: float, limit: float) -> Settings:
    """The settings of a call.

    Raises:
        SceneError: The margin is NaN or minus infinity.
    """
    if not margin > -inf:
        raise SceneError(f"margin is {margin} m; it must be a number")
    return margin, strict, drop, limit


def sizes_of(plan: Plan) -> Sizes:
    """Sizes of a plan."""
    shapes = len(plan.kinds)
    return Sizes(len(plan.grid), len(plan.parent), shapes, open_of(plan))


def limit_of(plan: Plan) -> float:
    """Greatest joint position that can be judged [rad or m]."""
    factor, offset = np.abs(plan.gain).max(axis=0, initial=1.0)
    return float((LARGEST_ANGLE - offset) / factor)


def room_of(sizes: Sizes) -> Room:
    """What one call writes."""
    spans, rows, motions = (place_of(mode, sizes) for mode in (SPANS, ROWS, MOTIONS))
    walk = Walk(
        waiting=np.zeros((WAITING, 4), dtype=np.int64),
        now=np.zeros((WIDTH, 4), dtype=np.int64),
        size=np.zeros(1, dtype=np.int64),
        reached=np.zeros(0, dtype=np.int64),
    )
    return Room(scratch_of(ROOM, sizes), spans, rows, motions, Ledger(walk))


def listing_of(count: int, sizes: Sizes) -> Ledger:
    """Room for pairs with their witness points."""
    return Ledger(
        Listing(
            total=np.zeros(1, dtype=np.int64),
            pairs=np.zeros((count, 3), dtype=np.int64),
            witness=np.zeros((count, WITNESS_WIDTH)),
            gradient=np.zeros((count, sizes.joints)),
        )
    )


def scratch_of(room: int, sizes: Sizes) -> Ledger:
    """Room beside the places, for so many pairs of each of eight spans or rows."""
    return Ledger(
        Scratch(
            settings=records((), SearchSettings),
            block=np.zeros(WIDTH * LONGEST * sizes.joints + WIDTH),
            sides=np.zeros(3 * WIDTH),
            kept=np.zeros(WIDTH, dtype=np.int64),
            pairs=np.zeros((WIDTH * room, 2), dtype=np.int32),
            low=np.zeros((WIDTH * room, 2)),
            single=np.zeros((4, ROW_WIDTH)),
            cells=place_arrays(CELLS, sizes),
        )
    )


def place_of(mode: int, sizes: Sizes) -> Ledger:
    """Room for eight configurations."""
    return Ledger(place_arrays(mode, sizes))


def place_arrays(mode: int, sizes: Sizes) -> Place:
    """The arrays of a place."""
    slots = sizes.bodies * (1 + sizes.bodies)
    return Place(
        mode=np.array([mode]),
        q=np.zeros(WIDTH * sizes.joints),
        half=np.zeros(WIDTH * sizes.joints),
        T=np.zeros(WIDTH * 12 * sizes.bodies),
        rows=np.zeros(WIDTH * ROW_WIDTH * sizes.shapes),
        stamp=np.zeros(sizes.shapes, dtype=np.int64),
        turn=np.zeros(1, dtype=np.int64),
        shift=np.zeros(WIDTH * slots),
        swing=np.zeros(WIDTH * slots),
        best=np.zeros(WIDTH),
        pair=np.zeros(WIDTH),
        lead=np.full(WIDTH, -1.0),
        bound=np.zeros(WIDTH),
        cells=np.zeros(WIDTH * sizes.joints),
        open=np.zeros(sizes.open, dtype=np.int64),
        apart=np.zeros(WIDTH * sizes.open),
        close=np.zeros(sizes.shapes, dtype=np.int64),
        growth=np.zeros(WIDTH * sizes.shapes),
    )
