"""Where everything is in a message; little-endian, every field on its own multiple.

    header (48) | payload | seal (16)

Numbers that need eight bytes start at multiples of eight, so that C reads them with a
struct and numpy with a view.
"""

from enum import IntEnum
from struct import Struct

from armguard.station.errors import StationError

MAGIC = 0x44524741  # "AGRD"
VERSION = 2

# Magic, version, kind, length of the whole message [bytes], session, scene, sender,
# sequence, when it was sent [ns]: on the service's monotonic clock as far as the sender
# knows it, in a HELLO on the sender's own.
HEADER = Struct("<IBBHQQQQq")
SEAL = 16
LEAST = HEADER.size + SEAL

# The longest message there is; a longer one is dropped unread [bytes].
MOST = 8192

# Bytes of JSON in one part of a WELCOME: a part fits into an Ethernet frame.
PART = 1200

# Robots are bits of a word.
MOST_ROBOTS = 32


class Kind(IntEnum):
    """What a message is."""

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
    """What is wished for."""

    VELOCITIES = 1
    POSITIONS = 2
    TWISTS = 3


# HELLO: role whose key seals it, how many cycles there are to one COMMAND (0: none but
# answers to own states), the cookie of the CHALLENGE or zeros, then a name in UTF-8.
HELLO = Struct("<II16s")

# CHALLENGE: the stamp of the HELLO it answers [ns], then the cookie that a HELLO of
# this session has to show once.
CHALLENGE = Struct("<q16s")
NO_COOKIE = bytes(16)

# WELCOME: part, parts, joints, robots, period [s], the stamp of the HELLO it answers
# [ns], when that came in, on the service's clock [ns], then a part of the JSON.
WELCOME = Struct("<IIIIdqq")

# STATE: robots as bits, flags, stamp on the service's clock [s]; then positions of the
# robots' joints, their velocities if told so, and a wish if told so.
STATE = Struct("<IId")
HAS_VELOCITY = 1
HAS_WISH = 2

# WISH: token, form, how many float64 follow. A twist is seven: index of the tool, three
# of its velocity, three of its angular velocity.
WISH = Struct("<QII")
TWIST = 7

# COMMAND: cycle, sender and sequence of the state that began it, when that came in and
# when it had been judged, on the service's clock [ns], time of the cycle [s], slack [m]
# and [s], bodies of the nearest pair, their distance and clearance [m], witness points.
COMMAND = Struct("<QQQqqdddIIdd6d")
# Then: reason, cause, level, action, flags, joints, robots, form, who commands.
SUMMARY = Struct("<8HQ")
# Then for each robot: level, action, blocked, reason of its last stop, speed scale,
# urgency, age of its state [s], sender and sequence of that state, since when it waits
# for a person, on the service's clock, NaN if it does not [s].
ROBOT = Struct("<4H2fdQQd")
# Then velocities and positions of all joints.
ROBOTS_AT = HEADER.size + COMMAND.size + SUMMARY.size
NOBODY = 0xFFFFFFFF
MISSED = 1  # flag: the cycle ended later than its period allows
HELD = 2  # flag: the wish is not the commander's, see `Cause`
OBJECTS_CHANGED = 4  # flag: an object was placed or removed within the last second

# HEARTBEAT of the service: next cycle, who commands. That of a client is empty.
HEARTBEAT = Struct("<QQ")

# CLAIM: whether to take the command from who has it.
CLAIM = Struct("<II")
# GRANT: whether it was granted, reserved, token, who has it now, after how much silence
# it is lost [s], sequence of the CLAIM.
GRANT = Struct("<IIQQdQ")
GIVE_BACK = Struct("<Q")

# REPLY: sequence of the CALL, then JSON.
REPLY = Struct("<Q")

# REFUSAL: sequence of the message that was dropped, then the cause and a sentence in
# UTF-8, with a colon between them.
REFUSAL = Struct("<Q")


class MessageError(StationError, ValueError):
    """A message that is none; the service counts and drops it."""
