"""Levels and reasons of a verdict."""

from armguard.errors import NamedNumber, WithSentence


class Level(NamedNumber):
    """Required behaviour of an arm; a higher level is always the safer one.

    From `STOP` on, the arm must not follow its operator.
    """

    CLEAR = 0
    """No checked pair is within the reporting margin, and time is not short."""

    CAUTION = 10
    """A pair is within the margin, and every pair keeps its buffer."""

    SLOW = 20
    """A stop will be needed soon: scale speeds by `speed_scale`."""

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


class Reason(WithSentence):
    """Reason of a verdict's level: its number, its sentence and the level.

    Attributes:
        sentence: The reason in words, with its remedy where there is one.
        level: Level that the reason leads to.

    Example:
        >>> Reason.NOT_FINITE.level
        <Level.STOP: 30>
    """

    level: Level

    def __init__(self, _: int, __: str = "", level: Level = Level.STOP) -> None:
        self.level = level

    OK = 0, "clear: nothing within the margin", Level.CLEAR
    NEAR = 10, "a pair is within the margin and keeps its distance", Level.CAUTION
    SHORT_TIME = 15, "slowing: a stop will be needed soon", Level.SLOW
    TOO_CLOSE = 20, "a pair is closer than the distance it must keep"
    NO_PROOF = 21, "no proof that a pair keeps its buffer while the arms stop"
    BUDGET_SPENT = 22, "the proof budget of the cycle is used up; raise it"
    CONTRACT_EXCEEDED = (
        23,
        "a contact is deeper or faster than its contract allows, or expired",
    )
    CROWDED = 24, "more cells near the arms than a cycle judges; take larger cells"
    STOPPING = 25, "still stopping"
    RESTING = (
        26,
        "stopped; only motion away from the obstacle is allowed",
        Level.RECOVER,
    )
    MOVED_AT_REST = 27, "the arm moves while it should be held"
    UNPROVEN = (
        28,
        "leaving a moving obstacle, which may still hit the arm; nothing is proven",
        Level.RECOVER,
    )
    STOP_LAGS = 30, "the stop was slower than declared; removing power", Level.BRAKE
    BRAKE_LAGS = (
        31,
        "the brake was slower than declared; stop the arm externally",
        Level.HARDWARE_STOP,
    )
    STOP_ORDERED = 40, "a stop was ordered"
    RESTARTED = 41, "the service restarted after a crash"
    DEADLINE_MISSED = 42, "the service missed the deadline of a cycle"
    SERVICE_FAULT = 43, "fault in the service; read its log"
    SHUTDOWN = 44, "the service shuts down"
    NOT_FINITE = 100, "a joint position or velocity is NaN or infinite"
    OUT_OF_LIMITS = 103, "a joint is outside its limits; check units and joint order"
    WRONG_INPUT = 105, "invalid measurement: wrong number of joints, or no numbers"
    TIME_BACKWARDS = 106, "a stamp is older than the one before; check the clocks"
    CAPACITY = 107, "more near pairs than the tables hold; reduce the margin"
    NO_DISTANCE = 108, "a measured distance is NaN"
    STAMP_MISSING = 110, "no finite stamp; pass the time of the measurement"
    TIME_STILL = 111, "the time of the cycle did not advance; check the clock"
    STAMP_AHEAD = 112, "a stamp is later than the cycle; synchronise the clocks"
    STATE_STALE = 113, "the measurement is older than its limit; check sensor, network"
    CYCLE_LATE = 114, "cycle too late: the loop is slower than the declared period"
    STATE_JUMPED = 115, "the position jumped farther than the joint can move"
    TOO_FAST = 116, "the joint is faster than its declared top speed"
    NO_VELOCITY = 117, "no velocity from a single sample; send the next one"
    OBJECT_UNSEEN = 118, "the moving object was never placed; place it with a stamp"
    NOT_FOLLOWED = 119, "the joint is faster than its command"
    WRONG_COMMAND = 120, "invalid command: wrong number of joints, or NaN"
    NO_WAY = 121, "no safe velocity exists here"
    STATE_FROZEN = 122, "the measured position is stuck while the joint moves"
    DRIVE_LAGS = 126, "the drive follows commands later than its declared delay"
    STATE_DISAGREES = 130, "measured velocities and positions contradict each other"
    STAMP_REPEATED = 132, "the measurement changed but its stamp did not"
    OBJECT_AHEAD = 140, "the sighting is later than the cycle; synchronise the clocks"
    OBJECT_BACKWARDS = 141, "the sighting is older than the one before"
    OBJECT_REPEATED = 142, "two sightings with one stamp have different poses"
    OBJECT_STALE = 143, "the last sighting is older than its limit"
    OBJECT_JUMPED = 144, "the object moved farther than its top speed allows"
    OBJECT_TOO_FAST = 145, "the object is faster than its declared top speed"
    OBJECT_NOT_FINITE = 146, "a pose, velocity or stamp of the sighting is not finite"
    CELLS_STALE = 150, "the cells are older than their limit; check the map's process"
    CELLS_AHEAD = 151, "the cells are later than the cycle; synchronise the clocks"


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
