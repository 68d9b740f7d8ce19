"""What describes a pair while its proof is sought, and how that ends."""

# How a proof ends.
PROVEN = 0
NEEDED = 1  # as far as the bound can tell, some admissible motion breaks the distance
UNSURE = 2  # the bound is too coarse to tell
SPENT = 3  # the cycle's budget of tests is used up
ALLOWED = 4  # a contract is kept that lets the pair be nearer
EXCEEDED = 5  # neither that nor its distance
UNPROVEN = 6  # a robot leaves what comes by itself: it may be met on its way

# Places in the description of a pair: two sides of SIDE numbers, then the requirement.
KIND = 0  # ShapeKind
ROW = 1  # address of the row in the world as measured
LOCAL = 2  # address of the row in the body's frame, or in the world
BODY = 3  # its body, -1 if it stands still
PLAN = 4  # NEXT or NOW, the stop of its robot
LEVERS = 5  # address of its levers
SIDE = 6
SHARED = 12  # joints that move both sides alike
NEED = 13  # distance to keep now [m]
DRIFT = 14  # speed at which that grows [m/s]
PAIR = 15
