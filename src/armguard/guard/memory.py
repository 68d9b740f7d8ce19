"""Places of the few numbers a guard carries from one cycle to the next."""

TOKEN = 0  # grows with every list of candidates, so that `seen` needs no clearing
KEPT_COUNT = 1  # near pairs of the last good cycle
FORCE = 2  # 1: nothing of the last cycle may be kept
CYCLE = 3  # grows with every cycle
MEMORY = 4
