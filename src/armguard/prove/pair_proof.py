"""What is proven of two links of one robot, and what a proof may cost."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Literal

Verdict = Literal["never", "always", "sometimes", "open"]

# Up to this distance two links touch. Rounding of poses and solver is far less [m].
TOUCHING = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What proofs may cost.

    Attributes:
        seconds: Time for all pairs together [s].
        boxes: Boxes of joint positions for each pair.
    """

    seconds: float = 60.0
    boxes: int = 50_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class PairProof:
    """What is known of two links of one robot.

    A link lies within its exact shapes and within its primitives. So two links are
    apart where either of these shows it, on either side, and they count as touching
    where none does: a mesh may be smaller than its hull and its primitives.

    Attributes:
        link_a: One link.
        link_b: The other.
        verdict: "never", they touch in no configuration; "always", in every one;
            "sometimes", a configuration of each kind is known; "open", not decided
            within the budget.
        least: Least distance found, negative where they overlap; infinite if a link
            has no geometry or the budget was spent before [m].
        nearest: Positions of the joints between the two where it was found; the other
            joints do not matter [rad or m].
        greatest: A great distance found [m].
        farthest: Positions where it was found [rad or m].
        bound: Proven over the whole joint box: no distance is less; minus infinity
            without a proof [m].
        boxes: Boxes of joint positions that were bounded.
        share_left: Share of the joint box that is not decided [-].
        seconds: Time it took [s].
    """

    link_a: str
    link_b: str
    verdict: Verdict
    least: float
    nearest: Mapping[str, float]
    greatest: float
    farthest: Mapping[str, float]
    bound: float
    boxes: int
    share_left: float
    seconds: float

    @property
    def touching(self) -> Mapping[str, float] | None:
        """Positions in which the two touch; None if none are known."""
        return self.nearest if self.least <= TOUCHING else None

    @property
    def apart(self) -> Mapping[str, float] | None:
        """Positions in which they are apart; None if none are known."""
        return self.farthest if self.greatest > TOUCHING else None


def without_geometry(link_a: str, link_b: str) -> PairProof:
    """A pair of which one has no geometry never touches."""
    return PairProof(
        link_a=link_a,
        link_b=link_b,
        verdict="never",
        least=inf,
        nearest={},
        greatest=inf,
        farthest={},
        bound=inf,
        boxes=0,
        share_left=0.0,
        seconds=0.0,
    )


def not_looked_at(link_a: str, link_b: str) -> PairProof:
    """A pair for which nothing was left of the budget."""
    return PairProof(
        link_a=link_a,
        link_b=link_b,
        verdict="open",
        least=inf,
        nearest={},
        greatest=-inf,
        farthest={},
        bound=-inf,
        boxes=0,
        share_left=1.0,
        seconds=0.0,
    )
