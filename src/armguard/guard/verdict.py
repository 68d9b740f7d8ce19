"""What a cycle says: a snapshot that costs nothing until it is read."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.budget import Budget
from armguard.guard.cue import Cue
from armguard.guard.levels import (
    OF_OBJECTS,
    ORDERED,
    SENTENCES,
    Level,
    Reason,
    level_of,
)
from armguard.guard.nuisance import Delayed, Lack, Nuisance, classify
from armguard.guard.pace import late_sentence
from armguard.guard.protective import ProtectiveDistance, protective_distance
from armguard.guard.watch import HYSTERESIS, RESTING, SLOW_TIME_DEFAULT
from armguard.motion.pair_state import ALLOWED, UNPROVEN
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Reasons that the nearest pair explains.
ABOUT_PAIRS = (
    Reason.NEAR,
    Reason.SHORT_TIME,
    Reason.TOO_CLOSE,
    Reason.NO_PROOF,
    Reason.BUDGET_SPENT,
    Reason.CONTRACT_EXCEEDED,
    Reason.STOPPING,
    Reason.RESTING,
    Reason.UNPROVEN,
)

# Reasons whose number is a time.
IN_MILLISECONDS = (
    Reason.STAMP_AHEAD,
    Reason.STATE_STALE,
    Reason.CYCLE_LATE,
)

# Reasons that a joint explains which has not stopped as declared.
LAGS = (Reason.STOP_LAGS, Reason.BRAKE_LAGS)

# Reasons that are about how fast a joint is.
AT_SPEED = (
    Reason.STATE_JUMPED,
    Reason.TOO_FAST,
    Reason.NOT_FOLLOWED,
    Reason.STATE_DISAGREES,
)

# Reasons that are about the whole cycle, not about one robot.
OF_ALL = (Reason.WRONG_INPUT, Reason.CYCLE_LATE, Reason.TIME_STILL, *ORDERED)

# A model error that rounds to no millimetre is not worth a clause [m].
TOLD = 5e-4


@dataclass(frozen=True, slots=True)
class Names:
    """Names a verdict needs when it is read; shared by all verdicts of a guard.

    Attributes:
        joints: 'robot/joint' of each place of q.
        lower: Least joint positions [rad or m].
        upper: Greatest joint positions [rad or m].
        bodies: Body of each primitive.
        labels: Name of each primitive.
        model_errors: Model error of each primitive [m].
        exact_errors: Model error of the exact shapes of each primitive's link [m].
        checkable_pairs: Pairs of primitives that are checked at all.
        robots: Robots of the scene, if stops are predicted.
        first_row: Where the rows of near pairs start.
        disproved: 1 where a joint has broken a declared figure, shape (n,).
        tables: The scene, for those who ask what a stop was for.
    """

    joints: Sequence[str]
    lower: Floats
    upper: Floats
    bodies: Sequence[str]
    labels: Sequence[str]
    model_errors: Floats
    exact_errors: Floats
    checkable_pairs: int
    robots: Sequence[str]
    first_row: int
    disproved: NDArray[np.int64]
    tables: SceneTables | None = None


def first_row_of(tables: SceneTables) -> int:
    """Where the rows of near pairs start in the verdicts of a scene."""
    if all(part.mode == "fixed" for part in tables.robots):
        return layout.HEADER
    return layout.HEADER + len(tables.robots) * layout.ROBOT_WIDTH + len(tables.q_names)


def names_of(tables: SceneTables, disproved: NDArray[np.int64] | None = None) -> Names:
    """Names for the verdicts of a scene.

    Args:
        tables: The scene; kept, so it must not change.
        disproved: 1 where a joint has broken a declared figure, as long as the guard
            lives, shape (n,); of none if it is left out.
    """
    guarded = any(part.mode != "fixed" for part in tables.robots)
    robots = tuple(part.name for part in tables.robots) if guarded else ()
    if disproved is None:
        disproved = np.zeros(len(tables.q_names), dtype=np.int64)
    return Names(
        joints=tables.q_names,
        lower=tables.lower,
        upper=tables.upper,
        bodies=tables.body_names,
        labels=tables.labels,
        model_errors=tables.model_errors,
        exact_errors=tables.exact.errors,
        checkable_pairs=tables.checkable_pairs,
        robots=robots,
        first_row=first_row_of(tables),
        disproved=disproved,
        tables=tables,
    )


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
        if self.model_error >= TOLD:
            notes.append(f"the model may reach {self.model_error * 1e3:.0f} mm too far")
        return f"{self.a} to {self.b}: {self.distance * 1e3:.0f} mm, {demand}" + (
            f" ({'; '.join(notes)})" if notes else ""
        )


@dataclass(frozen=True, slots=True)
class Slack:
    """What is left until a stop must be ordered.

    Attributes:
        m: Length the nearest pair has beyond what it needs [m]; infinite if none is
            near.
        s: Time the present motion of all robots may go on [s]; infinite if nothing
            that moves is near.
    """

    m: float
    s: float


@dataclass(frozen=True, slots=True)
class Counts:
    """What a cycle had to do.

    Attributes:
        pairs_tested: Pairs of primitives measured.
        pairs_refined: Pairs of links whose exact shapes were measured because their
            primitives would not keep their buffer.
        pairs_kept: Near pairs whose two sides stood still and whose row was kept.
        pairs_filtered: Pairs sharing a leaf whose bounding boxes are farther apart
            than the margin.
        pairs_apart: Pairs that a plane remembered from an earlier cycle still proves
            to be beyond the margin.
        pairs_skipped: Checked pairs that were not measured in this cycle.
        spans_tested: Spans of the stop path tested for pairs that needed it.
        bodies_moved: Bodies whose pose changed.
        links_checked: Moved bodies whose leaves had to be looked after.
        links_changed_leaf: Of these, the ones that entered or left a leaf.
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


