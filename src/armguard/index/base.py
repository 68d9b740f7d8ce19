"""What any index can do."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.index.world import World


class Index(Protocol):
    """Finds, for a primitive, the others that may be near it.

    Whatever the index: a pair whose distance is at most the larger of the two growths
    is never missing from the candidates.

    Attributes:
        world: The primitives; the caller moves them.
    """

    world: World

    def insert(self, i: int) -> None:
        """Take primitive i in, at its present row."""

    def remove(self, i: int) -> None:
        """Leave primitive i out from now on."""

    def update(self, i: int) -> None:
        """Follow primitive i to its present row."""

    def candidates(self, i: int) -> NDArray[np.int32]:
        """Ids that may be near primitive i, ascending, without i."""

    def check(self) -> None:
        """Audit every invariant; raise OctreeError with the first that is broken."""

    def statistics(self) -> dict[str, object]:
        """What the index looks like, in numbers."""
