"""What a verdict can say: how bad it is, and why."""

from enum import IntEnum


class Level(IntEnum):
    """What the arm should do; a higher level is always the safer one.

    Anything from `STOP` on means that the arm must not follow its operator.
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
    """Why a verdict has its level; each member has one sentence in `SENTENCES`."""

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
    STOP_LAGS = 30
    BRAKE_LAGS = 31
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
    Reason.MOVED_AT_REST: "an arm moves though it was to rest until it is let go",
    Reason.STOP_LAGS: "a stop was slower than declared; the brake is ordered",
    Reason.BRAKE_LAGS: "a brake was slower than declared; stop the arm from outside",
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
    Reason.CYCLE_LATE: "the cycle came later than the last proof holds",
    Reason.STATE_JUMPED: "a joint moved faster than it can",
    Reason.TOO_FAST: "a joint is faster than its declared top speed",
    Reason.OBJECT_UNSEEN: "an object that moves was never seen: place it, with a stamp",
    Reason.WRONG_COMMAND: "what is wanted has the wrong length or holds no numbers",
    Reason.STATE_FROZEN: "what it measures does not change though it was told to move",
    Reason.NO_WAY: "no velocity was found that keeps all it must",
    Reason.NOT_FOLLOWED: "a joint is faster than it was told to be",
    Reason.NO_VELOCITY: "the velocity is not known from one sample; give the next one",
}


GRADED = {
    Reason.SHORT_TIME: Level.SLOW,
    Reason.RESTING: Level.RECOVER,
    Reason.STOP_LAGS: Level.BRAKE,
    Reason.BRAKE_LAGS: Level.HARDWARE_STOP,
}


def level_of(reason: Reason) -> Level:
    """Level a reason leads to: everything that is not understood is a stop.

    Example:
        >>> level_of(Reason.NOT_FINITE)
        <Level.STOP: 30>
    """
    if reason is Reason.OK:
        return Level.CLEAR
    if reason is Reason.NEAR:
        return Level.CAUTION
    return GRADED.get(reason, Level.STOP)
