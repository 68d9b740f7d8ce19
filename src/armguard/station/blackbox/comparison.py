"""What a guard with other settings would have said in the situations of a recording.

The recorded motion does not obey the other guard's commands. So that one is put into
the recorded guard's place anew in every cycle: it is given all that the recorded guard
remembered, judges the same input by its own settings, and what it says counts for that
cycle only. That is honest about each cycle, and about the first difference. It says
nothing about what the arms would have done after it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armguard.errors import ArmguardError
from armguard.guard.levels import Level
from armguard.guard.verdict import NearPair, Verdict
from armguard.respond import Guard
from armguard.station.blackbox.plausible import believed
from armguard.station.blackbox.recording import Recording
from armguard.station.blackbox.replay import do, guard_is_fixed, inputs, judge, timed
from armguard.station.blackbox.settings import change
from armguard.station.errors import RecordingError
from armguard.station.frames import Form, Frame, Kind

# A velocity that differs by less is the same for every drive [rad/s or m/s].
SAME_VELOCITY = 1e-6

# A stop of the other guard that comes within this time of a recorded one is that one;
# and one that begins again so soon is still the same [s].
SAME_STOP = 0.1

CAVEAT = (
    "The recorded motion does not obey the other settings: each cycle is judged in the "
    "situation that was recorded, as if they had held in that cycle only. Up to the "
    "first difference this is what would have happened; what the arms would have done "
    "after it nobody knows."
)


@dataclass(slots=True)
class Stop:
    """A level of STOP or more that began.

    Attributes:
        cycle: Its cycle.
        time: When, from the recording's first frame on [s].
        robot: Whose; empty where no stops are predicted.
        level: The level.
        reason: Why.
        why: The same in words.
    """

    cycle: int
    time: float
    robot: str
    level: str
    reason: str
    why: str


@dataclass(slots=True)
class Side:
    """What one of the two guards said.

    Attributes:
        seconds: Time at each level [s].
        stops: Stops that began.
        slows: How often a robot began to be slowed.
        least_clearance: Least of what a nearest pair had beyond what it needs [m].
        least_distance: Least distance of a nearest pair [m].
        nearest: Who these were, in words; empty if nothing was ever near.
        nearest_at: When, from the recording's first frame on [s].
    """

    seconds: dict[str, float] = field(
        default_factory=lambda: {level.name: 0.0 for level in Level}
    )
    stops: list[Stop] = field(default_factory=list)
    slows: int = 0
    least_clearance: float = np.inf
    least_distance: float = np.inf
    nearest: str = ""
    nearest_at: float | None = None
    levels: dict[str, Level] = field(default_factory=dict)
    stopped_at: dict[str, float] = field(default_factory=dict)

    def add(
        self,
        frame: Frame,
        time: float,
        lasted: float,
        verdict: Verdict,
        before: Mapping[str, Level],
    ) -> None:
        """Take in what was said in a cycle.

        Args:
            frame: The cycle.
            time: When, from the recording's first frame on [s].
            lasted: For how long it held [s].
            verdict: What was said.
            before: Levels the cycle began with: one that begins stopped orders no
                stop.
        """
        self.seconds[verdict.level.name] += lasted
        levels = verdict.levels or {"": verdict.level}
        for robot, level in levels.items():
            was = before.get(robot, Level.CLEAR)
            self.slows += was < Level.SLOW <= level < Level.STOP
            if level < Level.STOP:
                continue
            over = time - self.stopped_at.get(robot, -np.inf) > SAME_STOP
            self.stopped_at[robot] = time
            if over and was < Level.STOP:
                cause = verdict.causes.get(robot, verdict.reason)
                self.stops.append(
                    Stop(frame.cycle, time, robot, level.name, cause.name, verdict.why)
                )
        self.levels = dict(levels)
        pair = verdict.nearest
        if pair is not None:
            self.see(pair, time)

    def see(self, pair: NearPair, time: float) -> None:
        """Take in the nearest pair of a cycle."""
        self.least_distance = min(self.least_distance, pair.distance)
        if pair.clearance < self.least_clearance:
            self.least_clearance = pair.clearance
            self.nearest, self.nearest_at = pair.why, time


@dataclass(slots=True)
class Comparison:
    """A recording, and the same under other settings.

    Attributes:
        settings: What was changed.
        cycles: Cycles that were judged.
        skipped: Those that could not be.
        recorded: What the guard said that was recorded.
        changed: What the other one would have said.
        gone: Recorded stops that it would not have ordered then.
        new: Stops that it would have ordered and that were not.
        commands: Cycles in which it would have told the robots something else.
        first: Cycle, time [s] and words of the first difference; None if there is none.
        refused: Calls it would have refused, in words.
        problems: What of the recording is missing or damaged.
    """

    settings: dict[str, str]
    cycles: int = 0
    skipped: int = 0
    recorded: Side = field(default_factory=Side)
    changed: Side = field(default_factory=Side)
    gone: list[Stop] = field(default_factory=list)
    new: list[Stop] = field(default_factory=list)
    commands: int = 0
    first: tuple[int, float, str] | None = None
    refused: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def conclude(self) -> None:
        """Tell which stops are whose."""
        self.gone = unmatched(self.recorded.stops, self.changed.stops)
        self.new = unmatched(self.changed.stops, self.recorded.stops)

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and strings."""
        sides = {}
        for name in ("recorded", "changed"):
            side: Side = getattr(self, name)
            sides[name] = {
                "seconds_at_level": side.seconds,
                "stops": [plain_stop(stop) for stop in side.stops],
                "slows": side.slows,
                "least_clearance": side.least_clearance,
                "least_distance": side.least_distance,
                "nearest": side.nearest,
                "nearest_at": side.nearest_at,
            }
        return {
            "settings": self.settings,
            "caveat": CAVEAT,
            "cycles": self.cycles,
            "skipped": self.skipped,
            **sides,
            "stops_gone": [plain_stop(stop) for stop in self.gone],
            "stops_new": [plain_stop(stop) for stop in self.new],
            "cycles_told_otherwise": self.commands,
            "first_difference": None
            if self.first is None
            else dict(zip(("cycle", "time", "what"), self.first, strict=True)),
            "refused": self.refused,
            "problems": self.problems,
        }


