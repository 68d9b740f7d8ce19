"""How a COMMAND is cut into numbers: first what is always looked at."""

from struct import Struct

from armguard.station.wire.layout import COMMAND, SUMMARY

# A `COMMAND`, but that a client's own answers are of cycle -1.
BODY = Struct(COMMAND.format.replace("Q", "q", 1))

# What is looked at in every message, at once. Of its header: what is the same in all of
# a session and scene, as four numbers, then sequence and clock; of its body: sender and
# sequence of the state that began the cycle, and the nearest pair; then its summary.
SAME = Struct("<4Q")
FIELDS = Struct(SAME.format + "Qq" + "8xQQ" + "40xII64x" + SUMMARY.format[1:])
SEQUENCE, SENT, BODY_A, BODY_B = 4, 5, 8, 9
BEGAN = slice(6, 8)
REASON, CAUSE, LEVEL, ACTION, FLAGS, JOINTS, ROBOTS, _, COMMANDER = range(10, 19)
