"""How far a primitive on a chain of joints reaches along a direction.

Every vertex is moved about the joints' axes by rotations; differences of that give the
second order, whose greatest value over the ranges has to be what the kernels find.
"""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Pose,
    Sphere,
)
from armguard.geometry.shapes import shape_row
from armguard.kernel import kernel
from armguard.motion.gap_bound import line_ranges, most_way
from armguard.motion.joint_rows import JointRow, SideMotion, joint_ranges, joint_rows
from armguard.motion.prepare import motion_of
from armguard.motion.side_reach import side_reach
from armguard.motion.state import Motion
from armguard.record import records
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from armguard.scene.compile import compile_scene
from armguard.table import Ledger, opener
from planar import chain_scene

open_motion = opener(Motion)

CHAINS = [(REVOLUTE,), (REVOLUTE, PRISMATIC), (REVOLUTE, PRISMATIC, REVOLUTE)]

# Error of differences, for lengths of a metre [m].
GRAIN = 1e-7

STATES = 20


def points():
    """Corners of a hull, large beside what joints move it, shape (40, 3) [m]."""
    rows = np.random.default_rng(3).normal(size=(40, 3))
    return np.array([0.5, 0.4, 0.3]) * rows / np.linalg.norm(rows, axis=1)[:, None]


def corners(half):
    """Corners of a box about the origin, shape (8, 3)."""
    return np.array(list(product((-1.0, 1.0), repeat=3))) * half


# A shape, vertices that hold it, its radius, and how far it reaches in a direction of
# its own frame if that is less than its vertices do.
SHAPES = {
    "sphere": (Sphere(radius=0.07), np.zeros((1, 3)), 0.07, None),
    "capsule": (
        Capsule(start=(-0.1, 0.0, 0.02), end=(0.12, 0.05, 0.0), radius=0.03),
        np.array([(-0.1, 0.0, 0.02), (0.12, 0.05, 0.0)]),
        0.03,
        None,
    ),
    "box": (
        Box(size=(0.2, 0.1, 0.06)),
        corners((0.1, 0.05, 0.03)),
        0.0,
        None,
    ),
    "hull": (Hull(points=points()), points(), 0.0, None),
    "cylinder": (
        Cylinder(radius=0.04, height=0.3),
        corners((0.04, 0.04, 0.15)),
        0.0,
        lambda d: 0.04 * np.hypot(d[0], d[1]) + 0.15 * abs(d[2]),
    ),
    "cone": (
        Cone(radius=0.05, height=0.2, top_radius=0.06),
        corners((0.06, 0.06, 0.1)),
        0.0,
        lambda d: max(
            0.05 * np.hypot(d[0], d[1]) - 0.1 * d[2],
            0.06 * np.hypot(d[0], d[1]) + 0.1 * d[2],
        ),
    ),
    "ellipsoid": (
        Ellipsoid(semi_axes=(0.1, 0.05, 0.03)),
        corners((0.1, 0.05, 0.03)),
        0.0,
        lambda d: np.linalg.norm(np.array([0.1, 0.05, 0.03]) * d),
    ),
}


@kernel(entry=True)
def reach_of_ranges(
    kind, row, n, axes, joint_kind, middle, width, levers, rows, chain, sizes, hessian
):
    count = len(joint_kind)
    joint_rows(n, chain, 0, count, axes, 0, joint_kind, rows)
    joint_ranges(chain, 0, count, middle, width, rows)
    most = most_way(chain, 0, count, levers, sizes)
    return side_reach(kind, row, SideMotion(n, False, most, 0, count, rows, hessian))


@kernel(entry=True)
def reach_of_line(
    kind, row, n, axes, joint_kind, way, width, levers, rows, chain, sizes, hessian
):
    count = len(joint_kind)
    joint_rows(n, chain, 0, count, axes, 0, joint_kind, rows)
    for k in range(count):
        rows[k].half_line, rows[k].width = way[k], width[k]
        rows[k].widening = 0.0
    most = most_way(chain, 0, count, levers, sizes)
    return side_reach(kind, row, SideMotion(n, True, most, 0, count, rows, hessian))


@kernel(entry=True)
def way_by_levers(chain, first, levers, sizes):
    return most_way(chain, first, len(chain), levers, sizes)


def scratch(way, width):
    """The chain of all joints, the sizes of their ways, and room for derivatives."""
    count = len(way)
    chain = np.arange(count, dtype=np.int32)
    return chain, np.abs(way) + width, np.zeros((count, 8 * count))


def moved(p, axes, kinds, delta):
    """Points p that the joints have moved by delta, the last joint first."""
    for axis, kind, angle in list(zip(axes, kinds, delta, strict=True))[::-1]:
        if kind == PRISMATIC:
            p = p + angle * axis[:3]
        else:
            turn = Rotation.from_rotvec(angle * axis[:3])
            p = turn.apply(p - axis[3:]) + axis[3:]
    return p


