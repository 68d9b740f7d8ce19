"""A kernel about readings of zones that links or modelled objects account for."""

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.vec3 import norm, sub
from armguard.kernel import kernel
from armguard.sense.reading import slack_of

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

BOX = int(ShapeKind.BOX)

# Overreach of a primitive from which on its edge is not that of its surface [m].
OVERREACH = 0.003

# Places in the figures of a view and of a mount.
FOCAL, MIDDLE, MERGE = 6, 8, 10
ORIGIN, SHIFT, TURN = 9, 12, 13


@kernel
def comes_near(
    box: Floats, slack: float, kinds: Ints, rows: Floats, balls: Floats, out: Floats
) -> bool:
    """Whether a box comes near to a primitive.

    Args:
        box: Row of the box, shape (16,).
        slack: How near, beside how far each may be from its place [m].
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: See `Placed`, shape (p, 5) [m].
        out: Scratch, shape (10,).
    """
    middle, radius = (box[1], box[2], box[3]), norm((box[4], box[5], box[6]))
    for i in range(kinds.shape[0]):
        limit = slack + balls[i, 4]
        apart = norm(sub((balls[i, 0], balls[i, 1], balls[i, 2]), middle))
        if apart > radius + balls[i, 3] + limit:
            continue
        measure(BOX, box, kinds[i], rows[i], out)
        if out[0] <= limit:
            return True
    return False


@kernel
def is_at_edge(
    i: int, j: int, depth: float, slack: float, merge: float, zones: Floats
) -> bool:
    """Whether a reading may be of two surfaces, or of one and what is not modelled.

    Args:
        i: Row of the zone.
        j: Its column.
        depth: The reading [m].
        slack: How far off it may be [m].
        merge: Depth within which surfaces merge [m].
        zones: Prediction of the zones, shape (rows, columns, 4).
    """
    near, far, over = zones[i, j, 0], zones[i, j, 1], zones[i, j, 3]
    for k in range(max(i - 1, 0), min(i + 2, zones.shape[0])):
        for n in range(max(j - 1, 0), min(j + 2, zones.shape[1])):
            near, far = min(near, zones[k, n, 0]), max(far, zones[k, n, 1])
            over = max(over, zones[k, n, 3])
    # A surface may end before the primitive that encloses it.
    ends = over > OVERREACH
    merged = near + merge if ends else min(far + slack, near + merge)
    if not (ends or far > near + slack):
        return False
    return bool(near - slack <= depth and depth <= merged)


@kernel(inline=False, entry=True)
def explain(
    depth: Floats, zones: Floats, view: Floats, mount: Floats, kinds: Ints,
    rows: Floats, balls: Floats, out: Bools,
) -> None:  # fmt: skip
    """Zones whose readings links or modelled objects account for.

    Args:
        depth: The readings, NaN for none, shape (rows, columns) [m].
        zones: What they have to be, see `Prediction`, shape (rows, columns, 4).
        view: See `View.figures`.
        mount: See `Mount.figures`.
        kinds: ShapeKind of each primitive, shape (p,).
        rows: Their rows, shape (p, 16).
        balls: See `Placed`, shape (p, 5) [m].
        out: The zones, overwritten, shape (rows, columns).
    """
    box = array_at(stack(16), (16,), np.float64)
    found = array_at(stack(10), (10,), np.float64)
    box[:] = 0.0
    for k in range(9):
        box[7 + k] = mount[k]
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            out[i, j] = False
            d = depth[i, j]
            if not d > 0.0:
                continue
            slack = slack_of(d, view) + mount[SHIFT] + mount[TURN] * d
            x = (j - view[MIDDLE]) / view[FOCAL] * d
            y = (i - view[MIDDLE + 1]) / view[FOCAL + 1] * d
            for k in range(3):
                turned = mount[3 * k] * x + mount[3 * k + 1] * y + mount[3 * k + 2] * d
                box[1 + k] = turned + mount[ORIGIN + k]
            box[4], box[5] = 0.5 * d / view[FOCAL], 0.5 * d / view[FOCAL + 1]
            near = comes_near(box, slack, kinds, rows, balls, found)
            out[i, j] = near or is_at_edge(i, j, d, slack, view[MERGE], zones)
