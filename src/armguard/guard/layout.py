"""Layout of the array that holds the answer of a cycle, for kernels and verdicts.

The answer of a cycle is a header of `HEADER` float64 followed by one row of
`NEAR_WIDTH` float64 for each near pair. One array, so that a verdict is one copy.
Whole numbers are exact in float64 up to 2⁵³.
"""

from dataclasses import fields

from armguard.guard.budget import Budget

# Version of this layout, which recordings carry. Any change of an index below raises
# it: a recording of another layout is refused and not misread.
LAYOUT = 2

# Indices of the header.
REASON = 0  # Reason as a number
JOINT = 1  # index in q of the joint of a fault, -1 if none
VALUE = 2  # position of that joint [rad or m]
NEAR_COUNT = 3  # near pairs that follow
NEAREST = 4  # which near pair has the least headroom, -1 if none
PAIRS_TESTED = 5  # exact distances computed in this cycle
PAIRS_KEPT = 6  # near pairs whose row was copied because neither side moved
PAIRS_FILTERED = 7  # pairs sharing a leaf whose bounding boxes are beyond the margin
BODIES_MOVED = 8  # bodies whose pose differs from the last cycle's
LINKS_CHECKED = 9  # moved bodies with primitives: each checks the index once
CHANGED_LEAF = 10  # moved bodies that entered or left a leaf
LEAVES_ENTERED = 11
LEAVES_LEFT = 12
SPLITS = 13
MERGES = 14
PAIRS_REFINED = 15  # pairs of links whose exact shapes were measured
PAIRS_APART = 16  # pairs that a stored plane proves to be beyond the margin
ROBOT = 17  # index of the robot of a fault, -1 if none
LEAST_TIME_LEFT = (
    18  # least time until a stop must be ordered, up to the look-ahead [s]
)
SPANS_TESTED = 19  # spans of time that were tested to prove pairs
TERMS = 20  # required separation of the nearest pair, the fields of `Budget` [m]
TERM_NAMES = tuple(field.name for field in fields(Budget))
TERM_COUNT = len(TERM_NAMES)
HEADER = TERMS + TERM_COUNT

# The header is followed by a row per robot, if one has a mode other than "fixed".
ROBOT_LEVEL = 0
ROBOT_PHASE = 1
ROBOT_SCALE = 2  # speed scale in [0, 1]
ROBOT_AGE = 3  # age of its measurement [s]
ROBOT_CAUSE = 4  # Reason of its last order to stop
ROBOT_URGENCY = 5  # urgency of its cues, in [0, 1]
ROBOT_TIME = 6  # least time to contact of its near pairs [s]
ROBOT_FORCE = 7  # force on its tool, away from near bodies, 3 numbers [N]
ROBOT_TORQUE = 10  # torque of that force about the tool's origin, 3 numbers [N m]
ROBOT_TOOL = 13  # motion of its tool in the escape direction, 3 numbers [m/rad]
ROBOT_DELAY = 16  # least delay that explains how its drives follow commands [s]
ROBOT_WIDTH = 17

# The robots' rows are followed by the escape directions in joint space, a unit vector
# for each robot, n numbers.

# Indices in the row of a near pair.
FIRST = 0  # primitive index of A
SECOND = 1  # primitive index of B
HEADROOM = 2  # distance minus required separation [m]
BUFFER = 3  # distance to keep at all times [m]
OUTER = 4  # signed distance of the two primitives [m]
EXACT = 5  # signed distance of the exact shapes [m]; infinite where not measured
TIME_LEFT = 6  # time the present motion may continue before a stop is ordered [s]
TIME_TO_CONTACT = 7  # lower bound of the time to contact, for any operator input [s]
PROOF = 8  # result of the proof of its stop, see `pair_state`
ENVELOPE = 9  # distance in the witness row minus that of the judged shapes, >= 0 [m]
WITNESS = 10  # witness row: distance, point_a(3), point_b(3), normal(3)
NEAR_WIDTH = 20
