"""Pairs of shapes where distance code breaks, each by its number; and measured."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from armguard.geometry import (
    SHAPES,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    ShapeKind,
    Sphere,
    Triangle,
)
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row
from arrays import Floats


def measured(pair: Any) -> Floats:
    """Witness row of one pair, shape (10,)."""
    out = np.zeros(10)
    a, b = pair.shape_a, pair.shape_b
    measure(
        int(a.kind), shape_row(a, pair.T_a), int(b.kind), shape_row(b, pair.T_b), out
    )
    return out


def measure_all(
    kind_a: int, rows_a: Floats, kind_b: int, rows_b: Floats
) -> tuple[Floats, Floats]:
    """Witness rows, shape (n, 10), and seconds of each call, shape (n,)."""
    out = np.zeros((len(rows_a), 10))
    seconds = np.zeros(len(rows_a))
    for k in range(len(rows_a)):
        begin = perf_counter()
        measure(int(kind_a), rows_a[k], int(kind_b), rows_b[k], out[k])
        seconds[k] = perf_counter() - begin
    return out, seconds


Rng = np.random.Generator

# Ratio of the thinnest size to the others, by form [-].
THIN = {"any": 1.0, "flat": 1e-6, "needle": 1e-4}

PAGE = Path(__file__).parents[2] / "docs" / "adding-a-shape.md"


def superellipsoid() -> Any:
    """The class of docs/adding-a-shape.md: a shape known by its support alone."""
    if "Superellipsoid" not in SHAPES:
        (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
        exec(compile(code, str(PAGE), "exec"), {"__name__": "adding_a_shape_page"})
    return SHAPES["Superellipsoid"]


@dataclass
class Pair:
    """Two shapes and their frames in the world.

    Attributes:
        shape_a: Shape A.
        T_a: Its frame, shape (4, 4).
        shape_b: Shape B.
        T_b: Its frame.
        hint: A direction in which the pair was drawn apart, if there is one.
    """

    shape_a: Any
    T_a: Floats
    shape_b: Any
    T_b: Floats
    hint: Floats | None = None


def turn(rng: Rng) -> Floats:
    """A random rotation, shape (3, 3)."""
    w, x, y, z = unit(rng, 4)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def unit(rng: Rng, count: int = 3) -> Floats:
    """A random direction."""
    v = rng.normal(size=count)
    return v / np.sqrt(v @ v)


def frame(R: Floats, p: Floats) -> Floats:
    """A transform."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = p
    return T


def draw_shape(rng: Rng, kind: ShapeKind, size: float, form: str = "any") -> Any:
    """A shape of about this size [m]; thin if the form says so."""
    thin = THIN[form]
    sizes = size * 10.0 ** rng.uniform(-1.0, 0.0, 3)
    axis = int(rng.integers(3))
    if form == "flat":
        sizes[axis] = thin * size
    elif form == "needle":
        sizes = np.full(3, thin * size)
        sizes[axis] = size
    rounding = float(rng.choice([0.0, min(0.1, 10 * thin) * size]))
    if kind == ShapeKind.SPHERE:
        return Sphere(radius=float(sizes[axis]))
    if kind == ShapeKind.CAPSULE:
        return draw_capsule(rng, size, thin)
    if kind == ShapeKind.BOX:
        return Box(size=tuple(2.0 * sizes), rounding=rounding)
    if kind == ShapeKind.TRIANGLE:
        return draw_triangle(rng, size, thin, rounding)
    if kind == ShapeKind.CYLINDER:
        return Cylinder(radius=sizes[0], height=2 * sizes[1], rounding=rounding)
    if kind == ShapeKind.CONE:
        top = float(rng.choice([0.0, sizes[2]]))
        return Cone(
            radius=sizes[0], height=2 * sizes[1], top_radius=top, rounding=rounding
        )
    if kind == ShapeKind.ELLIPSOID:
        return Ellipsoid(semi_axes=tuple(sizes), rounding=rounding)
    if kind == ShapeKind.HULL:
        return draw_hull(rng, sizes, rounding)
    if kind == ShapeKind.SUPPORT:
        return superellipsoid()(
            semi_axes=tuple(sizes), exponent=rng.uniform(1.5, 6.0), rounding=rounding
        )
    return HalfSpace(rounding=rounding)


def draw_capsule(rng: Rng, size: float, thin: float) -> Capsule:
    """A capsule about the origin or off it; one in twenty is a sphere."""
    along = unit(rng) * size * (rng.random() >= 0.05)
    middle = rng.choice([0.0, 0.3]) * size * unit(rng)
    return Capsule(
        start=tuple(middle - along),
        end=tuple(middle + along),
        radius=float(size * min(thin, 0.5) * rng.uniform(0.1, 1.0)),
    )


