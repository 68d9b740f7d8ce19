"""How far a hull reaches beyond the mesh it holds: into its dents and between parts."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from armguard.kernel import kernel
from armguard.robot.fitting.overreach import triangle_distance2
from armguard.robot.fitting.proof import quartered

Floats = NDArray[np.float64]

# The bound is no larger than what was found by more than this share of it, or by this
# much, whichever is larger.
SHARE = 0.03
SLACK = 2e-4  # [m]

# Halvings, and pieces at a time, after which the bound is left as it is [-].
DEPTH = 12
PIECES = 20_000


def hull_reach(faces: Floats, triangles: Floats) -> float:
    """Bound on the distance of a hull's surface to the mesh it holds [m].

    Branch and bound. The distance to one triangle is convex, so over a piece of a face
    it is largest at a corner; the triangle for which that is least gives a bound. Where
    a face of the hull is a face of the mesh, that is 0 at once.

    Args:
        faces: Triangles of the hull's surface, shape (m, 3, 3) [m].
        triangles: Triangles of the mesh, shape (n, 3, 3) [m].
    """
    triangles = np.ascontiguousarray(triangles)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    left = np.ascontiguousarray(faces)
    found = 0.0
    for level in range(DEPTH + 1):
        bounds = np.zeros((len(left), 2))
        bound_pieces(left, triangles, low, high, bounds)
        found = max(found, float(bounds[:, 0].max(initial=0.0)))
        enough = found + max(SHARE * found, SLACK)
        open_ = bounds[:, 1] > enough
        if not open_.any():
            return enough if found > 0.0 else float(bounds[:, 1].max(initial=0.0))
        if level == DEPTH or 4 * int(open_.sum()) > PIECES:
            break
        left = quartered(left[open_])
    return float(bounds[:, 1].max())


@kernel(inline=False, entry=True)
def bound_pieces(
    pieces: Floats, triangles: Floats, low: Floats, high: Floats, bounds: Floats
) -> None:
    """Least and greatest the largest distance of a piece to the mesh can be.

    Args:
        pieces: Corners, shape (k, 3, 3) [m].
        triangles: Triangles of the mesh, shape (n, 3, 3) [m].
        low: Lower corners of their boxes, shape (n, 3) [m].
        high: Upper corners, shape (n, 3) [m].
        bounds: Overwritten, shape (k, 2) [m].
    """
    for k in range(pieces.shape[0]):
        at = np.full(3, np.inf)
        most = np.inf
        for t in range(triangles.shape[0]):
            reach = 0.0
            for c in range(3):
                x, y, z = pieces[k, c, 0], pieces[k, c, 1], pieces[k, c, 2]
                dx = max(low[t, 0] - x, 0.0, x - high[t, 0])
                dy = max(low[t, 1] - y, 0.0, y - high[t, 1])
                dz = max(low[t, 2] - z, 0.0, z - high[t, 2])
                apart = dx * dx + dy * dy + dz * dz
                if apart >= at[c] and apart >= most:
                    reach = np.inf
                    continue
                square = triangle_distance2(x, y, z, triangles[t])
                at[c] = min(at[c], square)
                reach = max(reach, square)
            most = min(most, reach)
        bounds[k, 0] = sqrt(max(at[0], at[1], at[2]))
        bounds[k, 1] = sqrt(most)
