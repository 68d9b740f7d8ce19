"""The pairs with the least distances of a whole recording."""

from dataclasses import dataclass, replace

import numpy as np

from armguard.guard.answer import Names
from armguard.guard.layout import CLEARANCE, FIRST, PROOF, SECOND, WITNESS
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.station.blackbox.report.cycles import Block
from armguard.station.blackbox.report.timeline import least_in_each


@dataclass(frozen=True, slots=True)
class Closest:
    """Two bodies and their least distance, with a contract or without one.

    Two bodies may be listed twice: a contract must not hide their distance without it.
    """

    a: str
    b: str
    distance: float  # least signed distance of their primitives [m]
    at: float  # its time, on the monotonic clock [s]
    cycle: int  # its cycle
    clearance: float  # least one of all cycles [m]
    cycles: int  # recorded cycles in which they were within the margin
    contract: bool  # whether a contract was in force
    unproven: int  # in how many of the cycles nothing was proven for the two


class ClosestPairs:
    """Collects the pairs of bodies that were near from successive blocks."""

    def __init__(self, names: Names) -> None:
        bodies = names.tables.body_names
        self._bodies = list(dict.fromkeys(bodies))
        place = {body: k for k, body in enumerate(self._bodies)}
        self._body_of = np.array([place[body] for body in bodies], np.int64)
        self._found: dict[int, Closest] = {}

    def add(self, block: Block) -> None:
        """Take in a block."""
        near, rows, count = block.near, block.rows, len(self._bodies)
        a = self._body_of[near[:, FIRST].astype(np.int64)]
        b = self._body_of[near[:, SECOND].astype(np.int64)]
        contract = near[:, PROOF] == ALLOWED
        key = 2 * (np.minimum(a, b) * count + np.maximum(a, b)) + contract
        pairs, of_pair = np.unique(key, return_inverse=True)
        nearest = least_in_each(near[:, WITNESS], of_pair)
        clearance = np.full(len(pairs), np.inf)
        np.minimum.at(clearance, of_pair, near[:, CLEARANCE])
        # A cycle counts once for two bodies, however many of their primitives are near.
        seen = np.unique(of_pair * len(rows) + block.owner) // len(rows)
        cycles = np.bincount(seen, minlength=len(pairs))
        open_ones = near[:, PROOF] == UNPROVEN
        nothing = np.unique(of_pair[open_ones] * len(rows) + block.owner[open_ones])
        unproven = np.bincount(nothing // len(rows), minlength=len(pairs))
        for n, (pair, k) in enumerate(zip(pairs.tolist(), nearest, strict=True)):
            row = rows[block.owner[k]]
            new = Closest(
                *(self._bodies[a[k]], self._bodies[b[k]], float(near[k, WITNESS])),
                *(float(row.t), int(row.cycle), float(clearance[n])),
                *(int(cycles[n]), bool(contract[k]), int(unproven[n])),
            )
            if old := self._found.get(pair):
                new = replace(
                    min(old, new, key=lambda pair: pair.distance),
                    clearance=min(old.clearance, new.clearance),
                    cycles=old.cycles + new.cycles,
                    unproven=old.unproven + new.unproven,
                )
            self._found[pair] = new

    def pairs(self) -> list[Closest]:
        """All pairs that were near, nearest first."""
        return sorted(self._found.values(), key=lambda pair: pair.distance)
