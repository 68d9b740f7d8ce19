"""Pair of a proof, and the results of proofs."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.record import maker, record

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Results of a proof.
PROVEN = 0
NEEDED = 1  # by this bound some admissible motion violates the distance: stop
UNSURE = 2  # the bound is too coarse to decide
SPENT = 3  # the cycle's budget of tests is used up
ALLOWED = 4  # the pair satisfies a contract that permits it to be nearer
EXCEEDED = 5  # the pair satisfies neither its contract nor its distance
UNPROVEN = 6  # a recovering or evading robot: a moving object may still meet it


@record
class Pair:
    """Pair of a proof; of each field of two, the first is side A's.

    Attributes:
        kind: ShapeKind of each side, shape (2,).
        body: Body of each side, -1 if static, shape (2,).
        plan: Plan of its robot's stop, NEXT or NOW, shape (2,).
        primitive: Row of its levers in `Motion.levers`, shape (2,).
        exact: Row of its levers in `Motion.exact_levers`, -1 for those of the
            primitive, shape (2,).
        row: Row in the world as measured, shape (2, 16).
        local: Row in the frame of its body, or in the world if static, shape (2, 16).
        shared: Number of joints that move both sides alike.
        need: Required separation now [m].
        drift: Rate at which the required separation grows [m/s].
    """

    kind: Annotated[Longs, (2,)]
    body: Annotated[Longs, (2,)]
    plan: Annotated[Longs, (2,)]
    primitive: Annotated[Longs, (2,)]
    exact: Annotated[Longs, (2,)]
    row: Annotated[Floats, (2, ROW_WIDTH)]
    local: Annotated[Floats, (2, ROW_WIDTH)]
    shared: int
    need: float
    drift: float


new_pair = maker(Pair)


@kernel
def lever_of(side: int, k: int, p: Pair, m: Motion) -> float:
    """Lever of joint `k` of the chain that moves a side [m]."""
    if p.exact[side] >= 0:
        return float(m.exact_levers[p.exact[side], k])
    return float(m.levers[p.primitive[side], k])