def draw_triangle(rng: Rng, size: float, thin: float, rounding: float) -> Triangle:
    """A triangle; slender if asked, one in twenty without area."""
    a, b, c = rng.uniform(-size, size, (3, 3))
    if thin < 1.0:
        c = a + rng.random() * (b - a) + thin * size * unit(rng)
    if rng.random() < 0.05:
        c = b
    return Triangle(a=tuple(a), b=tuple(b), c=tuple(c), rounding=rounding)


def draw_hull(rng: Rng, sizes: Floats, rounding: float) -> Hull:
    """Random points, a block, a prism, or points in a plane."""
    sort = int(rng.integers(6))
    if sort == 0:
        points = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    elif sort == 1:
        angles = np.arange(3 + int(rng.integers(10)))
        angles = 2 * np.pi * angles / len(angles)
        rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles - 1], axis=1)
        points = np.concatenate([rim, rim * (1, 1, -1)])
    else:
        points = rng.uniform(-1.0, 1.0, (int(rng.integers(1, 25)), 3))
        if sort == 2:
            points[:, 2] = 0.0
    return Hull(points=points * sizes, rounding=rounding)


def reach(shape: Any) -> float:
    """Radius about the frame's origin that holds the shape [m]; 0 for a half-space."""
    kind = shape.kind
    if kind in (ShapeKind.SPHERE, ShapeKind.HALF_SPACE):
        core = 0.0
    elif kind == ShapeKind.CAPSULE:
        core = max(np.linalg.norm(shape.start), np.linalg.norm(shape.end))
    elif kind == ShapeKind.TRIANGLE:
        core = max(np.linalg.norm(p) for p in (shape.a, shape.b, shape.c))
    elif kind == ShapeKind.BOX:
        core = np.linalg.norm(shape.half_extents)
    elif kind == ShapeKind.CYLINDER:
        core = np.hypot(shape.radius, shape.height / 2)
    elif kind == ShapeKind.CONE:
        core = np.hypot(max(shape.radius, shape.top_radius), shape.height / 2)
    elif kind == ShapeKind.HULL:
        core = np.linalg.norm(shape.vertices, axis=1).max()
    else:
        core = np.linalg.norm(shape.semi_axes)
    return float(core + shape.core_radius)


def scale(pair: Pair) -> float:
    """What errors are measured by: the largest size or the distance of centres [m]."""
    between = pair.T_b[:3, 3] - pair.T_a[:3, 3]
    apart = np.linalg.norm(between)
    if pair.shape_b.kind == ShapeKind.HALF_SPACE:
        apart = abs(between @ pair.T_b[:3, 2])
    return max(reach(pair.shape_a), reach(pair.shape_b), float(apart))


def placed(rng: Rng, a: Any, b: Any, nearness: float) -> Pair:
    """Shapes with a share of the sum of their reaches between their centres."""
    pair = Pair(a, frame(turn(rng), np.zeros(3)), b, frame(turn(rng), np.zeros(3)))
    way = unit(rng)
    if b.kind == ShapeKind.HALF_SPACE:
        way = -pair.T_b[:3, 2]
    pair.T_a[:3, 3] = 0.1 * reach(a) * unit(rng)
    pair.T_b[:3, 3] = pair.T_a[:3, 3] + nearness * (reach(a) + reach(b)) * way
    return pair


def moved_to(pair: Pair, gap: float, *, cores: bool = False) -> Pair:
    """The pair with B moved along the normal until there is this gap left [m]."""
    out = measured(pair)
    if cores:
        gap -= pair.shape_a.core_radius + pair.shape_b.core_radius
    normal = out[7:10]
    if np.isfinite(out).all():
        pair.T_b[:3, 3] -= (out[0] - gap) * normal
        pair.hint = normal
    return pair


