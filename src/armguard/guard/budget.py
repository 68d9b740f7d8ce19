"""What a pair must keep, as a sum of named terms."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, isfinite

# Tenths of millimetres in a metre.
TENTHS = 1e4


@dataclass(frozen=True, slots=True)
class Budget:
    """What a pair needs, split by cause; the terms add up to `needed`.

    A is the pair's first side, B its second. The terms say how far each cause moves
    the two witness points towards each other to the first order.

    Attributes:
        floor: The scene's buffer, kept at rest too [m].
        model: Model error of the robots [m].
        base: Error of where their bases stand [m].
        object: Way of an object that moves: since it was seen, and until all rest [m].
        error: Error of measured positions [m].
        reaction_a: Way of A until a stop takes effect [m].
        stopping_a: Way of A from there to rest, settling included [m].
        reaction_b: The same of B [m].
        stopping_b: The same of B [m].
        envelope: By how much the shapes that were judged, primitives around links, are
            nearer than the exact shapes whose distance is reported [m].
        path: What the bend of the path and coarseness of the bound add, or what its
            course on the common clock saves [m].
        needed: All together [m].
    """

    floor: float
    model: float
    base: float
    object: float
    error: float
    reaction_a: float
    stopping_a: float
    reaction_b: float
    stopping_b: float
    envelope: float
    path: float
    needed: float

    @property
    def reaction(self) -> float:
        """Way of both sides until stops take effect [m]."""
        return self.reaction_a + self.reaction_b

    @property
    def stopping(self) -> float:
        """Way of both sides from there to rest [m]."""
        return self.stopping_a + self.stopping_b

    @property
    def sentence(self) -> str:
        """The sum in words and millimetres, terms that are nothing left out."""
        terms = [
            ("floor", self.floor),
            ("model", self.model),
            ("base", self.base),
            ("object", self.object),
            ("measurement", self.error),
            ("reaction", self.reaction),
            ("stopping", self.stopping),
            ("envelope", self.envelope),
            ("path", self.path),
        ]
        values = whole_tenths([value for _, value in terms])
        told = [
            f"{name} {value:.1f}"
            for (name, _), value in zip(terms, values, strict=True)
            if value
        ]
        parts = " + ".join(told).replace("+ path -", "- path ")
        return f"needs {sum(values):.1f} mm = {parts or '0'}"


def whole_tenths(terms: Sequence[float]) -> list[float]:
    """Terms in tenths of millimetres whose sum is the rounded sum of the terms.

    Each is off by less than a tenth: those nearest to the next one are rounded up.

    Args:
        terms: Lengths [m].

    Returns:
        Lengths [mm], rounded.

    Example:
        >>> whole_tenths([0.01004, 0.01004, 0.01004])
        [10.1, 10.0, 10.0]
    """
    if not all(isfinite(term) for term in terms):
        return [term * 1e3 for term in terms]
    exact = [term * TENTHS for term in terms]
    whole = [floor(value) for value in exact]
    lacking = round(sum(exact)) - sum(whole)
    order = sorted(range(len(exact)), key=lambda k: whole[k] - exact[k])
    for k in order[:lacking]:
        whole[k] += 1
    return [value / 10.0 for value in whole]
