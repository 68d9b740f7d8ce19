"""Required separation as a sum of named terms, and in the symbols of the standards.

The protective separation distance of ISO/TS 15066 and ISO 10218-2 is

    S_p = S_h + S_r + S_s + C + Z_d + Z_r

for a person; for two arms the other arm takes the person's place. The sum is what the
guard enforces in this cycle, not a separate estimate. **No certification is claimed**:
the terms are for a risk assessment, and each is only as true as the figure behind it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import floor, isfinite

from armguard.guard.static_errors import STATIC_ERRORS

# Words of the terms that are not called by their names; terms of one word are summed.
WORDS = {
    "error": "measurement",
    "reaction_a": "reaction",
    "reaction_b": "reaction",
    "stopping_a": "stopping",
    "stopping_b": "stopping",
}

# Source of each term, by its word: keys of a scene file, or the cause.
SOURCES = {
    "floor": "buffer of the pair, kept at rest too",
    "model": "errors.model",
    "base": "errors.base and errors.base_turn",
    "object": "motion of the object since it was seen and until all rest",
    "measurement": "errors.position",
    "reaction": "motion until a stop takes effect: age, delays.command, period",
    "stopping": "motion from there to rest: deceleration, ramp, settle",
    "envelope": "the judged primitives are nearer than the exact shapes",
    "path": "curvature of the path and coarseness of the bound",
}

# Tenths of millimetres in a metre.
TENTHS = 1e4


@dataclass(frozen=True, slots=True)
class Budget:
    """Required separation of a pair, split by cause; the terms add up to `needed`.

    A is the pair's first side, B its second. Each term is the displacement of the two
    witness points towards each other by one cause, to the first order.

    Attributes:
        floor: The scene's buffer, kept at rest too [m].
        model: Model error of the robots [m].
        base: Error of the poses of their bases [m].
        object: Displacement of a moving object since it was seen and until all rest
            [m].
        error: Error of measured positions [m].
        reaction_a: Travel of A until a stop takes effect [m].
        stopping_a: Travel of A from there to rest, settling included [m].
        reaction_b: Travel of B until a stop takes effect [m].
        stopping_b: Travel of B from there to rest, settling included [m].
        envelope: By how much the judged shapes, primitives around links, are nearer
            than the exact shapes whose distance is reported [m].
        path: What the curvature of the path and the coarseness of the bound add, or,
            if negative, what the common time of both stops saves [m].
        needed: Sum of all terms [m].
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
        """Travel of both sides until their stops take effect [m]."""
        return self.reaction_a + self.reaction_b

    @property
    def stopping(self) -> float:
        """Travel of both sides from the effect of their stops to rest [m]."""
        return self.stopping_a + self.stopping_b

    @property
    def terms(self) -> dict[str, float]:
        """The terms by their words, in tenths that add up to the rounded sum [mm]."""
        found: dict[str, float] = {}
        for field in fields(self)[:-1]:
            word = WORDS.get(field.name, field.name)
            found[word] = found.get(word, 0.0) + getattr(self, field.name)
        return dict(zip(found, whole_tenths(list(found.values())), strict=True))

    @property
    def sentence(self) -> str:
        """What must be kept and its terms in one line, in millimetres."""
        terms = self.terms
        parts = " + ".join(f"{word} {v:.1f}" for word, v in terms.items() if v > 0.0)
        kept = max(sum(terms.values()), terms["floor"])
        returned = returned_words(terms)
        return f"must keep {kept:.1f} mm: {parts}" + (returned and f"; {returned}")

    def explain(self) -> str:
        """One line for each term, in millimetres, with its source."""
        terms = self.terms
        lines = [
            f"{value:8.1f} mm  {word}: {SOURCES[word]}"
            for word, value in terms.items()
            if value > 0.0
        ]
        returned = returned_words(terms)
        return "\n".join([*lines, f"  {returned}"] if returned else lines)


def returned_words(terms: Mapping[str, float]) -> str:
    """The part of the motion that does not reduce the distance, in words; "" for none.

    Args:
        terms: Terms by their words, see `Budget.terms` [mm].
    """
    floor, returned = terms["floor"], -terms["path"]
    if returned <= 0.0:
        return ""
    sentence = f"{returned:.1f} mm of the way are returned"
    if sum(terms.values()) >= floor:
        return sentence
    return f"the pair opens: {sentence}, floor {floor:.1f} mm stays"


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


@dataclass(frozen=True, slots=True)
class ProtectiveDistance:
    """Protective separation distance of a robot from a person or robot, by cause.

    Attributes:
        robot: The robot.
        other: The person, or the other robot.
        s_h: Travel of the other: of a person since it was seen and until all rest, of
            a robot its own reaction and stopping [m].
        s_r: Travel of the robot until its stop takes effect [m].
        s_s: Travel of the robot from there to rest, along its path [m]. Negative where
            the exact shapes are farther apart, or the common time of both stops saves
            more, than that travel.
        c: Intrusion distance, and all else that is kept at rest: the buffer of the
            pair, set by the object's `buffer` [m].
        z_d: Position error of the person [m]. There is no figure for it, and it is 0:
            add it to the person's shape or to `buffer`.
        z_r: Position error of the robot: measurement, base and model [m].
    """

    robot: str
    other: str
    s_h: float
    s_r: float
    s_s: float
    c: float
    z_d: float
    z_r: float

    @property
    def total(self) -> float:
        """S_p, the sum of the six terms [m]."""
        return self.s_h + self.s_r + self.s_s + self.c + self.z_d + self.z_r

    @property
    def sentence(self) -> str:
        """The sum with the standard's symbols, in millimetres."""
        letters = ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
        values = whole_tenths(
            [self.s_h, self.s_r, self.s_s, self.c, self.z_d, self.z_r]
        )
        parts = " + ".join(
            f"{letter} {value:.1f}"
            for letter, value in zip(letters, values, strict=True)
        )
        return f"S_p {sum(values):.1f} mm = {parts}"


def protective_distance(robot: str, other: str, budget: Budget) -> ProtectiveDistance:
    """Required separation of a pair in the symbols of the standards.

    Args:
        robot: Robot of the pair's first side.
        other: Robot or body of its second side.
        budget: Required separation of the pair.
    """
    return ProtectiveDistance(
        robot=robot,
        other=other,
        s_h=budget.object + budget.reaction_b + budget.stopping_b,
        s_r=budget.reaction_a,
        s_s=budget.stopping_a + budget.path,
        c=budget.floor,
        z_d=0.0,
        z_r=sum((getattr(budget, k.term) for k in STATIC_ERRORS[::-1]), budget.error),
    )