class Carried:
    """A shape on a chain of joints with random axes, and n·p of its vertices.

    Attributes:
        still: n·p of each vertex, shape (v,) [m].
        g: First derivatives, shape (v, joints).
        h: Second derivatives, shape (v, joints, joints).
    """

    def __init__(self, rng, name, kinds):
        shape, vertices, self.radius, self.support = SHAPES[name]
        self.count, self.kinds = len(kinds), np.array(kinds, dtype=np.int32)
        self.axes = rng.normal(size=(self.count, 6))
        self.axes[:, :3] /= np.linalg.norm(self.axes[:, :3], axis=1)[:, None]
        pose = Pose(xyz=tuple(rng.normal(size=3)), rpy=tuple(rng.normal(size=3)))
        T = pose.matrix()
        self.kind, self.row = int(shape.kind), shape_row(shape, T)
        self.n = rng.normal(size=3)
        self.n /= np.linalg.norm(self.n)
        self.points = vertices @ T[:3, :3].T + T[:3, 3]
        self.origin, self.own = self.n @ T[:3, 3], T[:3, :3].T @ self.n
        self.shape = shape
        self.differentiate()

    def differentiate(self, step=2e-4):
        """Central differences of n·p by the joints."""
        unit = step * np.eye(self.count)
        at = lambda d: moved(self.points, self.axes, self.kinds, d) @ self.n  # noqa: E731
        self.still = at(np.zeros(self.count))
        self.g = np.stack([(at(e) - at(-e)) / (2 * step) for e in unit], axis=-1)
        h = [
            [at(a + b) - at(a - b) - at(b - a) + at(-a - b) for b in unit] for a in unit
        ]
        self.h = np.moveaxis(np.array(h), -1, 0) / (4 * step**2)

    def greatest(self, middle, width):
        """How far each vertex gets in the ranges, to the second order, shape (v,)."""
        found = []
        for share in product((-1.0, 1.0), repeat=self.count):
            move = middle + width * np.array(share)
            bend = 0.5 * np.einsum("j,vjk,k->v", move, self.h, move)
            found.append(self.g @ move + bend)
        return np.max(found, axis=0)

    def is_monotone(self, middle, width):
        """Whether every joint has the same direction wherever the others are."""
        g = self.g + self.h @ middle
        return (np.abs(g) > 1.01 * np.abs(self.h) @ width + 1e-3).all()

    def total(self, ways):
        """Reach of the whole shape if its vertices get so far."""
        reach = (self.still + ways).max()
        if self.support is not None:
            reach = min(reach, self.origin + self.support(self.own) + ways.max())
        return self.radius + reach

    def levers(self):
        """Farthest a vertex is from each axis; 1 for a slide."""
        rows = []
        for axis, kind in zip(self.axes, self.kinds, strict=True):
            far = np.linalg.norm(np.cross(self.points - axis[3:], axis[:3]), axis=1)
            rows.append(1.0 if kind == PRISMATIC else far.max())
        return np.array(rows)

    def rows(self):
        """Scratch."""
        return records(self.count, JointRow)


def carried(name, kinds):
    """Random shapes on random chains, and a generator of numbers."""
    rng = np.random.default_rng(11)
    for _ in range(STATES):
        yield Carried(rng, name, kinds), rng


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kinds", CHAINS)
def test_a_shape_reaches_as_far_as_the_vertex_that_gets_farthest(name, kinds):
    exact = 0
    for one, rng in carried(name, kinds):
        for size in (0.2, 0.02, 0.002):
            middle = size * rng.normal(size=one.count)
            width = size * rng.uniform(0.1, 0.5, one.count)
            found = reach_of_ranges(
                one.kind, one.row, tuple(one.n), one.axes, one.kinds, middle, width,
                one.levers(), one.rows(), *scratch(middle, width),
            )  # fmt: skip
            known = one.total(one.greatest(middle, width))
            assert found[0] == found[1] >= known - GRAIN
            if one.is_monotone(middle, width):
                assert found[0] == pytest.approx(known, abs=GRAIN)
                exact += 1
    assert exact >= 5


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kinds", CHAINS)
def test_at_the_ends_of_a_line_it_does_so_too_and_in_between_by_its_bow(name, kinds):
    exact = 0
    for one, rng in carried(name, kinds):
        for size in (0.2, 0.02, 0.002):
            way = size * rng.normal(size=one.count)
            width = 0.3 * size * rng.uniform(0.1, 0.5, one.count)
            found = reach_of_line(
                one.kind, one.row, tuple(one.n), one.axes, one.kinds, way, width,
                one.levers(), one.rows(), *scratch(way, width),
            )  # fmt: skip
            bow = np.maximum(-0.5 * np.einsum("j,vjk,k->v", way, one.h, way), 0.0)
            for sign, end in zip((-1.0, 1.0), found, strict=True):
                known = one.total(one.greatest(sign * way, width) + bow)
                assert end >= known - GRAIN
                if one.is_monotone(sign * way, width):
                    assert end == pytest.approx(known, abs=GRAIN)
                    exact += 1
    assert exact >= 5