class Verdict:
    """Answer of one cycle; immutable, safe to keep.

    Holds the numbers of the cycle; names, points and sentences are made when asked
    for.

    Attributes:
        stamp: The stamp the cycle was given [s], or None.
        cycle_time: Duration of the cycle [s]; the only thing in a verdict that is
            not a function of the inputs.
    """

    __slots__ = ("_data", "_fault", "_names", "cycle_time", "stamp")

    def __init__(
        self,
        data: Floats,
        names: Names,
        stamp: float | None,
        cycle_time: float,
        fault: str = "",
    ) -> None:
        self._data = data
        self._names = names
        self._fault = fault
        self.stamp = stamp
        self.cycle_time = cycle_time

    @property
    def numbers(self) -> Floats:
        """All numbers of the verdict as `armguard.guard.layout` places them.

        With the names of the scene, `names_of`, they make the same verdict again.
        """
        return self._data

    @property
    def fault(self) -> str:
        """What was wrong with the input, in words; empty if nothing was."""
        return self._fault

    @property
    def reason(self) -> Reason:
        """Why the level is what it is."""
        return Reason(int(self._data[layout.REASON]))

    @property
    def level(self) -> Level:
        """What the arms should do: the highest of `levels`."""
        return max((level_of(self.reason), *self.levels.values()))

    @property
    def levels(self) -> dict[str, Level]:
        """What each robot should do; empty where every mode is "fixed"."""
        return {
            name: Level(int(self._robot(r, layout.ROBOT_LEVEL)))
            for r, name in enumerate(self._names.robots)
        }

    @property
    def speed_scale(self) -> dict[str, float]:
        """Share of the operator's speed each robot may have, in [0, 1].

        Falls with the time that is left until its stop must be ordered.
        """
        return {
            name: self._robot(r, layout.ROBOT_SCALE)
            for r, name in enumerate(self._names.robots)
        }

    @property
    def ages(self) -> dict[str, float]:
        """How old each robot's measurement may have been in this cycle [s]."""
        return {
            name: self._robot(r, layout.ROBOT_AGE)
            for r, name in enumerate(self._names.robots)
        }

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Robots whose motion no proof bounds: their mode is "fixed", others' is not.

        In the proof of a neighbour such a robot counts as still.
        """
        tables = self._names.tables
        if tables is None or not self._names.robots:
            return ()
        return tuple(part.name for part in tables.robots if part.mode == "fixed")

    @property
    def drive_delays(self) -> dict[str, float]:
        """How late each robot's drives follow commands at least, since a reset [s].

        From commands that went through `Guard.filter` and velocities that were
        measured, while nothing stops; in quarters of the declared delay of commands, up
        to twice of it. 0 where nothing was seen that a drive without a delay would not
        do.
        """
        return {
            name: self._robot(r, layout.ROBOT_DELAY)
            for r, name in enumerate(self._names.robots)
        }

    @property
    def causes(self) -> dict[str, Reason]:
        """Why each robot that is stopping, braking or at rest was ordered to."""
        return {
            name: reason
            for r, (name, reason) in enumerate(self.last_causes.items())
            if self._robot(r, layout.ROBOT_LEVEL) >= Level.STOP
        }

    @property
    def last_causes(self) -> dict[str, Reason]:
        """Why each robot was ordered to stop last; `OK` if it never was."""
        return {
            name: Reason(int(self._robot(r, layout.ROBOT_CAUSE)))
            for r, name in enumerate(self._names.robots)
        }

    @property
    def slack(self) -> Slack:
        """How much is left until a stop must be ordered, in length and in time."""
        nearest = self.nearest
        return Slack(
            inf if nearest is None else nearest.clearance,
            float(self._data[layout.SLACK_TIME]) if self._names.robots else inf,
        )

    @property
    def budget(self) -> Budget | None:
        """What the nearest pair needs, split by cause; None if no pair is near."""
        if not self._names.robots or self.nearest is None:
            return None
        terms = self._data[layout.TERMS : layout.TERMS + layout.TERM_COUNT]
        return Budget(*(float(term) for term in terms))

    @property
    def nuisance(self) -> Nuisance | None:
        """What made this slow or stop, and what would have let it pass; see there."""
        return classify(self.level, self.reason, self._lack())

    @property
    def protective_distance(self) -> ProtectiveDistance | None:
        """What the nearest pair needs in the letters of the standards.

        None if its second side is no person, or no pair is near.
        """
        tables, nearest = self._names.tables, self.nearest
        if tables is None or nearest is None or nearest.b not in tables.people:
            return None
        return self.protective_distance_of(nearest)

    def protective_distance_of(self, pair: NearPair) -> ProtectiveDistance | None:
        """The same of the nearest pair, whatever its second side is.

        Args:
            pair: `nearest`; of other near pairs the terms are not known.

        Returns:
            None for another pair, for two links of one robot, and where every mode is
            "fixed".
        """
        k, budget = int(self._data[layout.NEAREST]), self.budget
        if k < 0 or budget is None or self._names.tables is None:
            return None
        nearest = self._pair(k)
        asked = (pair.primitive_a, pair.primitive_b)
        if asked != (nearest.primitive_a, nearest.primitive_b):
            return None
        a, b = self._robots_of(k)
        if a == b:
            return None
        robots = self._names.robots
        return protective_distance(robots[a], nearest.b if b < 0 else robots[b], budget)

    @property
    def cues(self) -> dict[str, Cue]:
        """What to tell each robot's operator: eye, ear and hand."""
        tables, robots = self._names.tables, self._names.robots
        if tables is None or not robots:
            return {}
        escape = self._names.first_row - len(tables.q_names)
        found = {}
        for r, part in enumerate(tables.robots):
            at = layout.HEADER + r * layout.ROBOT_WIDTH
            row = self._data[at : at + layout.ROBOT_WIDTH]
            first = escape + part.first_joint
            found[part.name] = Cue(
                urgency=float(row[layout.ROBOT_URGENCY]),
                time_to_contact=float(row[layout.ROBOT_TIME]),
                escape=self._data[first : first + part.joint_count].copy(),
                tool_escape=row[layout.ROBOT_TOOL :][:3].copy(),
                force=row[layout.ROBOT_FORCE :][:3].copy(),
                torque=row[layout.ROBOT_TORQUE :][:3].copy(),
            )
        return found

    @property
    def disproved(self) -> tuple[str, ...]:
        """Joints that have not stopped as declared, so that no proof is worth much."""
        return tuple(
            name
            for name, broken in zip(
                self._names.joints, self._names.disproved, strict=True
            )
            if broken
        )

    @property
    def near(self) -> tuple[NearPair, ...]:
        """Every checked pair within the margin, ordered by primitive."""
        count = int(self._data[layout.NEAR_COUNT])
        return tuple(self._pair(k) for k in range(count))

    @property
    def nearest(self) -> NearPair | None:
        """The near pair with the least clearance, None if no pair is near."""
        k = int(self._data[layout.NEAREST])
        return None if k < 0 else self._pair(k)

    @property
    def unproven(self) -> tuple[NearPair, ...]:
        """Near pairs for which nothing is proven in this cycle."""
        return tuple(pair for pair in self.near if pair.unproven)

    @property
    def joint(self) -> str | None:
        """The joint a fault is about, None if it is about none."""
        k = int(self._data[layout.JOINT])
        return None if k < 0 else self._names.joints[k]

    @property
    def subject(self) -> str:
        """Who a fault is about: a joint, an object or a robot; "" if all, or nobody."""
        reason = self.reason
        if self.joint is not None:
            return self.joint
        if reason in LAGS and self.disproved:
            return self.disproved[0]
        if reason in OF_OBJECTS:
            return self._names.bodies[int(self._data[layout.VALUE])]
        r = int(self._data[layout.ROBOT])
        known = 0 <= r < len(self._names.robots)
        return self._names.robots[r] if known and reason not in OF_ALL else ""

    @property
    def counts(self) -> Counts:
        """What the cycle had to do."""
        d = [int(v) for v in self._data[layout.PAIRS_TESTED : layout.PAIRS_APART + 1]]
        tested, kept, filtered, moved, links, changed, entered, left = d[:8]
        return Counts(
            pairs_tested=tested,
            pairs_refined=d[10],
            pairs_kept=kept,
            pairs_filtered=filtered,
            pairs_apart=d[11],
            pairs_skipped=self._names.checkable_pairs - tested,
            spans_tested=int(self._data[layout.SPANS_TESTED]),
            bodies_moved=moved,
            links_checked=links,
            links_changed_leaf=changed,
            leaves_entered=entered,
            leaves_left=left,
            splits=d[8],
            merges=d[9],
        )

    @property
    def why(self) -> str:
        """The verdict in one sentence, with names and numbers."""
        reason = self.reason
        nearest = self.nearest
        if self._fault:
            return self._fault
        if reason in ABOUT_PAIRS and nearest is not None:
            return self._pair_sentence(reason, nearest)
        if self._data[layout.JOINT] >= 0.0:
            return self._joint_sentence(reason)
        return self._input_sentence(reason)

    def to_dict(self) -> dict[str, object]:
        """The verdict as plain numbers, lists and strings, ready for JSON.

        What is infinite or NaN is None there.
        """
        counts, nuisance, kept = self.counts, self.nuisance, self.protective_distance
        answer = {
            "stamp": self.stamp,
            "level": self.level.name,
            "reason": self.reason.name,
            "why": self.why,
            "joint": self.joint,
            "levels": {name: level.name for name, level in self.levels.items()},
            "speed_scale": self.speed_scale,
            "slack": {"m": self.slack.m, "s": self.slack.s},
            "budget": None if self.budget is None else asdict(self.budget),
            "ages": self.ages,
            "drive_delays": self.drive_delays,
            "unbounded": list(self.unbounded),
            "causes": {name: cause.name for name, cause in self.causes.items()},
            "disproved": list(self.disproved),
            "cues": {name: cue.to_dict() for name, cue in self.cues.items()},
            "nuisance": nuisance
            and {**asdict(nuisance), "cause": nuisance.cause.value},
            "protective_distance": kept and {**asdict(kept), "total": kept.total},
            "near": [pair_dict(pair) for pair in self.near],
            "nearest": None if self.nearest is None else pair_dict(self.nearest),
            "counts": {name: getattr(counts, name) for name in Counts.__slots__},
            "cycle_time": self.cycle_time,
        }
        return {key: finite(value) for key, value in answer.items()}

    def tobytes(self) -> bytes:
        """Level, reason and near pairs as bytes: equal inputs give equal bytes.

        What the cycle had to do is left out: it depends on where the arms came from.
        """
        state = self._data.copy()
        state[layout.PAIRS_TESTED : layout.PAIRS_APART + 1] = 0.0
        return state.tobytes()

    def __repr__(self) -> str:
        """Level, reason and the sentence."""
        return f"<Verdict {self.level.name} {self.reason.name}: {self.why}>"

    def _pair(self, k: int) -> NearPair:
        at = self._names.first_row + k * layout.NEAR_WIDTH
        row = self._data[at : at + layout.NEAR_WIDTH]
        i, j = int(row[layout.FIRST]), int(row[layout.SECOND])
        names = self._names
        witness = row[layout.WITNESS :]
        exact = float(row[layout.EXACT])
        refined = exact != np.inf and not exact <= row[layout.OUTER]
        errors = names.exact_errors if refined else names.model_errors
        return NearPair(
            a=names.bodies[i],
            b=names.bodies[j],
            primitive_a=names.labels[i],
            primitive_b=names.labels[j],
            distance=float(witness[0]),
            primitive_distance=float(row[layout.OUTER]),
            exact_distance=None if exact == np.inf else exact,
            buffer=float(row[layout.BUFFER]),
            clearance=float(row[layout.CLEARANCE]),
            envelope=float(row[layout.ENVELOPE]),
            time_left=float(row[layout.TIME_LEFT]),
            time_to_contact=float(row[layout.TIME_TO_CONTACT]),
            point_a=witness[1:4].copy(),
            point_b=witness[4:7].copy(),
            normal=witness[7:10].copy(),
            model_error=float(errors[i] + errors[j]),
            contract=int(row[layout.PROOF]) == ALLOWED,
            unproven=int(row[layout.PROOF]) == UNPROVEN,
        )

    def _robots_of(self, k: int) -> tuple[int, int]:
        """Robots of both sides of a near pair, -1 for none."""
        if self._names.tables is None:
            return -1, -1
        known = self._names.tables.robot_of_primitive
        i, j = self._primitives(k)
        return int(known[i]), int(known[j]) if j < len(known) else -1

    def _unbounded_sides(self) -> list[str]:
        """Robots of the nearest pair whose motion no proof bounds."""
        unbounded, k = self.unbounded, int(self._data[layout.NEAREST])
        names = self._names.robots
        sides = {names[r] for r in self._robots_of(k) if r >= 0} if unbounded else set()
        return [name for name in unbounded if name in sides]

    def _primitives(self, k: int) -> tuple[int, int]:
        """Primitives of both sides of a near pair."""
        at = self._names.first_row + k * layout.NEAR_WIDTH
        return int(self._data[at + layout.FIRST]), int(self._data[at + layout.SECOND])

    def _lack(self) -> Lack | None:
        """What the pair that decides lacks; None if no near pair lacks anything."""
        k = int(self._data[layout.NEAREST])
        if self.reason is Reason.SHORT_TIME:
            left = [pair.time_left for pair in self.near]
            k = int(np.argmin(left)) if left else -1
        if k < 0:
            return None
        pair = self._pair(k)
        deficit = -pair.clearance
        if self.reason is Reason.SHORT_TIME:
            deficit = short_by(pair)
        if not deficit > 0.0:
            return None
        return Lack(deficit, self._envelope(k, pair), self._delays(k))

    def _envelope(self, k: int, pair: NearPair) -> float:
        """How much farther apart a pair's surfaces may be than was judged [m]."""
        tables = self._names.tables
        if tables is None or not self._names.robots:
            return pair.model_error
        modes = [tables.robots[r].mode for r in self._robots_of(k) if r >= 0]
        proven = self.reason is not Reason.SHORT_TIME and "speed" not in modes
        if not proven or not pair.primitive_distance > 0.0:
            # Primitives were judged, whatever is known of the exact shapes.
            return pair.distance + pair.model_error - pair.primitive_distance
        # The proof asks the exact shapes too, where a link has some.
        names, has_exact = self._names, tables.exact.of_primitive[:, 1] > 0
        return sum(
            float((names.exact_errors if has_exact[i] else names.model_errors)[i])
            for i in self._primitives(k)
        )

    def _delays(self, k: int) -> tuple[Delayed, ...]:
        """What delays cost the sides of a pair, if its terms are known."""
        tables, budget = self._names.tables, self.budget
        if tables is None or budget is None or k != int(self._data[layout.NEAREST]):
            return ()
        delays = []
        ways = (budget.reaction_a, budget.reaction_b)
        for r, way in zip(self._robots_of(k), ways, strict=True):
            figures = None if r < 0 else tables.robots[r].stopping
            if figures is None:
                continue
            age = self._robot(r, layout.ROBOT_AGE)
            resting = self._robot(r, layout.ROBOT_PHASE) == RESTING
            cycles = (2.0 if resting else 1.0) * (tables.period + tables.late)
            delays.append(
                Delayed(
                    robot=tables.robots[r].name,
                    way=way,
                    time=age + figures.command + cycles,
                    excess=max(age - figures.sensing, 0.0),
                )
            )
        return tuple(delays)

    def _robot(self, r: int, place: int) -> float:
        at = layout.HEADER + r * layout.ROBOT_WIDTH + place
        return float(self._data[at])

    def _pair_sentence(self, reason: Reason, nearest: NearPair) -> str:
        if reason is Reason.UNPROVEN:
            pairs = self.unproven or (nearest,)
            distances = "; ".join(pair.distance_sentence for pair in pairs)
            return f"{SENTENCES[reason]}: {distances}"
        budget = self.budget
        sentence = nearest.why
        if budget is not None and not nearest.contract:
            sentence = f"{nearest.distance_sentence}, {budget.sentence}"
        for name in self._unbounded_sides():
            sentence += f"; nothing is proven about the motion of '{name}', mode fixed"
        if reason in (Reason.NEAR, Reason.TOO_CLOSE):
            return sentence
        return f"{SENTENCES[reason]}: {sentence}"

    def _input_sentence(self, reason: Reason) -> str:
        sentence, value = SENTENCES[reason], float(self._data[layout.VALUE])
        who = f"'{self.subject}': " if self.subject else ""
        tables = self._names.tables
        if reason is Reason.CYCLE_LATE and tables is not None and isfinite(value):
            return late_sentence(value, tables.period, tables.late)
        if reason in IN_MILLISECONDS:
            return f"{who}{sentence} ({value * 1e3:.1f} ms)"
        return who + sentence

    def _joint_sentence(self, reason: Reason) -> str:
        k = int(self._data[layout.JOINT])
        names = self._names
        value = float(self._data[layout.VALUE])
        if reason in AT_SPEED:
            return (
                f"joint '{names.joints[k]}' at {value:.2f} a second: "
                + (SENTENCES[reason])
            )
        if reason is Reason.DRIVE_LAGS:
            late = f"at least {value * 1e3:.1f} ms"
            return f"joint '{names.joints[k]}': {SENTENCES[reason]}, {late}"
        if reason is Reason.STATE_FROZEN:
            return f"joint '{names.joints[k]}': {SENTENCES[reason]} ({value:.4f})"
        if reason is Reason.STAMP_REPEATED:
            return f"joint '{names.joints[k]}': {SENTENCES[reason]} ({value:.6f} s)"
        if reason is Reason.NOT_FINITE:
            return f"joint '{names.joints[k]}' is at {value}; it must be finite"
        return (
            f"joint '{names.joints[k]}' is at {value:.4f}; its limits are "
            f"[{names.lower[k]:.4f}, {names.upper[k]:.4f}]"
        )


