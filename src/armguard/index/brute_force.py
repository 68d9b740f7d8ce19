"""Brute force: every primitive is a candidate of every other."""

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.index.octree_query import present_primitives
from armguard.index.octree_state import ABSENT, INDEXED, empty_state
from armguard.index.world import World


class BruteForce:
    """Index without structure: oracle of the octree and baseline of the benchmarks.

    Args:
        world: Primitives of the index.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        count = len(world.kinds)
        # The cycle takes the state of an octree for any index; of this one it reads
        # only which primitives are present.
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
        self.residency["status"][:] = INDEXED
        self._out = np.zeros(max(count, 1), dtype=np.int32)

    def insert(self, i: int) -> None:
        """Add primitive i."""
        self.residency[i].status = INDEXED

    def remove(self, i: int) -> None:
        """Remove primitive i."""
        self.residency[i].status = ABSENT

    def update(self, i: int) -> None:
        """Do nothing: a motion changes no structure."""

    def candidates(self, i: int) -> NDArray[np.int32]:
        """Ids of all present primitives except i, ascending."""
        found = present_primitives(i, self.residency, self._out)
        return self._out[:found].copy()

    def check(self) -> None:
        """Check that every status is valid; there are no other invariants.

        Raises:
            OctreeError: A status is invalid.
        """
        if not np.isin(self.residency["status"], (ABSENT, INDEXED)).all():
            raise OctreeError("a primitive is neither present nor absent")

    def statistics(self) -> dict[str, object]:
        """Number of present primitives, and bytes."""
        return {
            "kind": "brute_force",
            "primitives": int((self.residency["status"] != ABSENT).sum()),
            "bytes": int(self.residency.nbytes + self._out.nbytes),
        }
