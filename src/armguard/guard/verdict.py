"""Verdict of a cycle: a snapshot whose values are computed when they are read."""

from dataclasses import asdict, dataclass, fields
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.ahead import NO_PLAN, Ahead
from armguard.guard.answer import Answer, Counts, Names, SlotsSeen
from armguard.guard.budget import Budget, ProtectiveDistance, protective_distance
from armguard.guard.layout import IN_HEADER, IN_ROBOT
from armguard.guard.levels import Level, Reason
from armguard.guard.near_pair import NearPair, listed
from armguard.guard.nuisance import Nuisance, classify, lack_of
from armguard.guard.sentences import explanation_of, sentence_of, subject_of
from armguard.notebook import html_table

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Headroom:
    """Headroom of a verdict: length and time until a stop must be ordered.

    Attributes:
        m: Headroom of the nearest pair [m]; infinite if none is near.
        s: Time that the present motion of all robots may continue [s]; infinite if no
            moving pair is near.
    """

    m: float
    s: float


@dataclass(frozen=True, slots=True, eq=False)
class Cue:
    """Cues of one robot, from the pairs that are near or soon will be.

    Attributes:
        urgency: For light and sound, in [0, 1]: 0 if no stop is near, 1 where the robot
            does not follow its operator any more [-].
        time_to_contact: Lower bound of the robot's time to contact [s]; infinite if no
            pair is near.
        escape: Escape direction in joint space, a unit vector in the order of the
            robot's joints, or zeros, shape (n,).
        tool_escape: Motion of the tool's origin in that direction, world, shape (3,)
            [m/rad].
        force: Force on the tool away from near bodies, for a haptic device; world,
            shape (3,) [N].
        torque: Torque of that force about the tool's origin, world, shape (3,) [N m].
    """

    urgency: float
    time_to_contact: float
    escape: Floats
    tool_escape: Floats
    force: Floats
    torque: Floats

    def to_dict(self) -> dict[str, object]:
        """The cues as plain numbers and lists, ready for JSON."""
        return {f.name: listed(getattr(self, f.name)) for f in fields(self)}


