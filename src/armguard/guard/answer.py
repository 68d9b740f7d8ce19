"""The answer of a cycle: access by name to the array that `layout` describes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.budget import Budget
from armguard.guard.levels import Level, Reason
from armguard.guard.watch import HYSTERESIS, SLOW_TIME_DEFAULT
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def record(*fields: str) -> np.dtype[np.void]:
    """Structured type of a row of named float64; `name:3` is a vector of three."""
    parts = [field.split(":") for field in fields]
    return np.dtype([(name, np.float64, *map(int, size)) for name, *size in parts])


ROBOT_ROW = record(
    *"level phase scale age cause urgency time force:3 torque:3 tool:3 delay".split()
)
# Index of each number in a robot's row.
ROBOT_PLACES = {
    name: offset // 8 for name, (_, offset, *_) in (ROBOT_ROW.fields or {}).items()
}


class NearNumbers(NamedTuple):
    """What the row of a near pair begins with; a tuple is read faster than a record."""

    first: float
    second: float
    clearance: float
    buffer: float
    outer: float
    exact: float
    time_left: float
    time_to_contact: float
    proof: float
    envelope: float
    distance: float


NEAR_ROW = record(*NearNumbers._fields, "point_a:3", "point_b:3", "normal:3")
POINTS = len(NearNumbers._fields)

# A model error that rounds to 0 mm is left out of a sentence [m].
WORTH_A_CLAUSE = 5e-4

# Fields of a pair in JSON, in that order.
IN_WORDS = (
    "a b primitive_a primitive_b distance primitive_distance exact_distance buffer "
    "clearance needed envelope time_left time_to_contact point_a point_b normal "
    "model_error contract unproven"
).split()


def listed(value: object) -> object:
    """An array as a list; any other value unchanged."""
    return value.tolist() if isinstance(value, np.ndarray) else value


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
        clearance: Distance minus required separation. Required is the buffer alone in
            mode "fixed", else the buffer plus the distance that the two sides can
            still close until both rest; negative: collision is imminent [m].
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
            `buffer` is minus the allowed depth, and `clearance` the rest of that depth.
        unproven: Whether nothing is proven for the pair: its robot leaves an object
            that moves by itself and may hit it; `clearance` is minus the deficit.
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
        """Required separation of the pair, the envelope included [m]."""
        return self.distance - self.clearance

    @property
    def distance_sentence(self) -> str:
        """Bodies and distance of the pair in words, in millimetres."""
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
        """Length by which the pair is too near for its `time_left` to suffice [m]."""
        if not 0.0 < self.time_left < SLOW_TIME_DEFAULT * HYSTERESIS:
            return -self.clearance
        limit = SLOW_TIME_DEFAULT
        if self.time_left >= limit:
            limit *= HYSTERESIS
        return self.clearance * (limit / self.time_left - 1.0)

    def to_dict(self) -> dict[str, object]:
        """The pair as plain numbers, lists and strings."""
        return {name: listed(getattr(self, name)) for name in IN_WORDS}


@dataclass(frozen=True, slots=True)
class Names:
    """Names that a verdict needs when read; shared by all verdicts of a guard.

    Attributes:
        tables: The scene.
        robots: Names of the robots; empty where no stops are predicted.
        first_row: Index at which the rows of near pairs start.
        disproved: 1 where a joint has exceeded a declared figure, shape (n,).
    """

    tables: SceneTables
    robots: Sequence[str]
    first_row: int
    disproved: NDArray[np.int64]


def first_row_of(tables: SceneTables) -> int:
    """Index at which the rows of near pairs start in the verdicts of a scene."""
    if all(part.mode == "fixed" for part in tables.robots):
        return layout.HEADER
    return layout.HEADER + len(tables.robots) * layout.ROBOT_WIDTH + len(tables.q_names)


def names_of(tables: SceneTables, disproved: NDArray[np.int64] | None = None) -> Names:
    """Names for the verdicts of a scene.

    Args:
        tables: The scene; kept, so it must not change.
        disproved: 1 where a joint has exceeded a declared figure in the life of the
            guard, shape (n,); zeros if it is left out.
    """
    guarded = any(part.mode != "fixed" for part in tables.robots)
    robots = tuple(part.name for part in tables.robots) if guarded else ()
    if disproved is None:
        disproved = np.zeros(len(tables.q_names), dtype=np.int64)
    return Names(tables, robots, first_row_of(tables), disproved)


@dataclass(frozen=True, slots=True)
class Counts:
    """Work of one cycle, as counts.

    Attributes:
        pairs_tested: Pairs of primitives measured.
        pairs_refined: Pairs of links whose exact shapes were measured because their
            primitives would not keep their buffer.
        pairs_kept: Near pairs whose two sides did not move and whose row was kept.
        pairs_filtered: Pairs sharing a leaf whose bounding boxes are farther apart
            than the margin.
        pairs_apart: Pairs that a stored separating plane of an earlier cycle still
            proves to be beyond the margin.
        pairs_skipped: Checked pairs that were not measured in this cycle.
        spans_tested: Spans of the stop path tested for pairs that needed it.
        bodies_moved: Bodies whose pose changed.
        links_checked: Moved bodies whose leaves were updated.
        links_changed_leaf: Bodies among these that entered or left a leaf.
        leaves_entered: Leaves entered by primitives.
        leaves_left: Leaves left by primitives.
        splits: Leaves split.
        merges: Nodes merged.
    """

    pairs_tested: int
    pairs_refined: int
    pairs_kept: int
    pairs_filtered: int
    pairs_apart: int
    pairs_skipped: int
    spans_tested: int
    bodies_moved: int
    links_checked: int
    links_changed_leaf: int
    leaves_entered: int
    leaves_left: int
    splits: int
    merges: int


# Counts of a cycle, in the order of the header.
COUNTED = (
    "pairs_tested pairs_kept pairs_filtered bodies_moved links_checked "
    "links_changed_leaf leaves_entered leaves_left splits merges pairs_refined "
    "pairs_apart"
).split()

# Fields of `NearPair` that have the same name in the row of the answer.


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer array, read by name.

    Attributes:
        data: The array that `layout` describes.
        names: Names of its scene.
    """

    data: Floats
    names: Names

    @property
    def robots(self) -> NDArray[np.void]:
        """Rows of all robots; none where every mode is "fixed"."""
        end = layout.HEADER + len(self.names.robots) * layout.ROBOT_WIDTH
        return self.data[layout.HEADER : end].view(ROBOT_ROW)

    @property
    def near(self) -> NDArray[np.void]:
        """Rows of all near pairs."""
        first, width = self.names.first_row, self.near_count * layout.NEAR_WIDTH
        return self.data[first : first + width].view(NEAR_ROW)

    @property
    def near_count(self) -> int:
        """How many near pairs there are."""
        return int(self.data[layout.NEAR_COUNT])

    @property
    def nearest(self) -> int:
        """Index of the near pair with the least clearance, -1 for none."""
        return int(self.data[layout.NEAREST])

    @property
    def budget(self) -> Budget | None:
        """Required separation of the nearest pair by cause; None if none is near."""
        if not self.names.robots or self.nearest < 0:
            return None
        terms = self.data[layout.TERMS : layout.TERMS + layout.TERM_COUNT]
        # A configuration that was judged at rest has none.
        return Budget(*terms.tolist()) if terms.any() else None

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Robots in mode "fixed", whose motion no proof bounds; `Verdict.unbounded`."""
        if not self.names.robots:
            return ()
        parts = self.names.tables.robots
        return tuple(part.name for part in parts if part.mode == "fixed")

    @property
    def counts(self) -> Counts:
        """Work of the cycle."""
        d = self.data[layout.PAIRS_TESTED : layout.PAIRS_APART + 1].astype(int).tolist()
        return Counts(
            **dict(zip(COUNTED, d, strict=True)),
            pairs_skipped=self.names.tables.checkable_pairs - d[0],
            spans_tested=int(self.data[layout.SPANS_TESTED]),
        )

    def pair(self, k: int) -> NearPair:
        """The k-th near pair."""
        tables, at = self.names.tables, self.names.first_row + k * layout.NEAR_WIDTH
        row = self.data[at : at + layout.NEAR_WIDTH]
        n = NearNumbers(*row[:POINTS].tolist())
        i, j = int(n.first), int(n.second)
        refined = n.exact != np.inf and not n.exact <= n.outer
        errors = tables.exact.errors if refined else tables.model_errors
        return NearPair(
            a=tables.body_names[i],
            b=tables.body_names[j],
            primitive_a=tables.labels[i],
            primitive_b=tables.labels[j],
            distance=n.distance,
            primitive_distance=n.outer,
            exact_distance=None if n.exact == np.inf else n.exact,
            buffer=n.buffer,
            clearance=n.clearance,
            envelope=n.envelope,
            time_left=n.time_left,
            time_to_contact=n.time_to_contact,
            point_a=row[POINTS : POINTS + 3].copy(),
            point_b=row[POINTS + 3 : POINTS + 6].copy(),
            normal=row[POINTS + 6 :].copy(),
            model_error=float(errors[i] + errors[j]),
            contract=n.proof == ALLOWED,
            unproven=n.proof == UNPROVEN,
        )

    def primitives(self, k: int) -> tuple[int, int]:
        """Indices of the two primitives of the k-th near pair."""
        row = self.near[k]
        return int(row["first"]), int(row["second"])

    def robots_of(self, k: int) -> tuple[int, int]:
        """Indices of the robots of the k-th near pair, -1 for none."""
        known = self.names.tables.robot_of_primitive
        i, j = self.primitives(k)
        return int(known[i]), int(known[j]) if j < len(known) else -1


def stop_answer(names: Names, reason: Reason) -> Floats:
    """The answer of a cycle that was not judged: all robots stop, no near pairs."""
    data = np.zeros(names.first_row)
    data[layout.REASON] = reason
    data[[layout.JOINT, layout.NEAREST, layout.ROBOT]] = -1.0
    robots = Answer(data, names).robots
    robots["level"], robots["cause"] = Level.STOP, reason
    robots["age"] = robots["time"] = np.inf
    return data