def compare(
    recording: Recording,
    settings: Mapping[str, str],
    *,
    start: float = 0.0,
    end: float = np.inf,
    progress: Callable[[int], None] | None = None,
) -> Comparison:
    """Judge a recording once more as it was, and with other settings.

    Args:
        recording: The recording.
        settings: Values by name, see `change`.
        start: Where to begin, from its first frame on [s].
        end: Where to end [s].
        progress: Called with the cycles judged since the last call.

    Raises:
        SettingError: There is no such setting, or it cannot have that value.
        RecordingError: The recording holds no scene, or the two cannot be compared.
    """
    if len(recording.parts()) > 1:
        raise RecordingError(
            f"{recording.paths[0].parent}: settings were changed between these "
            "recordings; name one of the files"
        )
    with believed(recording.paths[0]):
        return compare_scene(recording, settings, start, end, progress)


def compare_scene(
    recording: Recording,
    settings: Mapping[str, str],
    start: float,
    end: float,
    progress: Callable[[int], None] | None,
) -> Comparison:
    """See `compare`; the recording is of one scene."""
    budget = int(recording.info.get("budget", 1024))
    other = change(recording.scene(), budget, settings)
    pair = Pair(
        Guard(recording.scene(), budget=budget, self_test=False),
        Guard(other.scene, budget=other.budget, self_test=False),
    )
    answer = Comparison(dict(settings))
    period = pair.was.tables.period
    expected: int | None = None
    knows = False
    for time, frame in timed(recording, start):
        if time > end:
            break
        if frame.kind is Kind.CHECKPOINT:
            if not knows or expected != frame.cycle:
                pair.restore(frame.data)
            else:
                pair.was.checkpoint()
            knows, expected = True, frame.cycle
        elif frame.kind is Kind.EVENT and (knows or frame.cycle == 0):
            do(pair.was, frame)
            try:
                do(pair.now, frame)
            except ArmguardError as error:
                answer.refused.append(f"{frame.text['call']} at {time:.3f} s: {error}")
        elif frame.kind is Kind.CYCLE:
            knows = (knows and expected in (None, frame.cycle)) or frame.cycle == 0
            expected = frame.cycle + 1
            if not knows:
                answer.skipped += 1
                continue
            look(answer, pair, frame, time, period)
            if progress is not None and answer.cycles % 100 == 0:
                progress(100)
    answer.problems = recording.problems
    answer.conclude()
    return answer