def short_by(pair: NearPair) -> float:
    """Length a pair lacks for its time not to be short [m]."""
    if not 0.0 < pair.time_left < SLOW_TIME_DEFAULT * HYSTERESIS:
        return -pair.clearance
    limit = SLOW_TIME_DEFAULT
    if pair.time_left >= limit:
        limit *= HYSTERESIS
    return pair.clearance * (limit / pair.time_left - 1.0)


def finite(value: object) -> object:
    """A value in which None stands for every number that JSON has no word for."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def pair_dict(pair: NearPair) -> dict[str, object]:
    """A near pair as plain numbers, lists and strings."""
    return {
        "a": pair.a,
        "b": pair.b,
        "primitive_a": pair.primitive_a,
        "primitive_b": pair.primitive_b,
        "distance": pair.distance,
        "primitive_distance": pair.primitive_distance,
        "exact_distance": pair.exact_distance,
        "buffer": pair.buffer,
        "clearance": pair.clearance,
        "needed": pair.needed,
        "envelope": pair.envelope,
        "time_left": pair.time_left,
        "time_to_contact": pair.time_to_contact,
        "point_a": pair.point_a.tolist(),
        "point_b": pair.point_b.tolist(),
        "normal": pair.normal.tolist(),
        "model_error": pair.model_error,
        "contract": pair.contract,
        "unproven": pair.unproven,
    }
