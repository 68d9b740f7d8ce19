"""Where a segment is nearest to a box, in the box's own frame."""

from armguard.geometry.box_frame import clamp
from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel


@kernel
def slope(p: Vec3, u: Vec3, h: Vec3, t: float) -> float:
    """Half the derivative of the squared distance of p + t·u to the box."""
    x, y, z = p[0] + t * u[0], p[1] + t * u[1], p[2] + t * u[2]
    return float(
        u[0] * (x - clamp(x, h[0]))
        + u[1] * (y - clamp(y, h[1]))
        + u[2] * (z - clamp(z, h[2]))
    )


@kernel
def nearest_to_box(p: Vec3, u: Vec3, h: Vec3) -> float:
    """Parameter t in [0, 1] of the point of p + t·u nearest to a box.

    The squared distance to a convex set is convex along a line. For a box its
    derivative is continuous, never falls, and is linear between the six places where
    the line crosses the planes of the faces. So the root is bracketed by these places
    and found by one interpolation: exact, no iteration.

    Args:
        p: Start of the segment in the box's frame [m].
        u: End minus start [m].
        h: Half extents [m].

    Returns:
        t; where the segment lies in the box over a stretch, a place of that stretch.
    """
    low, high = 0.0, 1.0
    at_low = slope(p, u, h, 0.0)
    if at_low >= 0.0:
        return 0.0
    at_high = slope(p, u, h, 1.0)
    if at_high <= 0.0:
        return 1.0
    for k in range(3):
        if u[k] == 0.0:
            continue
        for side in range(2):
            plane = h[k] if side else -h[k]
            t = (plane - p[k]) / u[k]
            if low < t < high:
                g = slope(p, u, h, t)
                if g < 0.0:
                    low, at_low = t, g
                else:
                    high, at_high = t, g
    # NaN falls through to here and comes out as NaN.
    return low + (high - low) * (at_low / (at_low - at_high))
