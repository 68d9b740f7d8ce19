"""Two boxes, in the frame of the first: how far apart or how deep, and where."""

from math import inf

from armguard.geometry.box_frame import clamp_to_box
from armguard.geometry.segments import closest_on_segments
from armguard.geometry.vec3 import Vec3, add, along, cross, dot, norm, scaled, sub
from armguard.kernel import kernel

# Sine of the angle below which two edges span no plane [-]. The separation along any
# unit vector is a bound that holds, so leaving such an axis out costs accuracy only to
# second order of this angle.
PLANE_SIN = 1e-10

# Slack in "this edge pair may be the nearest", relative to the size of the pair [-].
# Too much of it costs time, never accuracy.
EDGE_SLACK = 1e-9

# Below this distance, relative to the size of the pair, the difference of two witness
# points is mostly round-off and the separating axis gives the normal [-].
TOUCHING = 1e-10


@kernel
def axis_of(k: int) -> Vec3:
    """Unit vector of axis k."""
    return (
        1.0 if k == 0 else 0.0,
        1.0 if k == 1 else 0.0,
        1.0 if k == 2 else 0.0,
    )


@kernel
def pick(k: int, e0: Vec3, e1: Vec3, e2: Vec3) -> Vec3:
    """The k-th of three vectors."""
    if k == 0:
        return e0
    return e1 if k == 1 else e2


@kernel
def reach(n: Vec3, h: Vec3, e0: Vec3, e1: Vec3, e2: Vec3) -> float:
    """How far a box about the origin extends along n."""
    return float(
        h[0] * abs(dot(n, e0)) + h[1] * abs(dot(n, e1)) + h[2] * abs(dot(n, e2))
    )


@kernel
def separation_along(
    n: Vec3, a: Vec3, b: Vec3, c: Vec3, e0: Vec3, e1: Vec3, e2: Vec3
) -> float:
    """Gap between the shadows of both boxes on ±n; negative if they overlap."""
    own = a[0] * abs(n[0]) + a[1] * abs(n[1]) + a[2] * abs(n[2])
    return float(abs(dot(n, c)) - own - reach(n, b, e0, e1, e2))


@kernel(inline=False)
def best_axis(
    a: Vec3, b: Vec3, c: Vec3, e0: Vec3, e1: Vec3, e2: Vec3
) -> tuple[float, Vec3, int]:
    """The widest gap among the fifteen axes that can separate two boxes.

    These are the face normals of the Minkowski difference, a zonotope of six
    generators; so where the boxes overlap, the widest (least negative) gap is exactly
    the penetration depth.

    Returns:
        Gap [m], unit axis from the first box to the second, 1 if it belongs to edges.
    """
    best = -inf
    normal = (0.0, 0.0, 1.0)
    from_edges = 0
    for k in range(3):
        n = axis_of(k)
        s = separation_along(n, a, b, c, e0, e1, e2)
        if not s <= best:
            best, normal = s, n
    for k in range(3):
        n = pick(k, e0, e1, e2)
        s = separation_along(n, a, b, c, e0, e1, e2)
        if not s <= best:
            best, normal = s, n
    for i in range(3):
        for j in range(3):
            n = cross(axis_of(i), pick(j, e0, e1, e2))
            length = norm(n)
            if length <= PLANE_SIN:
                continue
            n = scaled(1.0 / length, n)
            s = separation_along(n, a, b, c, e0, e1, e2)
            # An edge axis has to be better by more than rounding: faces first, so
            # that resting boxes keep the normal of the face.
            if not s <= best + 1e-15:
                best, normal = s, n
                from_edges = 1
    if dot(normal, c) < 0.0:
        normal = scaled(-1.0, normal)
    return best, normal, from_edges


@kernel(inline=False)
def nearest_vertex(
    a: Vec3, b: Vec3, c: Vec3, e0: Vec3, e1: Vec3, e2: Vec3
) -> tuple[float, Vec3, Vec3]:
    """Nearest of the sixteen vertices to the other box.

    Returns:
        Distance [m], point of the first box, point of the second.
    """
    best = inf
    on_a, on_b = (0.0, 0.0, 0.0), c
    for corner in range(8):
        sx = 1.0 if corner & 1 else -1.0
        sy = 1.0 if corner & 2 else -1.0
        sz = 1.0 if corner & 4 else -1.0
        y = along(along(along(c, sx * b[0], e0), sy * b[1], e1), sz * b[2], e2)
        x = clamp_to_box(y, a)
        d = norm(sub(y, x))
        if not d >= best:
            best, on_a, on_b = d, x, y
        x = (sx * a[0], sy * a[1], sz * a[2])
        w = sub(x, c)
        inside = clamp_to_box((dot(w, e0), dot(w, e1), dot(w, e2)), b)
        y = along(along(along(c, inside[0], e0), inside[1], e1), inside[2], e2)
        d = norm(sub(y, x))
        if not d >= best:
            best, on_a, on_b = d, x, y
    return best, on_a, on_b


