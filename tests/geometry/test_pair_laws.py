"""Laws every pair kernel keeps, over the registry; hard cases drawn on purpose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armguard.geometry import (
    Box,
    Capsule,
    HalfSpace,
    Pose,
    ShapeKind,
    Sphere,
    distance,
)
from armguard.geometry.pairs import has_closed_form, measure
from armguard.geometry.pairs.convex_convex import convex_convex
from armguard.geometry.shapes import shape_row
from worlds import random_pose, random_shape

# Two half-spaces meet or face each other; neither leaves anything to these laws.
ALL_PAIRS = [
    (a, b) for a in ShapeKind for b in ShapeKind if not a == b == ShapeKind.HALF_SPACE
]
RANKED_PAIRS = [(a, b) for a, b in ALL_PAIRS if a <= b]

# What rounding may do to metre-sized shapes a metre apart [m]; witness points of
# crossing cores may be off by twice the crossing gap.
ATOL = 1e-9

# What the convex solver promises for pairs without a formula [m]; how near it comes is
# in docs/accuracy.md.
SOLVER_ATOL = 1e-7


def tolerance(kinds):
    """How exact a pair's distance has to be [m]."""
    return ATOL if has_closed_form(*kinds) else SOLVER_ATOL


def draw_pair(data, kinds):
    """Two shapes and poses: anywhere, concentric, aligned, touching or far away."""
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    size = data.draw(st.sampled_from([0.001, 0.05, 1.0]))
    shapes = [random_shape(rng, kind, size) for kind in kinds]
    poses = [random_pose(rng, 2.0 * size) for _ in kinds]
    case = data.draw(
        st.sampled_from(["free", "concentric", "parallel", "aligned", "touching"])
    )
    if case == "concentric":
        poses[1][:3, 3] = poses[0][:3, 3]
    if case in ("parallel", "aligned"):
        poses[1][:3, :3] = poses[0][:3, :3]
    if case == "aligned":
        poses[1][:3, 3] = poses[0][:3, 3] + poses[0][:3, 2] * rng.uniform(-2, 2) * size
    if case == "touching":
        near = distance(shapes[0], poses[0], shapes[1], poses[1])
        poses[1][:3, 3] -= near.distance * near.normal
    return shapes, poses


pairs = pytest.mark.parametrize(
    "kinds", ALL_PAIRS, ids=lambda k: f"{k[0].name}-{k[1].name}"
)
examples = settings(max_examples=25, deadline=None, derandomize=True)


