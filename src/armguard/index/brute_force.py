"""No index at all: every primitive is a candidate of every other."""

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.index.octree_query import present_primitives
from armguard.index.octree_state import INDEXED, STATUS, empty_state
from armguard.index.world import World


class BruteForce:
    """The oracle of the octree and the baseline of the benchmarks.

    Args:
        world: The primitives.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        count = len(world.kinds)
        # The cycle is handed an octree's state whatever the index; of this one it
        # reads only who is present.
        self.state = empty_state(
            count,
            leaf_capacity=1,
            max_depth=0,
            low=np.zeros(3),
            high=np.ones(3),
            node_capacity=1,
            entry_capacity=1,
            anchor_count=0,
        )
        self.residency = self.state.residency
        self.residency[:, STATUS] = INDEXED
        self._out = np.zeros(max(count, 1), dtype=np.int32)

    def insert(self, i: int) -> None:
        """Take primitive i in."""
        self.residency[i, STATUS] = INDEXED

    def remove(self, i: int) -> None:
        """Leave primitive i out from now on."""
        self.residency[i, STATUS] = 0

    def update(self, i: int) -> None:
        """Nothing follows a move: there is no structure."""

    def candidates(self, i: int) -> NDArray[np.int32]:
        """All primitives that are present, but i, ascending."""
        found = present_primitives(i, self.residency, self._out)
        return self._out[:found].copy()

    def check(self) -> None:
        """Every status is known; there is nothing else that could be wrong.

        Raises:
            OctreeError: A status is none.
        """
        if not np.isin(self.residency[:, STATUS], (0, INDEXED)).all():
            raise OctreeError("a primitive is neither present nor absent")

    def statistics(self) -> dict[str, object]:
        """How many primitives there are."""
        return {
            "kind": "brute_force",
            "primitives": int((self.residency[:, STATUS] != 0).sum()),
            "bytes": int(self.residency.nbytes + self._out.nbytes),
        }