@pytest.mark.parametrize("kinds", CHAINS)
def test_a_range_that_is_no_number_leaves_no_bound(kinds):
    one, rng = next(carried("sphere", kinds))
    way = 0.02 * rng.normal(size=one.count)
    for joint in range(one.count):
        width = np.where(np.arange(one.count) == joint, np.nan, 0.01)
        for reach in (reach_of_ranges, reach_of_line):
            found = reach(
                one.kind, one.row, tuple(one.n), one.axes, one.kinds, way, width,
                one.levers(), one.rows(), *scratch(way, width),
            )  # fmt: skip
            assert np.isnan(found).all()


# By how much a coordinate is off its normal's, and how far a half-space reaches [m].
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("off", "known"),
    [(0.0, 0.41), (0.9e-15, 0.41), (1.1e-15, np.inf), (1e-6, np.inf), (2.0, np.inf)],
)
def test_a_half_space_reaches_only_against_its_own_normal(axis, off, known):
    angle = np.arctan2(0.6, 0.8)
    T = Pose(xyz=(0.1, 0.2, 0.3), rpy=(-angle, 0.0, 0.0)).matrix()
    shape = HalfSpace(rounding=0.05)
    none = np.zeros(0)
    for sign in (-1.0, 1.0):
        n = T[:3, 2].copy()
        n[axis] += sign * off
        found = reach_of_ranges(
            int(shape.kind), shape_row(shape, T), tuple(n), np.zeros((0, 6)),
            np.zeros(0, dtype=np.int32), none, none, none, records(0, JointRow),
            *scratch(none, none),
        )  # fmt: skip
        assert found[0] == pytest.approx(known)


def test_the_way_by_levers_is_their_sum():
    chain, sizes = np.array([3, 0, 2], dtype=np.int32), np.array([0.2, 9.0, 0.4, 0.1])
    levers = np.array([0.5, 0.3, 0.7])
    assert way_by_levers(chain, 0, levers, sizes) == pytest.approx(0.05 + 0.06 + 0.28)
    assert way_by_levers(chain, 1, levers, sizes) == pytest.approx(0.06 + 0.28)


@kernel(entry=True)
def write_ranges(chain, first, at, box, motion):
    line_ranges(chain, first, len(chain), at, box, open_motion(motion))


def position(u, s, way, wide, grow):
    """A joint's position in a span."""
    return u * way + s * (wide + u * grow)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_box_of_a_span_has_its_part_of_the_line_and_of_the_ranges(sign):
    rng = np.random.default_rng(5)
    scene = chain_scene(("turn", "slide", "turn"), (3.0, 0.0))
    m, at, box = motion_of(compile_scene(scene), budget=1), 5, 2
    ledger = Ledger(m)
    body = int(np.argmax(m.length))
    chain = np.ascontiguousarray(m.joints[body, : m.length[body]])
    for _ in range(20):
        m.node_way[at] = sign * rng.uniform(0.1, 1.0, len(m.parent))
        m.node_wide[at] = rng.uniform(0.5, 1.0, len(m.parent))
        m.node_grow[at] = 0.5 * rng.uniform(-1.0, 1.0, len(m.parent))
        m.box_place[box] = rng.uniform(-0.5, 0.5, len(m.parent))
        m.box_part[box] = rng.uniform(0.1, 0.5, len(m.parent))
        m.box_line[box] = rng.uniform(-0.5, 0.5), rng.uniform(0.1, 0.5)
        write_ranges(chain, 0, at, box, ledger.lines.ctypes.data)
        u, half = m.box_line[box].tolist()
        for k, b in enumerate(chain):
            own = m.node_way[at, b], m.node_wide[at, b], m.node_grow[at, b]
            s, part = m.box_place[box, b], m.box_part[box, b]
            still = position(u, s, *own)
            row = m.lever_rows[k]
            for v, t in product((-1.0, 0.3, 1.0), repeat=2):
                known = v * row.half_line + t * (row.width + v * row.widening)
                there = position(u + half * v, s + part * t, *own)
                assert there - still == pytest.approx(known)
            largest = abs(row.half_line) + row.width + abs(row.widening)
            assert m.sizes[b] == pytest.approx(largest)
