"""Verdicts of a guard with other settings in the situations of a recording.

The recorded motion does not obey the other guard's commands. So in every cycle that one
starts from the state of the recorded guard and judges the same input by its own
settings; its verdict counts for that cycle only. That is right for each cycle and for
the first difference, and shows nothing of the arms' motion after it.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from armguard.errors import ArmguardError, RecordingError
from armguard.guard.levels import Level
from armguard.guard.verdict import Verdict
from armguard.recording.frames import Form, Frame, Kind
from armguard.recording.recording import Recording, reading
from armguard.recording.replay import (
    budget_of,
    do,
    guard_is_fixed,
    guard_of,
    inputs,
    judge,
    known_frames,
)
from armguard.recording.settings import change
from armguard.respond import Guard

# A velocity that differs by less is the same for every drive [rad/s or m/s].
SAME_VELOCITY = 1e-6

# A stop of the other guard that comes within this time of a recorded one is that one;
# and one that begins again so soon is still the same [s].
SAME_STOP = 0.1

CAVEAT = (
    "The recorded motion does not obey the other settings: each cycle is judged in the "
    "situation that was recorded, as if they had held in that cycle only. Up to the "
    "first difference this is what would have happened; what the arms would have done "
    "after it is not known."
)


@dataclass(slots=True)
class Stop:
    """The beginning of a level of STOP or more."""

    cycle: int
    time: float  # since the recording's first frame [s]
    robot: str  # empty where no stops are predicted
    level: str
    reason: str
    why: str  # the reason in words


@dataclass
class Side:
    """The verdicts of one of the two guards."""

    # Time at each level [s].
    seconds_at_level: dict[str, float] = field(
        default_factory=lambda: {level.name: 0.0 for level in Level}
    )
    stops: list[Stop] = field(default_factory=list)
    slows: int = 0  # beginnings of a level of SLOW
    least_headroom: float = np.inf  # of a nearest pair [m]
    least_distance: float = np.inf  # likewise [m]
    nearest: str = ""  # the pair of the least headroom in words; "" for none
    nearest_at: float | None = None  # when, since the recording's first frame [s]

    def __post_init__(self) -> None:
        # Levels of the last cycle, and the last time of each robot's stop [s].
        self.levels: dict[str, Level] = {}
        self._stopped_at: dict[str, float] = {}

    def add(
        self,
        frame: Frame,
        time: float,
        lasted: float,
        verdict: Verdict,
        before: Mapping[str, Level],
    ) -> None:
        """Take in the verdict of a cycle.

        Args:
            frame: The cycle.
            time: When, since the recording's first frame [s].
            lasted: For how long it held [s].
            verdict: The verdict.
            before: Levels the cycle began with: one that begins stopped orders no
                stop.
        """
        self.seconds_at_level[verdict.level.name] += lasted
        levels = verdict.levels or {"": verdict.level}
        for robot, level in levels.items():
            was = before.get(robot, Level.CLEAR)
            self.slows += was < Level.SLOW <= level < Level.STOP
            if level < Level.STOP:
                continue
            over = time - self._stopped_at.get(robot, -np.inf) > SAME_STOP
            self._stopped_at[robot] = time
            if over and was < Level.STOP:
                cause = verdict.causes.get(robot, verdict.reason)
                self.stops.append(
                    Stop(frame.cycle, time, robot, level.name, cause.name, verdict.why)
                )
        self.levels = dict(levels)
        if (pair := verdict.nearest) is None:
            return
        self.least_distance = min(self.least_distance, pair.distance)
        if pair.headroom < self.least_headroom:
            self.least_headroom = pair.headroom
            self.nearest, self.nearest_at = pair.why, time


@dataclass(slots=True)
class Comparison:
    """A recording, and the same under other settings."""

    settings: dict[str, str]  # that were changed
    cycles: int = 0  # that were judged
    skipped: int = 0  # that could not be
    recorded: Side = field(default_factory=Side)
    changed: Side = field(default_factory=Side)
    commands: int = 0  # cycles in which robots would have got another command
    # Its cycle, its time [s] and what it is; None if there is none.
    first_difference: dict[str, Any] | None = None
    refused: list[str] = field(default_factory=list)  # calls, in words
    problems: list[str] = field(default_factory=list)  # of the recording, in words

    @property
    def gone(self) -> list[Stop]:
        """Recorded stops that the other guard would not have ordered then."""
        return unmatched(self.recorded.stops, self.changed.stops)

    @property
    def new(self) -> list[Stop]:
        """Stops that it would have ordered and that were not."""
        return unmatched(self.changed.stops, self.recorded.stops)

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and strings."""
        found = asdict(self)
        return found | {
            "caveat": CAVEAT,
            "stops_gone": [asdict(stop) for stop in self.gone],
            "stops_new": [asdict(stop) for stop in self.new],
            "cycles_told_otherwise": found.pop("commands"),
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
    with reading(recording.paths[0]):
        other = change(recording.scene(), budget_of(recording), settings)
        pair = Pair(
            guard_of(recording),
            Guard(other.scene, budget=other.budget, self_test=False),
        )
        answer = Comparison(dict(settings))
        period = pair.was.tables.period
        for time, frame, known in known_frames(recording, start, end):
            if frame.kind is Kind.CHECKPOINT and known:
                # The cycle after a checkpoint measures all pairs anew.
                pair.was.checkpoint()
            elif frame.kind is Kind.CHECKPOINT:
                pair.restore(frame.data)
            elif frame.kind is Kind.EVENT and known:
                do(pair.was, frame)
                try:
                    do(pair.now, frame)
                except ArmguardError as error:
                    answer.refused.append(
                        f"{frame.text['call']} at {time:.3f} s: {error}"
                    )
            elif frame.kind is Kind.CYCLE and not known:
                answer.skipped += 1
            elif frame.kind is Kind.CYCLE:
                look(answer, pair, frame, time, period)
                if progress is not None and answer.cycles % 100 == 0:
                    progress(100)
        answer.problems = recording.problems
        return answer


class Pair:
    """The recorded guard and the one with other settings."""

    def __init__(self, was: Guard, now: Guard) -> None:
        self.was, self.now = was, now
        self._fixed = guard_is_fixed(was), guard_is_fixed(now)
        # Whether the other one starts from the state of the recorded one.
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
                "not know held objects; begin where none is held, with --from"
            )
        else:
            self.now.stand_as(self.was)

    def judge(self, frame: Frame) -> tuple[Verdict, Any, Verdict, Any]:
        """Verdict and command of both in a cycle."""
        if self.shares:
            self.now.take_over(self.was)
        elif self._fixed == (True, False):
            # The recorded arms never obeyed its stops: it must not wait for their end.
            self.now.forget_stops()
        was = judge(self.was, frame)
        if self.shares:
            return *was, *judge(self.now, frame)
        given = inputs(self.now, frame)
        if self._fixed[1]:
            # In this mode nothing but the positions counts.
            return *was, self.now.step(given["q"]), None
        return *was, self.now.step(**given), None


