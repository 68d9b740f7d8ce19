"""A pair of primitives that are near each other, as a verdict tells it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.guard.watch import HYSTERESIS, SLOW_TIME_DEFAULT

Floats = NDArray[np.float64]

# A model error that rounds to no millimetre is not worth a clause [m].
WORTH_A_CLAUSE = 5e-4

# What JSON holds of a pair, in that order.
IN_WORDS = (
    "a b primitive_a primitive_b distance primitive_distance exact_distance buffer "
    "clearance needed envelope time_left time_to_contact point_a point_b normal "
    "model_error contract unproven"
).split()


@dataclass(frozen=True, slots=True)
class NearPair:
    """Two primitives within the reporting margin.

    `point_b - point_a = distance · normal`.

    Attributes:
        a: Body of A: 'robot/link' or an object's name.
        b: Body of B.
        primitive_a: Primitive of A; a body may have several.
        primitive_b: Primitive of B.
        distance: Signed distance the verdict rests on: that of the primitives, or of
            the exact shapes where those are farther apart [m].
        primitive_distance: Signed distance of the primitives [m].
        exact_distance: Signed distance of the exact shapes of the two links or
            objects; None where the primitives keep their buffer and nobody asked [m].
        buffer: Distance the pair must keep [m].
        clearance: What is left of the distance beyond all that the pair needs: beyond
            the buffer where that is a number, else beyond the buffer and whatever the
            two sides can still move towards each other until they rest; negative
            means imminent collision [m].
        envelope: By how much the shapes that were judged are nearer than those whose
            distance is reported; part of what the pair needs [m].
        time_left: How long the present motion may go on before a stop must be ordered
            [s]; infinite where nothing moves.
        time_to_contact: The two cannot touch before that, whatever the operators do
            [s]; infinite where nothing moves. What levers say, which is shorter than
            need be, of pairs that are not the first their robots can touch.
        point_a: Witness point on A, world frame, shape (3,) [m].
        point_b: Witness point on B, world frame, shape (3,) [m].
        normal: Unit vector from A to B, world frame, shape (3,).
        model_error: How far what was measured may reach beyond the real surfaces, both
            sides together: the primitives, or the exact shapes where `distance` is
            theirs; a convex hull reaches into the dents of its mesh [m].
        contract: Whether the pair is this near under a contract that it keeps; then
            `buffer` is minus the depth it may overlap by, and `clearance` what is left
            of that.
        unproven: Whether nothing is proven for the pair: its robot leaves an object
            that moves by itself, and that may meet it; `clearance` is what lacks.
    """

    a: str
    b: str
    primitive_a: str
    primitive_b: str
    distance: float
    primitive_distance: float
    exact_distance: float | None
    buffer: float
    clearance: float
    envelope: float
    time_left: float
    time_to_contact: float
    point_a: Floats
    point_b: Floats
    normal: Floats
    model_error: float
    contract: bool = False
    unproven: bool = False

    @property
    def needed(self) -> float:
        """What the pair needs of its distance, the envelope included [m]."""
        return self.distance - self.clearance

    @property
    def distance_sentence(self) -> str:
        """Who is how far from whom."""
        return f"{self.a} to {self.b}: {self.distance * 1e3:.0f} mm"

    @property
    def why(self) -> str:
        """The pair in words and millimetres."""
        if self.contract:
            return (
                f"{self.distance_sentence}, under a contract: may come to "
                f"{self.buffer * 1e3:.1f} mm, {self.clearance * 1e3:.1f} mm are left"
            )
        if self.unproven:
            return (
                f"{self.distance_sentence}, nothing is proven: {self.a} leaves "
                f"{self.b}, which moves by itself"
            )
        if self.needed < 0.0:
            demand = f"may touch already: {self.a} leaves"
        elif self.clearance != self.distance - self.buffer:
            demand = f"needs {self.needed * 1e3:.0f} mm to stop in time"
        else:
            verb = "needs" if self.clearance < 0.0 else "keeps"
            demand = f"{verb} {self.buffer * 1e3:.0f} mm buffer"
        notes = []
        if self.exact_distance is not None:
            notes.append(
                f"exact shapes {self.exact_distance * 1e3:.0f} mm, primitives "
                f"{self.primitive_distance * 1e3:.0f} mm"
            )
        if self.model_error >= WORTH_A_CLAUSE:
            notes.append(f"the model may reach {self.model_error * 1e3:.0f} mm too far")
        return f"{self.a} to {self.b}: {self.distance * 1e3:.0f} mm, {demand}" + (
            f" ({'; '.join(notes)})" if notes else ""
        )

    @property
    def short_by(self) -> float:
        """Length it lacks for its time not to be short [m]."""
        if not 0.0 < self.time_left < SLOW_TIME_DEFAULT * HYSTERESIS:
            return -self.clearance
        limit = SLOW_TIME_DEFAULT
        if self.time_left >= limit:
            limit *= HYSTERESIS
        return self.clearance * (limit / self.time_left - 1.0)

    def to_dict(self) -> dict[str, object]:
        """The pair as plain numbers, lists and strings."""
        values = {name: getattr(self, name) for name in IN_WORDS}
        return {
            k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()
        }
