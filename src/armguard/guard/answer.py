"""The answer of a cycle: access by name to the array that `layout` describes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.budget import Budget
from armguard.guard.layout import IN_HEADER, Header, NearRow, RobotRow
from armguard.guard.levels import Level, Reason
from armguard.guard.near_pair import NearPair, SensedCells
from armguard.guard.slots import with_slots
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.record import dtype_of
from armguard.scene.sensing import UNSEEN
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


# Near pairs that an answer has room for. More at once are a reason to stop
# (`Reason.CAPACITY`).
NEAR_CAPACITY = 4096

ROBOT_ROW, NEAR_ROW = dtype_of(RobotRow), dtype_of(NearRow)


class NearNumbers(NamedTuple):
    """What the row of a near pair begins with; a tuple is read faster than a record."""

    first: float
    second: float
    headroom: float
    buffer: float
    outer: float
    exact: float
    time_left: float
    time_to_contact: float
    proof: float
    envelope: float
    distance: float


POINTS = len(NearNumbers._fields)


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


class SlotsSeen(NamedTuple):
    """Sensors that saw the cells in the slots of a guard, and when.

    Attributes:
        ages: Ages of the claims about them, shape (slots,) [s].
        sources: Numbers of the sensors, see `Claims`, shape (slots,).
    """

    ages: Floats
    sources: NDArray[np.uint8]


def first_row_of(tables: SceneTables) -> int:
    """Index at which the rows of near pairs start in the verdicts of a scene."""
    if all(part.mode == "fixed" for part in tables.robots):
        return layout.HEADER
    return layout.HEADER + len(tables.robots) * layout.ROBOT_WIDTH + len(tables.q_names)


def answer_of(tables: SceneTables) -> dict[str, Any]:
    """An answer with room for its near pairs, and its parts in the same memory.

    Returns:
        The array `out` and its parts, by field of a `Workspace`.
    """
    first_row, header = first_row_of(tables), layout.HEADER
    count = max(1, min(tables.checkable_pairs, NEAR_CAPACITY))
    out = np.zeros(first_row + count * layout.NEAR_WIDTH)
    robots = len(tables.robots) if first_row > header else 0
    escape = header + robots * layout.ROBOT_WIDTH
    return {
        "out": out,
        "header": out[:header].view(dtype_of(Header)).view(np.recarray).reshape(()),
        "robots": out[header:escape].view(ROBOT_ROW).view(np.recarray),
        "escape": out[escape:first_row],
        "near": out[first_row:].view(NEAR_ROW).view(np.recarray),
    }


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
    return Names(with_slots(tables), robots, first_row_of(tables), disproved)


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


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer array, read by name.

    Attributes:
        data: The array that `layout` describes.
        names: Names of its scene.
        seen: Sensors of the cells in the slots, and ages; None if they are unknown.
    """

    data: Floats
    names: Names
    seen: SlotsSeen | None = None

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
        return int(self.data[IN_HEADER.near_count])

    @property
    def nearest(self) -> int:
        """Index of the near pair with the least headroom, -1 for none."""
        return int(self.data[IN_HEADER.nearest])

    def deciding(self, reason: Reason) -> int:
        """Index of the near pair that a reason is about, -1 for none.

        The nearest, but the one with the least time left where time is short.
        """
        if reason is Reason.SHORT_TIME and self.near_count:
            return int(self.near["time_left"].argmin())
        return self.nearest

    @property
    def budget(self) -> Budget | None:
        """Required separation of the nearest pair by cause; None if none is near."""
        if not self.names.robots or self.nearest < 0:
            return None
        terms = self.data[IN_HEADER.terms : layout.HEADER]
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
        d = (
            self.data[IN_HEADER.pairs_tested : IN_HEADER.pairs_apart + 1]
            .astype(int)
            .tolist()
        )
        return Counts(
            **dict(zip(COUNTED, d, strict=True)),
            pairs_skipped=self.names.tables.checkable_pairs - d[0],
            spans_tested=int(self.data[IN_HEADER.spans_tested]),
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
            headroom=n.headroom,
            envelope=n.envelope,
            time_left=n.time_left,
            time_to_contact=n.time_to_contact,
            point_a=row[POINTS : POINTS + 3].copy(),
            point_b=row[POINTS + 3 : POINTS + 6].copy(),
            normal=row[POINTS + 6 :].copy(),
            model_error=float(errors[i] + errors[j]),
            sensed=self._cells(j),
            contract=n.proof == ALLOWED,
            unproven=n.proof == UNPROVEN,
        )

    def _cells(self, j: int) -> SensedCells | None:
        """The cells of primitive j if it is a slot; None if it is of the scene."""
        tables = self.names.tables
        if j < tables.modelled:
            return None
        unseen, slot = tables.body_names[j] == UNSEEN, j - tables.modelled
        if self.seen is None:
            return SensedCells(unseen, None, None)
        names = dict(enumerate(tables.sensors, start=1))
        sensor = names.get(int(self.seen.sources[slot]))
        return SensedCells(unseen, float(self.seen.ages[slot]), sensor)

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
    data[IN_HEADER.reason] = reason
    data[[IN_HEADER.joint, IN_HEADER.nearest, IN_HEADER.robot]] = -1.0
    robots = Answer(data, names).robots
    robots["level"], robots["cause"] = Level.STOP, reason
    robots["age"] = robots["time"] = np.inf
    return data
