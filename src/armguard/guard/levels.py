"""Levels and reasons of a verdict."""

from enum import IntEnum
from typing import Self


class NamedNumber(IntEnum):
    """A number that prints as its name."""

    def __str__(self) -> str:
        """The name, as in "STOP"."""
        return self.name

    def __format__(self, form: str) -> str:
        """The name, also in f-strings."""
        return format(self.name, form)


class Level(NamedNumber):
    """Required behaviour of an arm; a higher level is always the safer one.

    From `STOP` on, the arm must not follow its operator.
    """

    CLEAR = 0
    """No checked pair is within the reporting margin, and time is not short."""

    CAUTION = 10
    """A pair is within the margin, and every pair keeps its buffer."""

    SLOW = 20
    """A stop would have to be ordered soon: scale speeds by `speed_scale`."""

    STOP = 30
    """A controlled stop: a pair is nearer than its buffer, a stop could not be proven
    safe any longer, or the cycle could not judge."""

    RECOVER = 31
    """At rest after a stop, and too near to let the operator go on in any direction:
    only motion that leads away may pass."""

    BRAKE = 40
    """Remove power: the controlled stop is not what was declared."""

    HARDWARE_STOP = 50
    """Use whatever stops the arm from outside: the brake is not what was declared."""


class Reason(NamedNumber):
    """Reason of a verdict's level: its number, its sentence and the level.

    Attributes:
        sentence: The reason in words.
        level: Level that the reason leads to.

    Example:
        >>> Reason.NOT_FINITE.level
        <Level.STOP: 30>
    """

    sentence: str
    level: Level

    def __new__(cls, value: int, sentence: str = "", level: Level = Level.STOP) -> Self:
        """A member, of its row."""
        reason = int.__new__(cls, value)
        reason._value_ = value
        reason.sentence, reason.level = sentence, level
        return reason

    OK = 0, "no checked pair is within the margin", Level.CLEAR
    NEAR = 10, "a pair is within the margin and keeps its buffer", Level.CAUTION
    SHORT_TIME = 15, "a stop would have to be ordered soon", Level.SLOW
    TOO_CLOSE = (
        20,
        "a pair is nearer than its buffer, or would be before the arms could stop",
    )
    NO_PROOF = 21, "no proof that a pair keeps its buffer until the arms could stop"
    BUDGET_SPENT = 22, "the cycle's budget was used up before all pairs were proven"
    CONTRACT_EXCEEDED = (
        23,
        "a contact is deeper or faster than its contract allows, or the contract "
        "is over",
    )
    STOPPING = 25, "an ordered stop is not yet done"
    RESTING = (
        26,
        "at rest; too near to a body to move in every direction",
        Level.RECOVER,
    )
    MOVED_AT_REST = 27, "an arm moves, but it must rest until it is released"
    UNPROVEN = (
        28,
        "nothing is proven for a pair: a robot leaves an object that moves by "
        "itself, and may be met on its way",
        Level.RECOVER,
    )
    STOP_LAGS = 30, "a stop was slower than declared; the brake is ordered", Level.BRAKE
    BRAKE_LAGS = (
        31,
        "a brake was slower than declared; stop the arm from outside",
        Level.HARDWARE_STOP,
    )
    STOP_ORDERED = 40, "a stop was ordered"
    RESTARTED = 41, "the service was restarted after a crash"
    DEADLINE_MISSED = 42, "the service missed the deadline of a cycle"
    SERVICE_FAULT = 43, "a fault in the service; its log names the fault"
    SHUTDOWN = 44, "the service shuts down"
    NOT_FINITE = 100, "a joint position is NaN or infinite"
    OUT_OF_LIMITS = 103, "a joint is outside its limits, where the model is not valid"
    WRONG_INPUT = 105, "the joint vector has the wrong length or holds no numbers"
    TIME_BACKWARDS = 106, "the stamp is older than the one before, or is no number"
    CAPACITY = 107, "more near pairs than the tables hold; not all could be measured"
    NO_DISTANCE = 108, "a measured distance is NaN"
    STAMP_MISSING = 110, "a stamp is missing, or is no finite number"
    TIME_STILL = 111, "the time of this cycle is that of the last one"
    STAMP_AHEAD = 112, "a stamp is later than the time of the cycle"
    STATE_STALE = 113, "a measurement is older than its limit"
    CYCLE_LATE = 114, "the cycle came later than the declared period allows"
    STATE_JUMPED = 115, "a joint moved faster than it can"
    TOO_FAST = 116, "a joint is faster than its declared top speed"
    NO_VELOCITY = 117, "the velocity is not known from one sample; give the next one"
    OBJECT_UNSEEN = 118, "an object that moves was never seen: place it, with a stamp"
    NOT_FOLLOWED = 119, "a joint is faster than its command"
    WRONG_COMMAND = 120, "the desired motion has the wrong length or is not finite"
    NO_WAY = 121, "no velocity was found that satisfies all constraints"
    STATE_FROZEN = (
        122,
        "the measured positions do not change, but a command or the measured "
        "velocity moves the joint",
    )
    DRIVE_LAGS = 126, "a drive follows commands later than its declared delay"
    STATE_DISAGREES = 130, "velocities and positions over time contradict each other"
    STAMP_REPEATED = 132, "the measurement changed and its stamp did not"
    OBJECT_AHEAD = 140, "the stamp of a sighting is later than the time of the cycle"
    OBJECT_BACKWARDS = 141, "the stamp of a sighting is older than the one before"
    OBJECT_REPEATED = 142, "two sightings with one stamp have different poses"
    OBJECT_STALE = 143, "the last sighting is older than its limit"
    OBJECT_JUMPED = 144, "the object moved farther than its top speed allows"
    OBJECT_TOO_FAST = 145, "the object was seen to be faster than its top speed"
    OBJECT_NOT_FINITE = 146, "a pose, velocity or stamp of a sighting is not finite"


# Reasons of a stop that a person or the service orders, not the judgement of a cycle.
# After the first two only `engage` lets a robot go on.
ORDERED = (
    Reason.STOP_ORDERED,
    Reason.RESTARTED,
    Reason.DEADLINE_MISSED,
    Reason.SERVICE_FAULT,
    Reason.SHUTDOWN,
)
UNTIL_ENGAGED = (Reason.STOP_ORDERED, Reason.RESTARTED)

# Reasons that name an object.
OF_OBJECTS = tuple(reason for reason in Reason if reason.name.startswith("OBJECT_"))
