"""What near pairs have left, without the jumps that errors of measurement make in it.

What a pair has left falls and rises from cycle to cycle with the errors of positions
and velocities, and with how far its proof had to go. Whoever trusts the larger values
closes the pair in every second cycle, until a smaller one ends in a stop. So the least
of late counts: it is taken over at once, and forgotten slowly.
"""

from math import exp, isfinite

from armguard.guard.commands import time_passed
from armguard.guard.watch import Watch
from armguard.kernel import kernel
from armguard.respond.state import MET, PAIR_KEY, REMEMBERED, Response

# Time in which all but 1/e of a smaller value is forgotten [s].
FORGETTING_TIME = 0.03

# Places at which a pair is looked for. Whoever finds none is told as it is measured.
PROBES = 8

# Cycles a pair may be unmet in and still be remembered: it may be far by error only.
UNMET = 30

# Spreads pairs over the places.
STRIDE = 31


@kernel
def steady_spare(i: int, j: int, left: float, a: Response, v: Watch) -> float:
    """What a near pair has left, of late at least [m].

    Args:
        i: First primitive.
        j: Second primitive.
        left: What it has left in this cycle [m].
        a: Responses; `spares` and `spare_of` are written.
        v: Watch.
    """
    key, now = (i << 32) | j, v.sent_count[0]
    free = -1
    for k in range(PROBES):
        slot = (i * STRIDE + j + k) % REMEMBERED
        since = now - a.spare_of[slot, MET]
        known = 0 < since <= UNMET
        if known and a.spare_of[slot, PAIR_KEY] == key:
            kept = a.spares[slot]
            if isfinite(kept) and isfinite(left) and kept < left:
                part = 1.0 - exp(-since * time_passed(v) / FORGETTING_TIME)
                left = kept + part * (left - kept)
            free = slot
            break
        if free < 0 and not known and since != 0:
            free = slot
    if free >= 0:
        a.spare_of[free, PAIR_KEY], a.spare_of[free, MET] = key, now
        a.spares[free] = left
    return left
