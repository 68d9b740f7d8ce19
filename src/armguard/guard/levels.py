"""Levels and reasons of a verdict."""

from enum import IntEnum


class Level(IntEnum):
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


class Reason(IntEnum):
    """Reason of a verdict's level; each member has one sentence in `SENTENCES`."""

    OK = 0
    NEAR = 10
    SHORT_TIME = 15
    TOO_CLOSE = 20
    NO_PROOF = 21
    BUDGET_SPENT = 22
    CONTRACT_EXCEEDED = 23
    STOPPING = 25
    RESTING = 26
    MOVED_AT_REST = 27
    UNPROVEN = 28
    STOP_LAGS = 30
    BRAKE_LAGS = 31
    STOP_ORDERED = 40
    RESTARTED = 41
    DEADLINE_MISSED = 42
    SERVICE_FAULT = 43
    SHUTDOWN = 44
    NOT_FINITE = 100
    OUT_OF_LIMITS = 103
    WRONG_INPUT = 105
    TIME_BACKWARDS = 106
    CAPACITY = 107
    NO_DISTANCE = 108
    STAMP_MISSING = 110
    TIME_STILL = 111
    STAMP_AHEAD = 112
    STATE_STALE = 113
    CYCLE_LATE = 114
    STATE_JUMPED = 115
    TOO_FAST = 116
    NO_VELOCITY = 117
    OBJECT_UNSEEN = 118
    NOT_FOLLOWED = 119
    WRONG_COMMAND = 120
    NO_WAY = 121
    STATE_FROZEN = 122
    DRIVE_LAGS = 126
    STATE_DISAGREES = 130
    STAMP_REPEATED = 132
    OBJECT_AHEAD = 140
    OBJECT_BACKWARDS = 141
    OBJECT_REPEATED = 142
    OBJECT_STALE = 143
    OBJECT_JUMPED = 144
    OBJECT_TOO_FAST = 145
    OBJECT_NOT_FINITE = 146


SENTENCES: dict[Reason, str] = {
    Reason.OK: "no checked pair is within the margin",
    Reason.NEAR: "a pair is within the margin and keeps its buffer",
    Reason.SHORT_TIME: "a stop would have to be ordered soon",
    Reason.TOO_CLOSE: "a pair is nearer than its buffer, or would be before the arms "
    "could stop",
    Reason.NO_PROOF: "no proof that a pair keeps its buffer until the arms could stop",
    Reason.BUDGET_SPENT: "the cycle's budget was used up before all pairs were proven",
    Reason.CONTRACT_EXCEEDED: "a contact is deeper or faster than its contract allows, "
    "or the contract is over",
    Reason.STOPPING: "an ordered stop is not yet done",
    Reason.RESTING: "at rest; too near to go on in every direction",
    Reason.UNPROVEN: "nothing is proven for a pair: a robot leaves an object that "
    "moves by itself, and may be met on its way",
    Reason.MOVED_AT_REST: "an arm moves though it was to rest until it is let go",
    Reason.STOP_LAGS: "a stop was slower than declared; the brake is ordered",
    Reason.BRAKE_LAGS: "a brake was slower than declared; stop the arm from outside",
    Reason.STOP_ORDERED: "a stop was ordered",
    Reason.RESTARTED: "the service was restarted after a crash",
    Reason.DEADLINE_MISSED: "the service missed the deadline of a cycle",
    Reason.SERVICE_FAULT: "a fault in the service; its log names the fault",
    Reason.SHUTDOWN: "the service shuts down",
    Reason.NOT_FINITE: "a joint position is NaN or infinite",
    Reason.OUT_OF_LIMITS: "a joint is outside its limits, where the model is not valid",
    Reason.WRONG_INPUT: "the joint vector has the wrong length or holds no numbers",
    Reason.TIME_BACKWARDS: "the stamp is older than the one before, or is no number",
    Reason.CAPACITY: "more near pairs than the tables hold; not all could be measured",
    Reason.NO_DISTANCE: "a measured distance is NaN",
    Reason.STAMP_MISSING: "a stamp is missing, or is no finite number",
    Reason.TIME_STILL: "the time of this cycle is that of the last one",
    Reason.STAMP_AHEAD: "a stamp is later than the time of the cycle",
    Reason.STATE_STALE: "a measurement is older than its limit",
    Reason.CYCLE_LATE: "the cycle came later than the declared period allows",
    Reason.STATE_JUMPED: "a joint moved faster than it can",
    Reason.TOO_FAST: "a joint is faster than its declared top speed",
    Reason.OBJECT_UNSEEN: "an object that moves was never seen: place it, with a stamp",
    Reason.WRONG_COMMAND: "the desired motion has the wrong length or is not finite",
    Reason.STATE_FROZEN: "what it measures does not change though it was told to move, "
    "or its velocity says that it moves",
    Reason.STATE_DISAGREES: "velocities and positions over time contradict each other",
    Reason.STAMP_REPEATED: "the measurement changed and its stamp did not",
    Reason.OBJECT_AHEAD: "the stamp of a sighting is later than the time of the cycle",
    Reason.OBJECT_BACKWARDS: "the stamp of a sighting is older than the one before",
    Reason.OBJECT_REPEATED: "two sightings with one stamp have different poses",
    Reason.OBJECT_STALE: "the last sighting is older than its limit",
    Reason.OBJECT_JUMPED: "the object moved farther than its top speed allows",
    Reason.OBJECT_TOO_FAST: "the object was seen to be faster than its top speed",
    Reason.OBJECT_NOT_FINITE: "a pose, velocity or stamp of a sighting is not finite",
    Reason.NO_WAY: "no velocity was found that keeps all it must",
    Reason.NOT_FOLLOWED: "a joint is faster than it was told to be",
    Reason.DRIVE_LAGS: "a drive follows commands later than its declared delay",
    Reason.NO_VELOCITY: "the velocity is not known from one sample; give the next one",
}


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
OF_OBJECTS = (
    Reason.OBJECT_UNSEEN,
    Reason.OBJECT_AHEAD,
    Reason.OBJECT_BACKWARDS,
    Reason.OBJECT_REPEATED,
    Reason.OBJECT_STALE,
    Reason.OBJECT_JUMPED,
    Reason.OBJECT_TOO_FAST,
    Reason.OBJECT_NOT_FINITE,
)

GRADED = {
    Reason.SHORT_TIME: Level.SLOW,
    Reason.RESTING: Level.RECOVER,
    Reason.UNPROVEN: Level.RECOVER,
    Reason.STOP_LAGS: Level.BRAKE,
    Reason.BRAKE_LAGS: Level.HARDWARE_STOP,
}


def level_of(reason: Reason) -> Level:
    """Level that a reason leads to; STOP where no other level is declared.

    Example:
        >>> level_of(Reason.NOT_FINITE)
        <Level.STOP: 30>
    """
    if reason is Reason.OK:
        return Level.CLEAR
    if reason is Reason.NEAR:
        return Level.CAUTION
    return GRADED.get(reason, Level.STOP)