class Pair:
    """The recorded guard and the one with other settings.

    Attributes:
        was: The recorded one.
        now: The other one.
        shares: Whether that one is put into the place of the recorded one.
    """

    def __init__(self, was: Guard, now: Guard) -> None:
        self.was, self.now = was, now
        self._fixed = guard_is_fixed(was), guard_is_fixed(now)
        self.shares = self._fixed == (False, False)

    def restore(self, data: bytes) -> None:
        """Begin with a checkpoint of the recorded guard.

        Raises:
            RecordingError: The other one cannot begin there.
        """
        self.was.restore(data)
        if self._fixed[0] == self._fixed[1]:
            self.now.restore(data)
        elif self.was.held:
            held = ", ".join(f"'{name}'" for name in self.was.held)
            raise RecordingError(
                f"{held} is held at the checkpoint, and a guard in mode 'fixed' does "
                "not know what is held; begin where nothing is, with --from"
            )
        else:
            self.now.stand_as(self.was)

    def judge(self, frame: Frame) -> tuple[Verdict, Any, Verdict, Any]:
        """What both say in a cycle, and what they tell the robots."""
        if self.shares:
            self.now.take_over(self.was)
        elif self._fixed == (True, False):
            # A guard that is asked for nothing but its word orders no stops: it must
            # not wait for arms to obey it that never heard of it.
            self.now.forget_stops()
        was, told = judge(self.was, frame)
        if self.shares:
            now, says = judge(self.now, frame)
            return was, told, now, says
        given = inputs(self.now, frame)
        if self._fixed[1]:
            # In this mode nothing but the positions counts.
            return was, told, self.now.step(given["q"]), None
        return was, told, self.now.step(**given), None


def look(
    answer: Comparison, pair: Pair, frame: Frame, time: float, lasted: float
) -> None:
    """Judge one cycle twice and take in what was said."""
    was, told, now, says = pair.judge(frame)
    answer.cycles += 1
    begins = answer.recorded.levels
    own = begins if pair.shares else answer.changed.levels
    answer.recorded.add(frame, time, lasted, was, begins)
    answer.changed.add(frame, time, lasted, now, own)
    other = ""
    if was.level != now.level:
        other = f"{was.level.name} becomes {now.level.name}: {now.why}"
    if told is not None and says is not None and frame.form is not Form.STEP:
        apart = np.abs(told.velocity - says.velocity)
        if not (apart <= SAME_VELOCITY).all():
            answer.commands += 1
            j = int(np.argmax(apart))
            other = other or (
                f"{pair.was.q_names[j]} is told {says.velocity[j]:.6f} in place of "
                f"{told.velocity[j]:.6f}"
            )
    if other and answer.first is None:
        answer.first = frame.cycle, time, other


def unmatched(stops: list[Stop], others: list[Stop]) -> list[Stop]:
    """Those stops of one side that the other side has not, nearly at the same time."""
    left = list(others)
    found = []
    for stop in stops:
        same = [other for other in left if is_same(stop, other)]
        if same:
            left.remove(min(same, key=lambda o: abs(o.time - stop.time)))
        else:
            found.append(stop)
    return found


def is_same(stop: Stop, other: Stop) -> bool:
    """Whether a stop of one side is that of the other; one of all is one of each."""
    whose = stop.robot == other.robot or not (stop.robot and other.robot)
    return whose and abs(other.time - stop.time) <= SAME_STOP


def plain_stop(stop: Stop) -> dict[str, Any]:
    """A stop as plain numbers and strings."""
    return {name: getattr(stop, name) for name in Stop.__slots__}
