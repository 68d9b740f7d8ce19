"""Messages byte for byte: each record of them is declared once, here.

    header (48) | payload | seal (16)

Numbers are little-endian, and the offset of a field of n bytes is a multiple of n, so
that C reads a record as a struct and numpy as a view. Kernels, service, client and
recorder use these records; tests compare the tables of docs/service.md and the structs
of examples/armguard.h with them. Times are on the service's monotonic clock.
"""

from enum import IntEnum
from itertools import starmap
from math import inf, nan
from struct import Struct
from typing import (
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    get_args,
    get_type_hints,
)

import numpy as np

Buffer = bytes | bytearray | memoryview
Record = TypeVar("Record", bound=tuple[Any, ...])

U8 = Annotated[int, "u1"]
U16 = Annotated[int, "<u2"]
U32 = Annotated[int, "<u4"]
U64 = Annotated[int, "<u8"]
I64 = Annotated[int, "<i8"]
F32 = Annotated[float, "<f4"]
F64 = Annotated[float, "<f8"]
Cookie = Annotated[bytes, "(16,)u1"]
Point = Annotated[bytes, "(3,)<f8"]

# Characters of `struct` for scalars of numpy.
SCALARS = {"|u1": "B", "<u2": "H", "<u4": "I", "<u8": "Q", "<i8": "q"}
SCALARS |= {"<f4": "f", "<f8": "d"}


class Layout(Generic[Record]):
    """Bytes of a record, from the fields of its class; used like a `struct.Struct`.

    Attributes:
        record: The class: a `NamedTuple` of annotated fields. An array among them is
            read and written as its bytes.
        dtype: The record for numpy and for kernels.
        size: Its length [bytes].
        unpack_from: The record that begins at a place of bytes, 0 if none is given.
        values: The same as a plain tuple, for loops that have no time for more.
        put: Writes a plain tuple's values at a place of bytes, likewise.
    """

    def __init__(self, record: type[Record]) -> None:
        hints = get_type_hints(record, include_extras=True)
        self.record = record
        self.dtype = np.dtype([(name, get_args(h)[1]) for name, h in hints.items()])
        self.size = self.dtype.itemsize
        kinds = [self.dtype[name] for name in hints]
        forms = [f"{k.itemsize}s" if k.shape else SCALARS[k.str] for k in kinds]
        self._struct = struct = Struct("<" + "".join(forms))
        self.values, self.put = struct.unpack_from, struct.pack_into
        make, values = tuple.__new__, struct.unpack_from

        def unpack_from(data: Buffer, at: int = 0) -> Record:
            return make(record, values(data, at))

        self.unpack_from = unpack_from

    def pack(self, *values: Any, **fields: Any) -> bytes:
        """The bytes of a record, given as the arguments of its class."""
        return self._struct.pack(*self.record(*values, **fields))

    def pack_into(self, data: Any, at: int, /, *values: Any, **fields: Any) -> None:
        """Write a record, given as the arguments of its class."""
        self.put(data, at, *self.record(*values, **fields))

    def rows(self, data: Buffer) -> tuple[Record, ...]:
        """All records in bytes that hold nothing else."""
        return tuple(starmap(self.record, self._struct.iter_unpack(data)))


class Kind(IntEnum):
    """Kind of a message."""

    HELLO = 1
    WELCOME = 2
    STATE = 3
    WISH = 4
    COMMAND = 5
    HEARTBEAT = 6
    CLAIM = 7
    GRANT = 8
    GIVE_BACK = 9
    CALL = 10
    REPLY = 11
    STOP = 12
    BYE = 13
    CHALLENGE = 14
    REFUSAL = 15


class Form(IntEnum):
    """Form of a desired motion."""

    VELOCITIES = 1
    POSITIONS = 2
    TWISTS = 3


class Cause(IntEnum):
    """Reason that the service, or a client, adds to the guard's.

    From `STOP_ORDERED` on it is a stop; from `NOT_CONNECTED` on a client sets it.
    """

    sentence: str
    """The same for people."""

    def __new__(cls, number: int, sentence: str = "") -> "Cause":
        """A cause with its sentence."""
        cause = int.__new__(cls, number)
        cause._value_, cause.sentence = number, sentence
        return cause

    NONE = 0, "the desired motion of the commander was judged"
    NO_COMMANDER = 1, "no client is in command; zero velocity was judged"
    NO_WISH = 2, "the commander has sent no desired motion yet"
    WISH_OLD = 3, "the commander is silent; zero velocity was judged"
    STOP_ORDERED = 10, "a stop was ordered; the commander has to engage"
    DEADLINE_MISSED = (
        11,
        "the service missed its deadline; reduce load, or raise --late",
    )
    FAULT = 12, "fault in the service; read its log"
    SHUTDOWN = 13, "the service shuts down"
    WAITING = 14, "waiting for the state of every robot"
    RESTARTED = 15, "the service restarted after a crash; the commander has to engage"
    NOT_CONNECTED = 100, "not connected to a service"
    SERVICE_SILENT = 101, "the service is silent; check that it runs"
    NO_ANSWER = 102, "the service is alive, but sent no command in time"
    SERVICE_GONE = 103, "the service has ended; start it again"
    NOT_YOURS = 104, "another controller sends the states of these robots"

    @property
    def stops(self) -> bool:
        """Whether it is a stop."""
        return self >= Cause.STOP_ORDERED


MAGIC, VERSION = 0x44524741, 2  # "AGRD"


class Header(NamedTuple):
    """Head of every message."""

    magic: U32
    version: U8
    kind: U8
    length: U16  # of the whole message [bytes]
    session: U64
    scene: U64  # first eight bytes of the scene's hash
    sender: U64  # 0 for the service
    sequence: U64
    stamp: I64  # when it was sent; in a HELLO on the sender's own clock [ns]


