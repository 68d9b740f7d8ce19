"""What a verdict can say: how bad it is, and why."""

from enum import IntEnum


class Level(IntEnum):
    """What the arm should do; a higher level is always the safer one.

    The numbers leave room for the graded levels between caution and stop.
    """

    CLEAR = 0
    """No checked pair is within the reporting margin."""

    CAUTION = 10
    """A pair is within the margin, and every pair keeps its buffer."""

    STOP = 30
    """A pair is nearer than its buffer, or the cycle could not judge."""


class Reason(IntEnum):
    """Why a verdict has its level; each member has one sentence in `SENTENCES`."""

    OK = 0
    NEAR = 10
    TOO_CLOSE = 20
    NOT_FINITE = 100
    OUT_OF_LIMITS = 103
    WRONG_INPUT = 105
    TIME_BACKWARDS = 106
    CAPACITY = 107
    NO_DISTANCE = 108


SENTENCES: dict[Reason, str] = {
    Reason.OK: "no checked pair is within the margin",
    Reason.NEAR: "a pair is within the margin and keeps its buffer",
    Reason.TOO_CLOSE: "a pair is nearer than its buffer",
    Reason.NOT_FINITE: "a joint position is NaN or infinite",
    Reason.OUT_OF_LIMITS: "a joint is outside its limits, where the model is not valid",
    Reason.WRONG_INPUT: "the joint vector has the wrong length or holds no numbers",
    Reason.TIME_BACKWARDS: "the stamp is older than the one before, or is no number",
    Reason.CAPACITY: "more near pairs than the tables hold; not all could be measured",
    Reason.NO_DISTANCE: "a measured distance is NaN",
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
    return Level.STOP
