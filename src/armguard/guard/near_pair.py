"""A near pair: two primitives that a verdict reports, in numbers and in words."""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard.watch import HYSTERESIS, SLOW_TIME_DEFAULT

Floats = NDArray[np.float64]

# A model error that rounds to less is left out of an explanation [m].
WORTH_A_CLAUSE = 5e-4

# Fields of a pair in JSON, in that order.
IN_WORDS = (
    "a b primitive_a primitive_b distance primitive_distance exact_distance buffer "
    "headroom needed envelope time_left time_to_contact point_a point_b normal "
    "model_error contract unproven"
).split()


def listed(value: object) -> object:
    """An array as a list; any other value unchanged."""
    return value.tolist() if isinstance(value, np.ndarray) else value


@dataclass(frozen=True, slots=True)
class SensedCells:
    """Cells that are a side of a near pair.

    Attributes:
        unseen: Whether they are cells that no sensor has seen free; otherwise they are
            occupied.
        age: Age of the claims about them [s]; None if the verdict was recorded.
        sensor: The sensor that looked last at them; None if there is none, if there are
            several, or if the verdict was recorded.
    """

    unseen: bool
    age: float | None
    sensor: str | None


@dataclass(frozen=True, slots=True)
class NearPair:
    """A near pair: two primitives that a verdict reports.

    `point_b - point_a = distance · normal`.

    Attributes:
        a: Body of A: 'robot/link' or an object's name.
        b: Body of B.
        primitive_a: Primitive of A; a body may have several.
        primitive_b: Primitive of B.
        distance: Signed distance that the verdict uses: that of the primitives, or of
            the exact shapes where those are farther apart [m].
        primitive_distance: Signed distance of the primitives [m].
        exact_distance: Signed distance of the exact shapes of the two links or
            objects; None where the primitives keep their buffer and the exact shapes
            were not measured [m].
        buffer: Distance the pair must keep [m].
        headroom: Headroom: distance minus required separation. Required is the buffer
            alone in mode "fixed", else the buffer plus the distance that the two sides
            can still close until both rest; negative: a stop is due [m].
        envelope: By how much the judged shapes are nearer than those whose distance is
            reported; part of the required separation [m].
        time_left: Time that the present motion may continue before a stop must be
            ordered [s]; infinite where nothing moves.
        time_to_contact: Lower bound of the time to contact, for any operator input
            [s]; infinite where nothing moves. A coarser, shorter bound from levers for
            pairs that are not the first their robots can touch.
        point_a: Witness point on A, world frame, shape (3,) [m].
        point_b: Witness point on B, world frame, shape (3,) [m].
        normal: Unit vector from A to B, world frame, shape (3,).
        model_error: How far the measured shapes may reach beyond the real surfaces,
            sum of both sides: the primitives, or the exact shapes where `distance` is
            theirs; a convex hull fills the dents of its mesh [m].
        contract: Whether the pair is this near under a contract that it keeps; then
            `buffer` is minus the allowed depth, and the headroom the rest of it.
        sensed: The cells that B consists of; None if it is of the scene.
        unproven: Whether nothing is proven for the pair: its robot leaves an object
            that moves by itself and may hit it; the headroom is minus the deficit.
    """

    a: str
    b: str
    primitive_a: str
    primitive_b: str
    distance: float
    primitive_distance: float
    exact_distance: float | None
    buffer: float
    headroom: float
    envelope: float
    time_left: float
    time_to_contact: float
    point_a: Floats
    point_b: Floats
    normal: Floats
    model_error: float
    contract: bool = False
    unproven: bool = False
    sensed: SensedCells | None = None

    @property
    def needed(self) -> float:
        """Required separation of the pair, the envelope included [m]."""
        return self.distance - self.headroom

    @property
    def kept(self) -> float:
        """Distance to keep now: `needed`, but at least the buffer [m]."""
        return max(self.needed, self.buffer)

    @property
    def opens(self) -> bool:
        """Whether the pair is nearer than its buffer and may be, because it opens."""
        return self.headroom >= 0.0 and self.distance < self.buffer

    @property
    def distance_sentence(self) -> str:
        """Bodies and distance of the pair in words, in millimetres."""
        if self.headroom < 0.0:
            # The distance to keep follows, and differs.
            return self._apart(self._digits)
        return self._apart(int(abs(self.distance) < 5e-4))

    @property
    def demand(self) -> str:
        """What the pair must keep, or its headroom, in words and millimetres."""
        if self.contract:
            return f"contact allowed, headroom {self.headroom * 1e3:z.1f} mm"
        if self.opens:
            return "too close, but opening"
        if self.headroom < 0.0:
            return f"must keep {self.kept * 1e3:.{self._digits}f} mm"
        return f"headroom {(self.distance - self.kept) * 1e3:z.0f} mm"

    @property
    def why(self) -> str:
        """The pair in one short line, in millimetres."""
        if self.unproven:
            return (
                f"{self.distance_sentence}: nothing is proven, {self.b} moves by itself"
            )
        return f"{self.distance_sentence}: {self.demand}"

    def explain(self) -> str:
        """The pair in full: its distances, what must be kept, and its model errors."""
        distance, kept = (round(v * 1e3, 1) for v in (self.distance, self.kept))
        room = distance - kept
        rest = f"headroom {room:z.1f} mm" if room >= 0.0 else f"{-room:.1f} mm short"
        lines = [f"{self._apart(1)}, must keep {kept:z.1f} mm: {rest}"]
        if self.opens:
            lines.append("nearer than the buffer, but the motion opens the pair")
        if self.contract:
            lines.append(
                f"under a contract: contact to {-kept:z.1f} mm deep is allowed"
            )
        if self.unproven:
            lines.append(f"nothing is proven: {self.a} leaves {self.b}, which moves")
        if self.exact_distance is not None:
            lines.append(
                f"hulls of the second stage {self.exact_distance * 1e3:z.1f} mm apart, "
                f"primitives {self.primitive_distance * 1e3:z.1f} mm"
            )
        if self.model_error >= WORTH_A_CLAUSE:
            beyond = self.model_error * 1e3
            lines.append(f"the model reaches up to {beyond:.1f} mm beyond the surfaces")
        return "\n  ".join(lines)

    @property
    def _digits(self) -> int:
        """Least count of digits of a millimetre in which distance and `kept` differ."""
        pair = (self.distance * 1e3, self.kept * 1e3)
        texts = ({f"{value:.{n}f}" for value in pair} for n in range(3))
        return next((n for n, both in enumerate(texts) if len(both) == 2), 3)

    def _apart(self, digits: int) -> str:
        """Bodies and distance in words, with some digits of a millimetre."""
        other = f"{self.b}{self._place}"
        if self.distance < 0.0:
            return f"{self.a} overlaps {other} by {-self.distance * 1e3:.{digits}f} mm"
        return f"{self.a} {self.distance * 1e3:.{digits}f} mm from {other}"

    @property
    def _place(self) -> str:
        """Age and place of cells in words; "" for a body of the scene."""
        if self.sensed is None:
            return ""
        at = ", ".join(f"{x:.2f}" for x in self.point_b)
        age = self.sensed.age
        if self.sensed.unseen or age is None or not isfinite(age):
            return f" at ({at})"
        by = f" by {self.sensed.sensor}" if self.sensed.sensor else ""
        return f"{by} {age * 1e3:.0f} ms ago at ({at})"

    @property
    def short_by(self) -> float:
        """Length by which the pair is too near for its `time_left` to suffice [m]."""
        if not 0.0 < self.time_left < SLOW_TIME_DEFAULT * HYSTERESIS:
            return -self.headroom
        limit = SLOW_TIME_DEFAULT
        if self.time_left >= limit:
            limit *= HYSTERESIS
        return self.headroom * (limit / self.time_left - 1.0)

    def to_dict(self) -> dict[str, object]:
        """The pair as plain numbers, lists and strings."""
        return {name: listed(getattr(self, name)) for name in IN_WORDS}