class Hello(NamedTuple):
    """Then a name in UTF-8."""

    role: U32  # whose key seals it
    every: U32  # cycles to one COMMAND; 0: none but answers to own states
    cookie: Cookie  # of the CHALLENGE, or zeros


class Challenge(NamedTuple):
    """The cookie that a HELLO of this session has to show once."""

    asked: I64  # stamp of the HELLO it answers [ns]
    cookie: Cookie


class WelcomePart(NamedTuple):
    """Then a part of the JSON."""

    part: U32
    parts: U32
    joints: U32
    robots: U32
    period: F64  # [s]
    asked: I64  # stamp of the HELLO it answers; 0 if it answers none [ns]
    received: I64  # when that HELLO was received [ns]


class State(NamedTuple):
    """Then positions of the robots' joints; velocities and a WISH as flags say."""

    robots: U32  # bit k for robot k
    flags: U32
    stamp: F64  # when it was measured [s]


class Wish(NamedTuple):
    """Then float64; seven for a twist: index of the tool, linear, angular velocity."""

    token: U64
    form: U32
    numbers: U32  # how many follow


class Command(NamedTuple):
    """Then a row for each robot, velocities of all joints, positions of all joints."""

    cycle: U64
    began_by: U64  # sender of the state that began the cycle; 0 if none did
    began_with: U64  # sequence of that state
    received: I64  # when that state was received [ns]
    ended: I64  # when it had been judged [ns]
    time: F64  # of the cycle [s]
    slack: F64  # clearance of the nearest pair [m]
    slack_time: F64  # least time until a stop must be ordered [s]
    body_a: U32  # of the nearest pair; NO_BODY if no pair is near
    body_b: U32
    distance: F64  # signed [m]
    clearance: F64  # distance beyond what the pair needs [m]
    point_a: Point  # witness points, world [m]
    point_b: Point
    reason: U16
    cause: U16
    level: U16  # the highest one
    action: U16  # the highest one
    flags: U16
    joints: U16
    robots: U16
    form: U16  # of the motion that was judged; 4 for a stop
    commander: U64  # 0 for none


class RobotRow(NamedTuple):
    """A robot in a COMMAND."""

    level: U16
    action: U16
    blocked: U16  # why it does not simply follow
    stopped_by: U16  # reason of its last order to stop
    speed_scale: F32  # in [0, 1]
    urgency: F32  # in [0, 1]
    age: F64  # of its state [s]
    sender: U64  # of its state
    sequence: U64  # of its state
    held_since: F64  # NaN if it does not wait for a person [s]


class Heartbeat(NamedTuple):
    """Heartbeat of the service; that of a client has no payload."""

    cycle: U64  # the next one
    commander: U64


class Claim(NamedTuple):
    """A request for the command."""

    force: U32  # 1 to take it from its holder
    reserved: U32 = 0


class Grant(NamedTuple):
    """The answer to a CLAIM."""

    granted: U32
    reserved: U32
    token: U64  # 0 if not granted
    holder: U64  # sender that has the command now
    watchdog: F64  # silence after which the command is lost [s]
    sequence: U64  # of the CLAIM


class GiveBack(NamedTuple):
    """The command is returned."""

    token: U64


class Reply(NamedTuple):
    """Then JSON."""

    sequence: U64  # of the CALL


class Refusal(NamedTuple):
    """Then the cause and a sentence in UTF-8, with a colon between them."""

    sequence: U64  # of the message that was dropped


HEADER, HELLO, CHALLENGE = Layout(Header), Layout(Hello), Layout(Challenge)
WELCOME, STATE, WISH = Layout(WelcomePart), Layout(State), Layout(Wish)
COMMAND, ROBOT, HEARTBEAT = Layout(Command), Layout(RobotRow), Layout(Heartbeat)
CLAIM, GRANT, GIVE_BACK = Layout(Claim), Layout(Grant), Layout(GiveBack)
REPLY, REFUSAL = Layout(Reply), Layout(Refusal)

# Length of a seal, and of the shortest and the longest message [bytes].
SEAL = 16
LEAST, MOST = HEADER.size + SEAL, 8192

# Bytes of JSON in one part of a WELCOME: a part fits into an Ethernet frame.
PART = 1200

# Robots are bits of a word.
MOST_ROBOTS = 32

NO_COOKIE = bytes(16)
NO_BODY = 0xFFFFFFFF
TWIST = 7

# Flags of a STATE.
HAS_VELOCITY, HAS_WISH = 1, 2

# Flags of a COMMAND: the cycle ended later than its period allows; the motion is not
# the commander's, see `Cause`; an object was changed within the last second.
MISSED, HELD, OBJECTS_CHANGED = 1, 2, 4

# Where rows of robots begin in a COMMAND [bytes].
ROBOTS_AT = HEADER.size + COMMAND.size

# Level and actions of robots that are stopped or held, as the guard numbers them.
STOP_LEVEL, STOP_ACTION, HOLD_ACTION = 30, 10, 5

# The COMMAND of a stop where no cycle was judged, and its row of each robot.
STOPPED = COMMAND.unpack_from(bytes(COMMAND.size))._replace(
    slack=nan,
    slack_time=nan,
    body_a=NO_BODY,
    body_b=NO_BODY,
    distance=inf,
    clearance=nan,
    level=STOP_LEVEL,
    action=STOP_ACTION,
)
STOPPED_ROW = RobotRow(STOP_LEVEL, STOP_ACTION, 0, 0, 0.0, 1.0, inf, 0, 0, nan)


def command_size(robots: int, joints: int) -> int:
    """Length of a COMMAND about so many robots and joints [bytes]."""
    return ROBOTS_AT + robots * ROBOT.size + 16 * joints + SEAL
