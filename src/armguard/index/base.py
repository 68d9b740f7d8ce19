"""Protocol of an index of the broad phase."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.index.world import World


class Index(Protocol):
    """Index that finds the primitives that may be near a primitive.

    Every index keeps this contract: the candidates contain every pair whose distance is
    at most the larger of the two growths.

    Attributes:
        world: Primitives of the index; the caller moves them.
    """

    world: World

    def insert(self, i: int) -> None:
        """Add primitive i at its present row."""

    def remove(self, i: int) -> None:
        """Remove primitive i."""

    def update(self, i: int) -> None:
        """Update the index after primitive i moved to its present row."""

    def candidates(self, i: int) -> NDArray[np.int32]:
        """Ids of primitives that may be near primitive i, ascending, without i."""

    def check(self) -> None:
        """Check every invariant; raise OctreeError with the first that is violated."""

    def statistics(self) -> dict[str, object]:
        """Figures of the index by name, such as counts and bytes."""
