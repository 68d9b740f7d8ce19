"""The pair whose proof is sought, and how a proof ends."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.record import maker, record

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# How a proof ends.
PROVEN = 0
NEEDED = 1  # as far as the bound can tell, some admissible motion breaks the distance
UNSURE = 2  # the bound is too coarse to tell
SPENT = 3  # the cycle's budget of tests is used up
ALLOWED = 4  # a contract is kept that lets the pair be nearer
EXCEEDED = 5  # neither that nor its distance
UNPROVEN = 6  # a robot leaves what comes by itself: it may be met on its way


@record
class Pair:
    """A pair while its proof is sought; of each field of two, the first is side A's.

    Attributes:
        kind: ShapeKind.
        body: Its body, -1 if it is static.
        plan: NEXT or NOW, the stop of its robot.
        primitive: Row of its levers in `Motion.levers`.
        exact: Row of its levers in `Motion.exact_levers`; -1: the primitive counts.
        row: Its row in the world as measured.
        local: Its row in its body's frame, or in the world if it is static.
        shared: Joints that move both sides alike.
        need: Distance to keep now [m].
        drift: Speed at which that grows [m/s].
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
def levers_of(side: int, p: Pair, m: Motion) -> Floats:
    """Levers of the joints that move a side, shape (l,) [m]."""
    levers: Floats = m.levers[p.primitive[side]]
    if p.exact[side] >= 0:
        levers = m.exact_levers[p.exact[side]]
    return levers
