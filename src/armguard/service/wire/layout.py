"""Messages byte for byte: each record of them is declared once, here.

    header (48) | payload | seal (16)

Numbers are little-endian, and the offset of a field of n bytes is a multiple of n, so
that C reads a record as a struct and numpy as a view. Kernels, service, client and
recorder use these records; `published` writes the tables of docs/service.md, where the
comment of a field is its text, and the structs of examples/armguard.h. Where records
change, VERSION rises. Times are on the service's monotonic clock.
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

from armguard.errors import WithSentence

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
SCALARS = {"|u1": "B", "<u2": "H", "<u4": "I", "<u8": "Q", "<i4": "i", "<i8": "q"}
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
    FRAME = 16
    HEALTH = 17
    CELLS = 18
    CELLS_TAKEN = 19


class Form(IntEnum):
    """Form of a desired motion."""

    VELOCITIES = 1
    POSITIONS = 2
    TWISTS = 3


class Cause(WithSentence):
    """Reason that the service, or a client, adds to the guard's.

    From `STOP_ORDERED` on it is a stop; from `NOT_CONNECTED` on a client sets it. The
    service and a controller each set those of the reflex by themselves.
    """

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
    REFLEX_STOPPED = 16, "the reflex stops the arms; reset it, then engage"
    REFLEX_SILENT = 17, "the reflex is silent; start it, reset it, then engage"
    NOT_CONNECTED = 100, "not connected to a service"
    SERVICE_SILENT = 101, "the service is silent; check that it runs"
    NO_ANSWER = 102, "the service is alive, but sent no command in time"
    SERVICE_GONE = 103, "the service has ended; start it again"
    NOT_YOURS = 104, "another controller sends the states of these robots"

    @property
    def stops(self) -> bool:
        """Whether it is a stop."""
        return self >= Cause.STOP_ORDERED


MAGIC, VERSION = 0x44524741, 3  # "AGRD"


class Header(NamedTuple):
    """Head of every message."""

    magic: U32  # 0x44524741, "AGRD"
    version: U8  # version of the messages
    kind: U8  # kind
    length: U16  # length of the whole message [bytes]
    session: U64  # session: random, new at each start of the service; 0 in the first
    # HELLO
    scene: U64  # scene: the first eight bytes of the scene's hash; any in a HELLO
    sender: U64  # sender: random for each client, not 0; 0 for the service
    sequence: U64  # sequence: rises from message to message of a sender
    stamp: I64  # when it was sent [ns]: on the sender's monotonic clock in a HELLO and
    # from the service; else the earliest it may be on the service's clock


class Hello(NamedTuple):
    """Then a name in UTF-8."""

    role: U32  # role whose key seals it: 1 observe, 2 sense, 3 command, 4 administer
    every: U32  # cycles to each COMMAND that is sent; 0 for none but answers to own
    # states
    cookie: Cookie  # cookie of the CHALLENGE; zeros in the first HELLO


class Challenge(NamedTuple):
    """The cookie that a HELLO of this session has to show once."""

    asked: I64  # the header's clock of the HELLO that is answered [ns]
    cookie: Cookie  # cookie


class WelcomePart(NamedTuple):
    """Then a part of the JSON."""

    part: U32  # part, from 0
    parts: U32  # number of parts
    joints: U32  # joints n
    robots: U32  # robots r
    period: F64  # period [s]
    asked: I64  # the header's clock of the HELLO that is answered; 0 if none is [ns]
    received: I64  # when that came in, on the service's clock [ns]


class State(NamedTuple):
    """Then positions of the robots' joints; velocities and a WISH as flags say."""

    robots: U32  # its robots: bit k for robot k
    flags: U32  # flags: 1 velocities follow, 2 a WISH follows
    stamp: F64  # when it was measured, on the service's monotonic clock [s]