class Verdict:
    """Answer of one cycle; immutable, safe to keep.

    Holds the numbers of the cycle; names, points and sentences are made when they are
    read.

    Attributes:
        stamp: Stamp, or if given the time, of the cycle [s], or None.
        cycle_time: Duration of the cycle [s]; all else in a verdict is a function of
            the inputs.
        ahead: How long an announced plan is proven from here on; none of `numbers`.
    """

    __slots__ = ("_data", "_fault", "_names", "_seen", "ahead", "cycle_time", "stamp")

    def __init__(
        self,
        data: Floats,
        names: Names,
        stamp: float | None,
        cycle_time: float,
        fault: str = "",
        seen: SlotsSeen | None = None,
        ahead: Ahead = NO_PLAN,
    ) -> None:
        self._data = data
        self._names = names
        self._fault = fault
        self._seen = seen
        self.ahead = ahead
        self.stamp = stamp
        self.cycle_time = cycle_time

    @property
    def numbers(self) -> Floats:
        """All numbers of the verdict, in the layout of `armguard.guard.layout`.

        With the names of the scene, `names_of`, they give the same verdict again.
        """
        return self._data

    @property
    def fault(self) -> str:
        """Fault of the input in words; empty if there is none."""
        return self._fault

    @property
    def reason(self) -> Reason:
        """Reason of the level."""
        return Reason(int(self._data[IN_HEADER.reason]))

    @property
    def level(self) -> Level:
        """Required behaviour of all arms: the highest of `levels` and of the reason."""
        return max((self.reason.level, *map(Level, self._numbers_of("level"))))

    @property
    def levels(self) -> dict[str, Level]:
        """Required behaviour of each robot; empty where every mode is "fixed"."""
        levels = map(Level, self._numbers_of("level"))
        return dict(zip(self._names.robots, levels, strict=True))

    @property
    def speed_scale(self) -> dict[str, float]:
        """Factor of the operator's speed for each robot, in [0, 1].

        It decreases with the time left until the robot's stop must be ordered.
        """
        return self._of_robots("scale")

    @property
    def ages(self) -> dict[str, float]:
        """Greatest age of each robot's measurement in this cycle [s]."""
        return self._of_robots("age")

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Robots whose motion no proof bounds: those in mode "fixed" beside others.

        In the proof of a neighbour such a robot counts as at rest.
        """
        return self._answer.unbounded

    @property
    def drive_delays(self) -> dict[str, float]:
        """Observed lower bound of the delay of each robot's drives, since a reset [s].

        From commands of `Guard.filter` and measured velocities of robots that do not
        stop; in quarters of the declared delay of commands, up to twice that delay. 0
        where a drive without a delay explains all measurements.
        """
        return self._of_robots("delay")

    @property
    def causes(self) -> dict[str, Reason]:
        """Reason of the last order of each robot that stops, brakes or is at rest."""
        last, levels = self.last_causes, self.levels
        return {name: last[name] for name in last if levels[name] >= Level.STOP}

    @property
    def last_causes(self) -> dict[str, Reason]:
        """Reason of each robot's last order to stop; `OK` if there was none."""
        causes = map(Reason, self._numbers_of("cause"))
        return dict(zip(self._names.robots, causes, strict=True))

    @property
    def headroom(self) -> Headroom:
        """Length and time that are left until a stop must be ordered."""
        nearest = self.nearest
        return Headroom(
            inf if nearest is None else nearest.headroom,
            float(self._data[IN_HEADER.least_time_left]) if self._names.robots else inf,
        )

    @property
    def budget(self) -> Budget | None:
        """Required separation of the nearest pair by cause; None if none is near."""
        return self._answer.budget

    @property
    def nuisance(self) -> Nuisance | None:
        """Cause of slowing or stopping, and its remedy; see `Nuisance`."""
        return classify(self.level, self.reason, lack_of(self.reason, self._answer))

    @property
    def protective_distance(self) -> ProtectiveDistance | None:
        """Required separation of the nearest pair in the symbols of the standards.

        None if its second side is no person, or no pair is near.
        """
        tables, nearest = self._names.tables, self.nearest
        if nearest is None or nearest.b not in tables.people:
            return None
        return self.protective_distance_of(nearest)

    def protective_distance_of(self, pair: NearPair) -> ProtectiveDistance | None:
        """Protective separation distance of the nearest pair, with any second side.

        Args:
            pair: `nearest`; the terms of other near pairs are not known.

        Returns:
            None for another pair, for two links of one robot, and where every mode is
            "fixed".
        """
        answer = self._answer
        k, budget = answer.nearest, answer.budget
        if k < 0 or budget is None:
            return None
        nearest = answer.pair(k)
        requested = (pair.primitive_a, pair.primitive_b)
        if requested != (nearest.primitive_a, nearest.primitive_b):
            return None
        a, b = answer.robots_of(k)
        if a == b:
            return None
        robots = self._names.robots
        return protective_distance(robots[a], nearest.b if b < 0 else robots[b], budget)

    @property
    def cues(self) -> dict[str, Cue]:
        """Cues for each robot's operator: urgency, escape direction and force."""
        tables, robots = self._names.tables, self._names.robots
        if not robots:
            return {}
        escape = self._names.first_row - len(tables.q_names)
        found = {}
        for part, row in zip(tables.robots, self._answer.robots, strict=True):
            first = escape + part.first_joint
            found[part.name] = Cue(
                urgency=float(row["urgency"]),
                time_to_contact=float(row["time"]),
                escape=self._data[first : first + part.joint_count].copy(),
                tool_escape=row["tool"].copy(),
                force=row["force"].copy(),
                torque=row["torque"].copy(),
            )
        return found

    @property
    def disproved(self) -> tuple[str, ...]:
        """Joints that have not stopped as declared, which invalidates the proofs."""
        return tuple(
            name
            for name, broken in zip(
                self._names.tables.q_names, self._names.disproved, strict=True
            )
            if broken
        )

    @property
    def near(self) -> tuple[NearPair, ...]:
        """All near pairs, ordered by primitive."""
        answer = self._answer
        return tuple(answer.pair(k) for k in range(answer.near_count))

    @property
    def nearest(self) -> NearPair | None:
        """The near pair with the least headroom, None if no pair is near."""
        k = int(self._data[IN_HEADER.nearest])
        return None if k < 0 else self._answer.pair(k)

    @property
    def unproven(self) -> tuple[NearPair, ...]:
        """Near pairs for which nothing is proven in this cycle."""
        return tuple(pair for pair in self.near if pair.unproven)

    @property
    def joint(self) -> str | None:
        """The joint of a fault, None if it concerns none."""
        k = int(self._data[IN_HEADER.joint])
        return None if k < 0 else self._names.tables.q_names[k]

    @property
    def subject(self) -> str:
        """Name of the joint, object or robot of a fault; "" if all, or none."""
        return subject_of(self.reason, self._answer, self.disproved)

    @property
    def counts(self) -> Counts:
        """Work of the cycle, as counts."""
        return self._answer.counts

    @property
    def why(self) -> str:
        """The verdict in one short line: pair, distance, action, remedy."""
        return sentence_of(
            self.level, self.reason, self._answer, self.disproved, self._fault
        )

    def explain(self) -> str:
        """The verdict in full: distances, terms of what must be kept, robots, joints.

        Several lines; see docs/verdicts.md.
        """
        return explanation_of(self.why, self.reason, self._answer, self.disproved)

    def to_dict(self) -> dict[str, object]:
        """The verdict as plain numbers, lists and strings, ready for JSON.

        Infinite and NaN values become None.
        """
        nuisance, kept, nearest = self.nuisance, self.protective_distance, self.nearest
        answer = {
            "stamp": self.stamp,
            "level": self.level.name,
            "reason": self.reason.name,
            "why": self.why,
            "joint": self.joint,
            "levels": {name: level.name for name, level in self.levels.items()},
            "speed_scale": self.speed_scale,
            "headroom": {"m": self.headroom.m, "s": self.headroom.s},
            "budget": self.budget and asdict(self.budget),
            "ages": self.ages,
            "drive_delays": self.drive_delays,
            "unbounded": list(self.unbounded),
            "causes": {name: cause.name for name, cause in self.causes.items()},
            "disproved": list(self.disproved),
            "cues": {name: cue.to_dict() for name, cue in self.cues.items()},
            "nuisance": nuisance
            and {**asdict(nuisance), "cause": nuisance.cause.value},
            "protective_distance": kept and {**asdict(kept), "total": kept.total},
            "near": [pair.to_dict() for pair in self.near],
            "nearest": None if nearest is None else nearest.to_dict(),
            "counts": asdict(self.counts),
            "cycle_time": self.cycle_time,
        }
        return {key: finite(value) for key, value in answer.items()}

    def tobytes(self) -> bytes:
        """Level, reason and near pairs as bytes: equal inputs give equal bytes.

        The counts of work are left out: they depend on the earlier poses of the arms.
        """
        state = self._data.copy()
        state[IN_HEADER.pairs_tested : IN_HEADER.pairs_apart + 1] = 0.0
        return state.tobytes()

    def __repr__(self) -> str:
        """Level, reason and the sentence."""
        return f"<Verdict {self.level.name} {self.reason.name}: {self.why}>"

    def _repr_html_(self) -> str:
        """The level of each robot and the nearest pair as tables, for notebooks."""
        scale = self.speed_scale
        rows = [
            (name, level, f"{100.0 * scale[name]:.0f} %")
            for name, level in self.levels.items()
        ]
        caption = f"{self.level}: {self.why}"
        shown = html_table(caption, ("robot", "level", "speed"), rows)
        pair = self.nearest
        if pair is None:
            return shown
        lengths = (pair.distance, pair.needed, pair.headroom)
        row = (f"{pair.a} to {pair.b}", *(f"{m * 1e3:.1f} mm" for m in lengths))
        head = ("nearest pair", "distance", "required", "headroom")
        return shown + html_table("", head, [row])

    @property
    def _answer(self) -> Answer:
        """The numbers of the verdict by name."""
        return Answer(self._data, self._names, self._seen)

    def _numbers_of(self, field: str) -> list[Any]:
        """One number per robot, in their order; none where every mode is "fixed"."""
        first = layout.HEADER + getattr(IN_ROBOT, field)
        end = layout.HEADER + len(self._names.robots) * layout.ROBOT_WIDTH
        numbers: list[Any] = self._data[first : end : layout.ROBOT_WIDTH].tolist()
        return numbers

    def _of_robots(self, field: str) -> dict[str, float]:
        """One number per robot, by the robots' names."""
        return dict(zip(self._names.robots, self._numbers_of(field), strict=True))


def finite(value: object) -> object:
    """A value in which None replaces every number that JSON cannot represent."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