def look(
    answer: Comparison, pair: Pair, frame: Frame, time: float, lasted: float
) -> None:
    """Judge one cycle twice and take in both verdicts."""
    was, command, now, other_command = pair.judge(frame)
    answer.cycles += 1
    begins = answer.recorded.levels
    own = begins if pair.shares else answer.changed.levels
    answer.recorded.add(frame, time, lasted, was, begins)
    answer.changed.add(frame, time, lasted, now, own)
    other = ""
    if was.level != now.level:
        other = f"{was.level.name} becomes {now.level.name}: {now.why}"
    both = command is not None and other_command is not None
    if both and frame.form is not Form.STEP:
        sent, velocity = command.velocity, other_command.velocity
        apart = np.abs(sent - velocity)
        if not (apart <= SAME_VELOCITY).all():
            answer.commands += 1
            j = int(np.argmax(apart))
            other = other or (
                f"{pair.was.q_names[j]} is commanded {velocity[j]:.6f} instead of "
                f"{sent[j]:.6f}"
            )
    if other and answer.first_difference is None:
        first = {"cycle": frame.cycle, "time": time, "what": other}
        answer.first_difference = first


def unmatched(stops: list[Stop], others: list[Stop]) -> list[Stop]:
    """Those stops of one side that the other side has not, nearly at the same time.

    A stop of all robots is one of each.
    """
    left, found = list(others), []
    for stop in stops:
        same = [
            other
            for other in left
            if abs(other.time - stop.time) <= SAME_STOP
            and (stop.robot == other.robot or not (stop.robot and other.robot))
        ]
        if same:
            left.remove(min(same, key=lambda o: abs(o.time - stop.time)))
        else:
            found.append(stop)
    return found