def general(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """Sizes of 1 cm to 1 m, anywhere, apart or overlapping."""
    a, b = (draw_shape(rng, k, 10.0 ** rng.uniform(-1, 0)) for k in (kind_a, kind_b))
    return placed(rng, a, b, rng.uniform(0.0, 1.4))


def touching(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """Surfaces or cores within 1e-12 to 1e-6 of their size of each other."""
    a, b = (draw_shape(rng, k, 10.0 ** rng.uniform(-1, 0)) for k in (kind_a, kind_b))
    pair = placed(rng, a, b, 1.3)
    gap = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12, -6) * scale(pair)
    return moved_to(pair, gap, cores=bool(rng.integers(2)))


def aligned(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """Axes parallel or at right angles, faces in a plane, stacked or beside."""
    a, b = (draw_shape(rng, k, 10.0 ** rng.uniform(-1, 0)) for k in (kind_a, kind_b))
    pair = placed(rng, a, b, 0.0)
    if rng.integers(2):
        pair.T_a[:3, :3] = np.eye(3)
    order = rng.permutation(3)
    square = np.zeros((3, 3))
    square[order, np.arange(3)] = rng.choice([-1.0, 1.0], 3)
    square[:, 0] *= np.linalg.det(square)
    pair.T_b[:3, :3] = pair.T_a[:3, :3] @ (square if rng.integers(2) else np.eye(3))
    steps = rng.choice([0.0, 0.25, 0.5, 1.0, 1.5], 3) * rng.choice([-1.0, 1.0], 3)
    offset = steps * (reach(a) + reach(b)) * (rng.random(3) < 0.5)
    pair.T_b[:3, 3] = pair.T_a[:3, 3] + pair.T_a[:3, :3] @ offset
    if rng.integers(3) == 0:
        return moved_to(pair, 0.0, cores=True)
    return pair


def nested(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """One inside the other: identical, concentric, or a small one near the centre."""
    size = 10.0 ** rng.uniform(-1, 0)
    a = draw_shape(rng, kind_a, size)
    sort = int(rng.integers(4))
    b = draw_shape(rng, kind_b, size * (0.1 if sort == 3 else 1.0))
    if sort == 0 and kind_a == kind_b:
        b = replace(a)
    pair = placed(rng, a, b, 0.0)
    if sort < 2:
        pair.T_b = pair.T_a.copy()
    elif sort == 3:
        pair.T_b[:3, 3] += 0.2 * size * unit(rng)
    return pair


def thin(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind, form: str) -> Pair:
    """One or two thin shapes, anywhere or near each other."""
    forms = [(form, "any"), ("any", form), (form, form)][int(rng.integers(3))]
    a, b = (
        draw_shape(rng, k, 10.0 ** rng.uniform(-1, 0), f)
        for k, f in zip((kind_a, kind_b), forms, strict=True)
    )
    pair = placed(rng, a, b, rng.uniform(0.0, 1.2))
    if rng.integers(2):
        return pair
    least = min(reach(a), reach(b) or reach(a))
    return moved_to(pair, least * 10.0 ** rng.uniform(-6, 0) * rng.choice([-1, 1]))


def flat(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """One size of one or both is 1e-6 of the others."""
    return thin(rng, kind_a, kind_b, "flat")


def needle(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """One or both are 1e4 times as long as thick."""
    return thin(rng, kind_a, kind_b, "needle")


def mixed(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """Sizes of 1 mm to 100 m, the small one near the surface of the large one."""
    a, b = (draw_shape(rng, k, 10.0 ** rng.uniform(-3, 2)) for k in (kind_a, kind_b))
    pair = placed(rng, a, b, rng.uniform(0.5, 1.2))
    least = min(reach(a), reach(b) or reach(a))
    return moved_to(pair, least * rng.uniform(-1.0, 1.0))


def far(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """As general or aligned, 1 km from the origin."""
    pair = (general, aligned)[int(rng.integers(2))](rng, kind_a, kind_b)
    away = 1000.0 * unit(rng)
    pair.T_a[:3, 3] += away
    pair.T_b[:3, 3] += away
    return pair


def extreme(rng: Rng, kind_a: ShapeKind, kind_b: ShapeKind) -> Pair:
    """Both of about the same size, which is anything from 1e-9 to 1e6 m."""
    size = 10.0 ** rng.uniform(-9, 6)
    a, b = (
        draw_shape(rng, k, size * 10.0 ** rng.uniform(-1, 0)) for k in (kind_a, kind_b)
    )
    return placed(rng, a, b, rng.uniform(0.0, 1.4))


REGIMES: dict[str, Callable[[Rng, ShapeKind, ShapeKind], Pair]] = {
    "general": general,
    "touching": touching,
    "aligned": aligned,
    "nested": nested,
    "flat": flat,
    "needle": needle,
    "mixed": mixed,
    "far": far,
    "extreme": extreme,
}

KIND_PAIRS = [
    (a, b) for a in ShapeKind for b in ShapeKind if a <= b and a != ShapeKind.HALF_SPACE
]


def draw(kind_a: ShapeKind, kind_b: ShapeKind, regime: str, number: int) -> Pair:
    """The pair with this number; the same one at every call."""
    seed = (int(kind_a), int(kind_b), list(REGIMES).index(regime), number)
    return REGIMES[regime](np.random.default_rng(seed), kind_a, kind_b)
