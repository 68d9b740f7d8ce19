"""Steady headroom of near pairs: filtered against errors of measurement.

The headroom of a pair varies from cycle to cycle with the errors of positions and
velocities, and with the depth of its proof. A response that uses the larger values
closes the pair in every second cycle, until a smaller value ends in a stop. So the
least recent value counts: a smaller value applies at once and is forgotten slowly.
"""

from math import exp, isfinite

from armguard.guard.commands import time_passed
from armguard.guard.watch import Watch
from armguard.kernel import kernel
from armguard.respond.state import REMEMBERED, Response

# Time constant at which a smaller value is forgotten [s].
FORGETTING_TIME = 0.03

# Places at which a pair is looked for. Without a free one its headroom is unfiltered.
PROBES = 8

# Cycles for which a pair is remembered while it is not near: it may be far by error.
UNMET = 30

# Factor of the hash that spreads pairs over the places.
STRIDE = 31


@kernel
def steady_spare(i: int, j: int, left: float, a: Response, v: Watch) -> float:
    """Headroom of a near pair, not much above its recent minimum [m].

    Args:
        i: First primitive.
        j: Second primitive.
        left: Headroom in this cycle [m].
        a: Responses; `spares` and `spare_of` are written.
        v: Watch.
    """
    key, now = (i << 32) | j, v.sent_count[0]
    free = -1
    for k in range(PROBES):
        slot = (i * STRIDE + j + k) % REMEMBERED
        since = now - a.spare_of[slot].last_near
        known = 0 < since <= UNMET
        if known and a.spare_of[slot].key == key:
            kept = a.spares[slot]
            if isfinite(kept) and isfinite(left) and kept < left:
                part = 1.0 - exp(-since * time_passed(v) / FORGETTING_TIME)
                left = kept + part * (left - kept)
            free = slot
            break
        if free < 0 and not known and since != 0:
            free = slot
    if free >= 0:
        a.spare_of[free].key, a.spare_of[free].last_near = key, now
        a.spares[free] = left
    return left