class Wish(NamedTuple):
    """Then float64; seven for a twist: index of the tool, linear, angular velocity."""

    token: U64  # token from the GRANT
    form: U32  # 1 velocities, 2 positions, 3 twists
    numbers: U32  # how many f64 follow


class Command(NamedTuple):
    """Then a row for each robot, velocities of all joints, positions of all joints."""

    cycle: U64  # number of the cycle
    began_by: U64  # sender of the state that began it; 0 if none did
    began_with: U64  # sequence of that state
    received: I64  # when it came in, on the service's monotonic clock [ns]
    ended: I64  # when it had been judged [ns]
    time: F64  # time of the cycle [s]
    headroom: F64  # headroom of the nearest pair [m]
    time_left: F64  # least time until a stop must be ordered [s]
    body_a: U32  # body A of the nearest pair, index into `bodies`; 0xFFFFFFFF for none
    body_b: U32  # body B
    distance: F64  # their signed distance [m]
    pair_headroom: F64  # their headroom: distance beyond what the pair needs [m]
    point_a: Point  # witness point on A, world [m]
    point_b: Point  # witness point on B [m]
    reason: U16  # reason, see `reasons` of the WELCOME and
    # [concepts](concepts.md#level-and-reason)
    cause: U16  # cause, see below
    level: U16  # level: the highest one
    action: U16  # action: the highest one; 0 follow, 5 hold, 10 stop, 20 brake, 30
    # hardware stop
    flags: U16  # flags: 1 deadline missed, 2 the judged motion is not the commander's,
    # 4 an object was changed within the last second
    joints: U16  # joints n
    robots: U16  # robots r
    form: U16  # form of the judged motion, as in a WISH; 4 for a stop
    commander: U64  # the commander; 0 for none


class RobotRow(NamedTuple):
    """A robot in a COMMAND."""

    level: U16  # level
    action: U16  # action
    blocked: U16  # why it does not simply follow (`Blocked`)
    stopped_by: U16  # reason of its last order to stop
    speed_scale: F32  # speed scale, in [0, 1]
    urgency: F32  # urgency of its cues, in [0, 1]
    age: F64  # age of its state [s]
    sender: U64  # sender of its state
    sequence: U64  # sequence of its state
    held_since: F64  # since when it is held, on the service's clock; NaN if it is not
    # [s]


class Heartbeat(NamedTuple):
    """Heartbeat of the service; that of a client has no payload."""

    cycle: U64  # number of the next cycle
    commander: U64  # the commander; 0 for none


class Claim(NamedTuple):
    """A request for the command."""

    force: U32  # 1 to take the command from its holder, with the role administer
    reserved: U32 = 0  # 0


class Grant(NamedTuple):
    """The answer to a CLAIM."""

    granted: U32  # 1 if granted
    reserved: U32  # 0
    token: U64  # token; 0 if not
    holder: U64  # the present commander
    watchdog: F64  # silence after which the command is lost [s]
    sequence: U64  # sequence of the CLAIM


class GiveBack(NamedTuple):
    """The command is returned."""

    token: U64  # token


class Reply(NamedTuple):
    """Then JSON."""

    sequence: U64  # sequence of the CALL


class Refusal(NamedTuple):
    """Then the cause and a sentence in UTF-8, with a colon between them."""

    sequence: U64  # sequence of the message that was dropped


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
    headroom=nan,
    time_left=nan,
    body_a=NO_BODY,
    body_b=NO_BODY,
    distance=inf,
    pair_headroom=nan,
    level=STOP_LEVEL,
    action=STOP_ACTION,
)
STOPPED_ROW = ROBOT.unpack_from(bytes(ROBOT.size))._replace(
    level=STOP_LEVEL, action=STOP_ACTION, urgency=1.0, age=inf, held_since=nan
)


def command_size(robots: int, joints: int) -> int:
    """Length of a COMMAND about so many robots and joints [bytes]."""
    return ROBOTS_AT + robots * ROBOT.size + 16 * joints + SEAL