@kernel(inline=False)
def nearest_edges(
    gap: float,
    slack: float,
    a: Vec3,
    b: Vec3,
    c: Vec3,
    axes: tuple[Vec3, Vec3, Vec3],
    vertex: tuple[float, Vec3, Vec3],
) -> tuple[float, Vec3, Vec3]:
    """Nearest pair of edges, where that beats the nearest vertex.

    If the nearest points lie inside two edges, the axis at right angles to both has
    the widest gap of all; and along it each box has one foremost edge of that
    direction. Where an axis of a box is at right angles to it too, both edges are
    equally foremost and both are tried.

    Args:
        gap: Widest gap of all axes [m].
        slack: How much narrower a gap may be to count as widest [m].
        a: Half extents of the first box.
        b: Half extents of the second.
        c: Centre of the second.
        axes: Axes of the second.
        vertex: Distance of the nearest vertex, and its points on both boxes.

    Returns:
        Least distance, and its points on both boxes [m].
    """
    (e0, e1, e2), (best, on_a, on_b) = axes, vertex
    for i in range(3):
        for j in range(3):
            u, v = axis_of(i), pick(j, e0, e1, e2)
            n = cross(u, v)
            length = norm(n)
            if length <= PLANE_SIN:
                continue
            n = scaled(1.0 / length, n)
            if separation_along(n, a, b, c, e0, e1, e2) < gap - slack:
                continue
            if dot(n, c) < 0.0:
                n = scaled(-1.0, n)
            tie = 1e-9 / length
            for choice in range(16):
                k1, k2 = (i + 1) % 3, (i + 2) % 3
                m1, m2 = (j + 1) % 3, (j + 2) % 3
                d1, d2 = dot(n, axis_of(k1)), dot(n, axis_of(k2))
                f1 = dot(n, pick(m1, e0, e1, e2))
                f2 = dot(n, pick(m2, e0, e1, e2))
                # Bit set: the other edge of a tie. Not a tie: nothing to choose.
                if (choice & 1 and abs(d1) > tie) or (choice & 2 and abs(d2) > tie):
                    continue
                if (choice & 4 and abs(f1) > tie) or (choice & 8 and abs(f2) > tie):
                    continue
                s1 = 1.0 if (d1 >= 0.0) != bool(choice & 1) else -1.0
                s2 = 1.0 if (d2 >= 0.0) != bool(choice & 2) else -1.0
                r1 = -1.0 if (f1 >= 0.0) != bool(choice & 4) else 1.0
                r2 = -1.0 if (f2 >= 0.0) != bool(choice & 8) else 1.0
                x0 = add(
                    scaled(-a[i], u),
                    add(
                        scaled(s1 * a[k1], axis_of(k1)),
                        scaled(s2 * a[k2], axis_of(k2)),
                    ),
                )
                y0 = along(c, -b[j], v)
                y0 = along(y0, r1 * b[m1], pick(m1, e0, e1, e2))
                y0 = along(y0, r2 * b[m2], pick(m2, e0, e1, e2))
                edge_a, edge_b = scaled(2.0 * a[i], u), scaled(2.0 * b[j], v)
                s, t = closest_on_segments(x0, edge_a, y0, edge_b)
                x, y = along(x0, s, edge_a), along(y0, t, edge_b)
                d = norm(sub(y, x))
                if not d >= best:
                    best, on_a, on_b = d, x, y
    return best, on_a, on_b


@kernel(inline=False)
def box_distance(
    a: Vec3, b: Vec3, c: Vec3, e0: Vec3, e1: Vec3, e2: Vec3
) -> tuple[float, Vec3, Vec3]:
    """Signed distance of two boxes, in the frame of the first.

    Args:
        a: Half extents of the first box [m].
        b: Half extents of the second [m].
        c: Centre of the second [m].
        e0: Axes of the second, unit vectors.
        e1: Second axis.
        e2: Third axis.

    Returns:
        Signed distance [m]; witness point on the first box [m]; unit normal from the
        first to the second. The other witness point is point + distance · normal.
    """
    size = norm(c) + norm(a) + norm(b)
    gap, normal, _ = best_axis(a, b, c, e0, e1, e2)
    if not gap > 0.0:
        # Overlap: move the second box out along the axis until it touches; the place
        # where it touches is the witness.
        out = along(c, -gap, normal)
        d, x, y = nearest_vertex(a, b, out, e0, e1, e2)
        if d > TOUCHING * size:
            d, x, y = nearest_edges(
                0.0, EDGE_SLACK * size, a, b, out, (e0, e1, e2), (d, x, y)
            )
        return gap, x, normal
    d, x, y = nearest_vertex(a, b, c, e0, e1, e2)
    if d > gap * (1.0 + 1e-15):
        d, x, y = nearest_edges(
            gap, EDGE_SLACK * size, a, b, c, (e0, e1, e2), (d, x, y)
        )
    if d > TOUCHING * size:
        normal = scaled(1.0 / d, sub(y, x))
    return d, x, normal
