"""The pairs that came closest over a whole recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.guard.layout import CLEARANCE, FIRST, PROOF, SECOND, WITNESS
from armguard.guard.verdict import Names
from armguard.motion.pair_state import ALLOWED
from armguard.station.blackbox.report.block import Block

Floats = NDArray[np.float64]


@dataclass(slots=True)
class Closest:
    """Two bodies, and how near they came, with a contract or without one.

    Attributes:
        a: One body.
        b: The other.
        distance: Least distance of any of their primitives [m].
        at: When, on the monotonic clock [s].
        cycle: In which cycle.
        clearance: Least clearance, at whatever time [m].
        cycles: Recorded cycles in which they were within the margin.
        contract: Whether that was under a contract; what they did without one is told
            apart, since it must not hide behind it.
    """

    a: str
    b: str
    distance: float
    at: float
    cycle: int
    clearance: float
    cycles: int
    contract: bool


class ClosestPairs:
    """Collects the pairs of bodies that were near.

    Args:
        names: Names of the scene.
    """

    def __init__(self, names: Names) -> None:
        bodies = list(dict.fromkeys(names.bodies))
        place = {body: k for k, body in enumerate(bodies)}
        self._bodies = bodies
        self._body_of = np.array([place[body] for body in names.bodies], np.int64)
        self._found: dict[int, Closest] = {}

    def add(self, block: Block) -> None:
        """Take in a block."""
        near = block.near
        if not len(near):
            return
        count = len(self._bodies)
        a = self._body_of[near[:, FIRST].astype(np.int64)]
        b = self._body_of[near[:, SECOND].astype(np.int64)]
        allowed = near[:, PROOF] == ALLOWED
        key = 2 * (np.minimum(a, b) * count + np.maximum(a, b)) + allowed
        # The least distance of each pair comes first.
        order = np.lexsort((near[:, WITNESS], key))
        pairs, first = np.unique(key[order], return_index=True)
        # A cycle counts once for two bodies, however many primitives are near.
        size = len(block.frames)
        seen = np.unique(key * size + block.owner) // size
        cycles = dict(zip(*np.unique(seen, return_counts=True), strict=True))
        least = np.full(len(pairs), np.inf)
        np.minimum.at(least, np.searchsorted(pairs, key), near[:, CLEARANCE])
        for pair, k, clearance in zip(
            pairs.tolist(), order[first].tolist(), least.tolist(), strict=True
        ):
            owner = int(block.owner[k])
            new = Closest(
                a=self._bodies[int(a[k])],
                b=self._bodies[int(b[k])],
                distance=float(near[k, WITNESS]),
                at=float(block.t[owner]),
                cycle=int(block.cycle[owner]),
                clearance=clearance,
                cycles=int(cycles[pair]),
                contract=bool(allowed[k]),
            )
            self._found[pair] = joined(self._found.get(pair), new)

    def pairs(self) -> list[Closest]:
        """All pairs that were near, nearest first."""
        return sorted(self._found.values(), key=lambda pair: pair.distance)


def joined(old: Closest | None, new: Closest) -> Closest:
    """What two blocks say of the same pair."""
    if old is None:
        return new
    nearer = new if new.distance < old.distance else old
    return Closest(
        a=nearer.a,
        b=nearer.b,
        distance=nearer.distance,
        at=nearer.at,
        cycle=nearer.cycle,
        clearance=min(old.clearance, new.clearance),
        cycles=old.cycles + new.cycles,
        contract=old.contract,
    )
