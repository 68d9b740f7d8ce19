"""Points on segments."""

from armguard.geometry.vec3 import Vec3, along, dot, sub
from armguard.kernel import kernel

# Squared sine of the angle below which segments count as parallel [-]. Relative to
# |u|²|v|², so that a 1 cm finger and a 1 m link are judged alike.
PARALLEL_SIN2 = 1e-15

# Squared length below which a segment is a point: its inverse is still finite [m²].
POINT = 1e-300


@kernel
def clamp01(x: float) -> float:
    """X, kept within [0, 1]; NaN stays NaN."""
    if x < 0.0:
        return 0.0
    if x > 1.0:
        return 1.0
    return x


@kernel
def closest_on_segment(p: Vec3, a: Vec3, u: Vec3) -> float:
    """Parameter t in [0, 1] of the point of a + t·u nearest to p."""
    uu = dot(u, u)
    if uu > 0.0:
        return float(clamp01(dot(sub(p, a), u) / uu))
    return 0.0


@kernel
def closest_on_segments(a0: Vec3, u: Vec3, b0: Vec3, v: Vec3) -> tuple[float, float]:
    """Parameters s, t in [0, 1] of the closest points of a0 + s·u and b0 + t·v.

    Where the segments are parallel the answer is not unique; then the one nearest to
    the starts is taken.

    References:
        Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    w = sub(a0, b0)
    uu, vv, uv = dot(u, u), dot(v, v), dot(u, v)
    uw, vw = dot(u, w), dot(v, w)

    # Divisions take long and wait for nothing: they are begun first.
    per_uu = 1.0 / uu if uu > POINT else 0.0
    per_vv = 1.0 / vv if vv > POINT else 0.0
    s = 0.0
    det = uu * vv - uv * uv
    if det > PARALLEL_SIN2 * uu * vv:
        s = clamp01((uv * vw - vv * uw) / det)
    t = clamp01((uv * s + vw) * per_vv)
    s = clamp01((uv * t - uw) * per_uu)
    # One more turn: near-parallel segments lose digits in det, not here.
    t = clamp01(dot(v, sub(along(a0, s, u), b0)) * per_vv)
    return s, t
