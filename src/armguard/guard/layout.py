"""Layout of the one array a cycle answers in, shared by kernel and verdict.

The answer of a cycle is a header of `HEADER` float64 followed by one row of
`NEAR_WIDTH` float64 for each near pair. One array, so that a verdict is one copy.
Whole numbers are exact in float64 up to 2⁵³.
"""

# Number of this layout, which recordings carry. Any change of a place below raises it:
# a recording of another layout is refused and not misread.
LAYOUT = 2

# Header places.
REASON = 0  # Reason as a number
JOINT = 1  # index in q of the joint a fault is about, -1 if none
VALUE = 2  # position of that joint [rad or m]
NEAR_COUNT = 3  # near pairs that follow
NEAREST = 4  # which near pair has the least clearance, -1 if none
PAIRS_TESTED = 5  # exact distances computed in this cycle
PAIRS_KEPT = 6  # near pairs taken over because neither side moved
PAIRS_FILTERED = 7  # pairs sharing a leaf whose bounding boxes are beyond the margin
BODIES_MOVED = 8  # bodies whose pose differs from the last cycle's
LINKS_CHECKED = 9  # moved bodies with primitives: each checks the index once
CHANGED_LEAF = 10  # moved bodies that entered or left a leaf
LEAVES_ENTERED = 11
LEAVES_LEFT = 12
SPLITS = 13
MERGES = 14
PAIRS_REFINED = 15  # pairs of links whose exact shapes were measured
PAIRS_APART = 16  # pairs a remembered plane proves to be beyond the margin
ROBOT = 17  # robot a fault is about, -1 if none
SLACK_TIME = 18  # least time until a stop must be ordered, as far as it was looked [s]
SPANS_TESTED = 19  # spans of time that were tested to prove pairs
TERMS = 20  # what the nearest pair must keep, and why: TERM_COUNT numbers [m]
TERM_COUNT = 12
HEADER = 32

# Places among the terms of the nearest pair.
TERM_FLOOR = 0  # what the scene asks for at rest
TERM_MODEL = 1
TERM_BASE = 2
TERM_OBJECT = 3  # what an object may come nearer meanwhile
TERM_ERROR = 4  # of measured positions, both sides
TERM_REACTION_A = 5
TERM_STOPPING_A = 6
TERM_REACTION_B = 7
TERM_STOPPING_B = 8
TERM_ENVELOPE = 9  # by how much the judged shapes are nearer than the reported ones
TERM_PATH = 10  # what the bend of the path adds, or its course saves
TERM_NEEDED = 11  # their sum

# Then a row for each robot, where one has a mode other than "fixed".
ROBOT_LEVEL = 0
ROBOT_PHASE = 1
ROBOT_SCALE = 2  # speed scale in [0, 1]
ROBOT_AGE = 3  # [s]
ROBOT_CAUSE = 4  # Reason of its last order to stop
ROBOT_URGENCY = 5  # of its cues, in [0, 1]
ROBOT_TIME = 6  # least time to contact of its near pairs [s]
ROBOT_FORCE = 7  # on its tool, away from what is near, 3 numbers [N]
ROBOT_TORQUE = 10  # the same about its tool's origin, 3 numbers [N m]
ROBOT_TOOL = 13  # where its tool goes on the way out, 3 numbers [m/rad]
ROBOT_DELAY = 16  # least delay that explains how its drives follow commands [s]
ROBOT_WIDTH = 17

# Then the joint motion that leads away, a unit vector for each robot, n numbers.

# Places in the row of a near pair.
FIRST = 0  # primitive index of A
SECOND = 1  # primitive index of B
CLEARANCE = 2  # what is left of the distance, beyond what the pair needs [m]
BUFFER = 3  # distance to keep at all times [m]
OUTER = 4  # signed distance of the two primitives [m]
EXACT = 5  # signed distance of the exact shapes [m]; infinite where not measured
TIME_LEFT = 6  # how long the present motion may go on before a stop [s]
TIME_TO_CONTACT = 7  # no contact before that, whatever the operators do [s]
PROOF = 8  # how the proof of its stop ended
ENVELOPE = 9  # distance in the witness row minus that of the judged shapes, >= 0 [m]
WITNESS = 10  # then the witness row: distance, point_a(3), point_b(3), normal(3)
NEAR_WIDTH = 20
