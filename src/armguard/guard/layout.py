"""Layout of the one array a cycle answers in, shared by kernel and verdict.

The answer of a cycle is a header of `HEADER` float64 followed by one row of
`NEAR_WIDTH` float64 for each near pair. One array, so that a verdict is one copy.
Whole numbers are exact in float64 up to 2⁵³.
"""

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
HEADER = 17

# Places in the row of a near pair.
FIRST = 0  # primitive index of A
SECOND = 1  # primitive index of B
CLEARANCE = 2  # signed distance minus buffer [m]
BUFFER = 3  # required distance [m]
OUTER = 4  # signed distance of the two primitives [m]
EXACT = 5  # signed distance of the exact shapes [m]; infinite where not measured
WITNESS = 6  # then the witness row: distance, point_a(3), point_b(3), normal(3)
NEAR_WIDTH = 16