@pairs
@given(data=st.data())
@examples
def test_witness_points_span_the_distance(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    near = distance(shapes[0], poses[0], shapes[1], poses[1])
    assert np.isfinite(near.distance)
    assert np.linalg.norm(near.normal) == pytest.approx(1.0, abs=1e-12)
    gap = near.point_b - near.point_a - near.distance * near.normal
    assert np.abs(gap).max() <= ATOL


@pairs
@given(data=st.data())
@examples
def test_swapping_the_pair_turns_the_normal_and_keeps_the_distance(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    one = distance(shapes[0], poses[0], shapes[1], poses[1])
    two = distance(shapes[1], poses[1], shapes[0], poses[0])
    assert one.distance == pytest.approx(two.distance, abs=tolerance(kinds))


@pairs
@given(data=st.data())
@examples
def test_moving_both_moves_the_answer(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    T[:3, 3] = (0.4, -0.2, 0.9)
    here = distance(shapes[0], poses[0], shapes[1], poses[1])
    there = distance(shapes[0], T @ poses[0], shapes[1], T @ poses[1])
    assert here.distance == pytest.approx(there.distance, abs=tolerance(kinds))


@pairs
@given(data=st.data())
@examples
def test_moving_b_out_along_the_normal_makes_them_touch(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    near = distance(shapes[0], poses[0], shapes[1], poses[1])
    poses[1][:3, 3] -= near.distance * near.normal
    touching = distance(shapes[0], poses[0], shapes[1], poses[1])
    assert touching.distance == pytest.approx(0.0, abs=4.0 * tolerance(kinds))


@pairs
@given(data=st.data())
@examples
def test_distance_changes_no_faster_than_the_shapes_move(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    here = distance(shapes[0], poses[0], shapes[1], poses[1])
    step = data.draw(st.sampled_from([1e-7, 1e-4, 0.05]))
    rng = np.random.default_rng(0)
    move = rng.normal(size=3)
    poses[1][:3, 3] += step * move / np.linalg.norm(move)
    there = distance(shapes[0], poses[0], shapes[1], poses[1])
    assert abs(there.distance - here.distance) <= step + tolerance(kinds)


@pairs
@given(data=st.data())
@examples
def test_growing_a_radius_shrinks_the_distance_by_as_much(kinds, data):
    shapes, poses = draw_pair(data, kinds)
    here = distance(shapes[0], poses[0], shapes[1], poses[1])
    grown = replace(shapes[0], rounding=shapes[0].rounding + 0.01)
    there = distance(grown, poses[0], shapes[1], poses[1])
    assert here.distance - there.distance == pytest.approx(0.01, abs=tolerance(kinds))


@pairs
def test_a_nan_anywhere_in_a_row_gives_a_nan_distance(kinds):
    rng = np.random.default_rng(3)
    rows = [shape_row(random_shape(rng, k, 0.3), random_pose(rng)) for k in kinds]
    out = np.zeros(10)
    for side in (0, 1):
        for place in places_in_use(kinds[side]):
            broken = [row.copy() for row in rows]
            broken[side][place] = np.nan
            measure(int(kinds[0]), broken[0], int(kinds[1]), broken[1], out)
            assert np.isnan(out[0]), (side, place)


def places_in_use(kind):
    """Places of a row that hold numbers of this kind; addresses never leave a shape."""
    if kind in (ShapeKind.HULL, ShapeKind.SUPPORT):
        return [0, 1, 2, 3, *range(7, 16)]
    short = {
        ShapeKind.SPHERE: 4,
        ShapeKind.CAPSULE: 7,
        ShapeKind.TRIANGLE: 10,
        ShapeKind.HALF_SPACE: 7,
    }
    return range(short.get(kind, 16))


def test_the_solver_agrees_with_every_closed_form():
    """Formula and solver share no code beyond the support functions."""
    rng = np.random.default_rng(8)
    ours, theirs = np.zeros(10), np.zeros(10)
    for a, b in RANKED_PAIRS:
        if not has_closed_form(a, b) or ShapeKind.HALF_SPACE in (a, b):
            continue
        for _ in range(300):
            rows = [
                shape_row(random_shape(rng, k, 0.4), random_pose(rng, 0.4))
                for k in (a, b)
            ]
            measure(int(a), rows[0], int(b), rows[1], ours)
            convex_convex(int(a), rows[0], int(b), rows[1], theirs)
            assert ours[0] == pytest.approx(theirs[0], abs=ATOL), (a, b)


def test_two_half_spaces_face_each_other_or_nothing_separates_them():
    up, down = Pose(xyz=(0, 0, -0.3)), Pose(xyz=(0, 0, 0.2), rpy=(np.pi, 0, 0))
    near = distance(HalfSpace(), up, HalfSpace(), down)
    assert near.distance == pytest.approx(0.5)
    assert near.normal == pytest.approx([0, 0, 1])
    near = distance(HalfSpace(), up, HalfSpace(), Pose(rpy=(0.1, 0, 0)))
    assert near.distance == -np.inf
    assert np.linalg.norm(near.normal) == pytest.approx(1.0)


def test_a_capsule_without_length_is_a_sphere():
    rng = np.random.default_rng(5)
    for kind in ShapeKind:
        for _ in range(200):
            other, T = random_shape(rng, kind, 0.4), random_pose(rng)
            at = random_pose(rng)
            ball = Sphere(radius=0.07)
            stub = Capsule(start=(0, 0, 0), end=(0, 0, 0), radius=0.07)
            one, two = distance(ball, at, other, T), distance(stub, at, other, T)
            assert one.distance == pytest.approx(two.distance, abs=ATOL)


def test_known_failures_of_others_are_not_ours():
    """Cases on which other libraries err; see their trackers."""
    # MuJoCo: the axis of a capsule through a box was "apart".
    rod = Capsule(start=(0, 0, -0.5), end=(0, 0, 0.5), radius=0.02)
    block = Box(size=(0.2, 0.2, 0.2))
    assert distance(rod, Pose(), block, Pose()).distance == pytest.approx(-0.12)
    # FCL 508: axis-aligned boxes, 3.162 instead of 3.
    a, b = Box(size=(2, 2, 2)), Box(size=(1.0, 1.0, 1.0))
    near = distance(a, Pose(), b, Pose(xyz=(4.5, 0.9, 0)))
    assert near.distance == pytest.approx(3.0, abs=1e-12)
    # FCL 293: centre of a sphere on the face of a box.
    near = distance(Sphere(radius=0.1), Pose(xyz=(0.1, 0, 0)), block, Pose())
    assert near.distance == pytest.approx(-0.1, abs=1e-12)
    assert np.isfinite(near.point_a).all()
    # Coal: crossing axes, zero normal.
    cross = Capsule(start=(-0.5, 0, 0), end=(0.5, 0, 0), radius=0.02)
    near = distance(rod, Pose(), cross, Pose())
    assert np.abs(near.normal) == pytest.approx([0, 1, 0], abs=1e-12)
    assert near.distance == pytest.approx(-0.04, abs=1e-12)


@pytest.mark.parametrize("offset", [1e3, 1e5])
def test_far_from_the_origin_only_the_coordinates_round(offset):
    rng = np.random.default_rng(11)
    for kinds in RANKED_PAIRS:
        for _ in range(50):
            shapes = [random_shape(rng, k, 0.4) for k in kinds]
            poses = [random_pose(rng) for _ in kinds]
            here = distance(shapes[0], poses[0], shapes[1], poses[1]).distance
            for T in poses:
                T[:3, 3] += offset
            there = distance(shapes[0], poses[0], shapes[1], poses[1]).distance
            assert there == pytest.approx(here, abs=offset * 1e-14 + 1e-9)
