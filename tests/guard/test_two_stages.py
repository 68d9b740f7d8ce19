"""Primitives first, exact shapes where those would bind."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from armguard.geometry import Hull, Pose, Sphere
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import Level, Reason
from armguard.guard.body_distance import body_distance
from armguard.guard.proofs import describe_pair, look_at_exact, prove_exact
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import new_pair
from armguard.motion.state import NEXT
from armguard.respond import Guard
from armguard.robot.fitting import fit_robot
from armguard.robot.fitting.exact import hull_faces
from armguard.robot.fitting.proof import uncovered
from armguard.robot.kinematics import kinematic_table
from armguard.robot.model import CollisionElement, Link, MeshFile
from armguard.scene import Scene, bay_scene
from arms import link_pose
from sliding import APART, EXACT, RADIUS, slide


@pytest.fixture(scope="module")
def scene():
    scene = Scene(mode="fixed")
    scene.add_robot("panda", name="left", base=Pose(xyz=(0, 0.3, 0)))
    scene.add_robot("panda", name="right", base=Pose(xyz=(0, -0.3, 0)))
    return scene


@pytest.fixture(scope="module")
def guard(scene):
    return Guard(scene)


def inwards(guard, turn):
    q = guard.home
    q[0] -= turn
    q[8] += turn
    return q


def test_the_exact_shapes_let_pass_what_primitives_would_stop(guard):
    verdict = guard.step(inwards(guard, 0.7))
    near = verdict.nearest
    assert verdict.level is Level.CAUTION
    assert near.primitive_distance < near.buffer < near.exact_distance
    assert near.distance == near.exact_distance
    assert near.headroom == near.distance - near.buffer
    assert 0.0 < near.model_error < 1e-3  # the panda's meshes are nearly convex
    assert "hulls of the second stage" in near.explain()
    assert verdict.counts.pairs_refined >= 1
    assert np.linalg.norm(near.normal) == pytest.approx(1.0, abs=1e-12)
    gap = near.point_b - near.point_a - near.distance * near.normal
    assert np.abs(gap).max() < 1e-12


def test_the_distance_is_the_larger_of_both_and_computed_only_in_need(guard):
    refined = 0
    for turn in np.linspace(0.4, 1.4, 41):
        for near in guard.step(inwards(guard, turn)).near:
            if near.primitive_distance >= near.buffer:
                assert near.exact_distance is None
                assert near.distance == near.primitive_distance
            elif near.exact_distance is not None:
                refined += 1
                wanted = max(near.primitive_distance, near.exact_distance)
                assert near.distance == wanted
    assert refined > 100


def world_vertices(guard, scene, q, body):
    """Vertices of a link's hull in the world, by matrices."""
    robot, link = body.split("/")
    placed = scene.robots[robot]
    table = kinematic_table(placed.model)
    names = [n.removeprefix(robot + "/") for n in guard.q_names if n.startswith(robot)]
    values = [
        v for n, v in zip(guard.q_names, q, strict=True) if n.startswith(robot + "/")
    ]
    T = link_pose(placed.model, dict(zip(names, values, strict=True)), link)
    assert table.body_of_link[link] >= 0
    (hull,) = placed.fits[link].exact
    points = hull.shape.vertices @ hull.pose.matrix()[:3, :3].T
    points = points + hull.pose.matrix()[:3, 3]
    T = placed.base.matrix() @ T
    return points @ T[:3, :3].T + T[:3, 3]


def test_the_exact_distance_is_that_of_the_hulls(guard, scene):
    """Proven pair by pair: no plane separates more, and both points are in the hulls.

    Overlapping, against the faces of the difference of all vertices.
    """
    checked, overlapping = set(), 0
    for turn in (0.71, 0.74, 0.78, 1.1):
        q = inwards(guard, turn)
        for near in guard.step(q).near:
            if near.exact_distance is None or (turn, near.a, near.b) in checked:
                continue
            if "finger" in near.a or "finger" in near.b:
                continue
            a, b = (world_vertices(guard, scene, q, body) for body in (near.a, near.b))
            if near.exact_distance < 0.0:
                if overlapping >= 3:
                    continue
                overlapping += 1
                faces = ConvexHull((b[:, None] - a[None]).reshape(-1, 3)).equations
                theirs = faces[:, 3].max()
            else:
                theirs = (b @ near.normal).min() - (a @ near.normal).max()
                for points, witness in ((a, near.point_a), (b, near.point_b)):
                    walls = ConvexHull(points).equations
                    assert (walls[:, :3] @ witness + walls[:, 3]).max() < 1e-9
            assert near.exact_distance == pytest.approx(theirs, abs=1e-9), near.why
            checked.add((turn, near.a, near.b))
    assert overlapping == 3
    assert len(checked) >= 6


def test_hulls_lie_in_their_primitives_where_the_model_says_so():
    from armguard.robot.named import find_named_robot
    from armguard.robot.urdf import load_urdf

    named = find_named_robot("panda")
    fits = fit_robot(load_urdf(named.urdf))
    proven = 0
    for fit in fits.values():
        for placed in fit.exact:
            if fit.contained and isinstance(placed.shape, Hull):
                T = placed.pose.matrix()
                faces = hull_faces(placed.shape) @ T[:3, :3].T + T[:3, 3]
                assert len(uncovered(faces, fit.shapes)) == 0
                proven += 1
    assert proven == 9


def test_what_is_exact_already_is_not_asked_again():
    guard = Guard(bay_scene())
    q = guard.home
    rng = np.random.default_rng(0)
    stops = 0
    for _ in range(300):
        q = rng.uniform(guard.tables.lower, guard.tables.upper)
        verdict = guard.step(q)
        stops += verdict.level is Level.STOP
        assert verdict.counts.pairs_refined == 0
        assert all(near.exact_distance is None for near in verdict.near)
    assert stops > 20


def test_distance_need_and_headroom_are_of_the_same_shapes():
    scene = Scene(buffer=0.005)
    scene.add_robot("panda", name="left", base=Pose(xyz=(0, 0.3, 0)))
    scene.add_robot("panda", name="right", base=Pose(xyz=(0, -0.3, 0)))
    guard = Guard(scene, self_test=False)
    rng = np.random.default_rng(5)
    low, high = guard.tables.lower, guard.tables.upper
    by_exact = by_primitives = nearest = 0
    for _ in range(300):
        q = inwards(guard, rng.uniform(0.4, 0.9)) + rng.uniform(-0.15, 0.15, len(low))
        q = np.clip(q, low, high)
        guard.reset()
        guard.step(q, 1.0, velocity=np.zeros_like(q))
        verdict = guard.step(q, 1.001, velocity=np.zeros_like(q))
        for pair in verdict.near:
            exact = -np.inf if pair.exact_distance is None else pair.exact_distance
            assert pair.distance == max(pair.primitive_distance, exact)
            assert pair.envelope >= 0.0
            assert pair.needed >= 0.0
            gap = pair.point_b - pair.point_a - pair.distance * pair.normal
            assert np.abs(gap).max() < 1e-12
            by_exact += pair.primitive_distance >= pair.buffer and exact > 0.0
            by_primitives += pair.envelope > 0.0
        if verdict.nearest is None:
            continue
        budget = verdict.budget
        terms = [getattr(budget, name) for name in budget.__slots__]
        assert sum(terms[:-1]) == pytest.approx(budget.needed, abs=1e-12)
        assert budget.needed == pytest.approx(verdict.nearest.needed, abs=1e-15)
        assert budget.envelope == verdict.nearest.envelope
        assert budget.needed >= budget.envelope
        nearest += 1
    assert min(by_exact, nearest) > 20
    assert by_primitives > 0


# Two pieces of a link, by their corners [m]: the first reaches farther along x.
POINTED = np.array([(-0.1, -0.1, -0.1), (0.1, 0, 0), (-0.1, 0.1, -0.1), (-0.1, 0, 0.1)])
PIECES = [POINTED, POINTED - [0.03, 0.02, 0.0]]

FLOOR, COMES, PERIOD, SETTLES = 0.005, 0.2, 1e-3, 0.5


@pytest.fixture(scope="module")
def pointed(tmp_path_factory):
    """A guard of a slide whose link is two meshes, and of a ball that may come."""
    elements = []
    for k, points in enumerate(PIECES):
        path = tmp_path_factory.mktemp("pieces") / f"piece{k}.stl"
        trimesh.convex.convex_hull(points).export(path)
        elements.append(
            CollisionElement(geometry=MeshFile(path=path), T_link_geometry=np.eye(4))
        )
    model = slide()
    link = Link(name="ball", collisions=tuple(elements))
    scene = Scene(buffer=FLOOR, margin=1.0, period=PERIOD)
    scene.add_robot(
        replace(model, links={**model.links, "ball": link}),
        name="left",
        stopping={**EXACT, "settle_time": SETTLES},
    )
    ball, pose = Sphere(radius=RADIUS), Pose(xyz=(APART, 0.0, 0.0))
    scene.add(ball, name="ball", pose=pose, top_speed=COMES)
    return Guard(scene, self_test=False)


def measured(guard, gap):
    """Verdict of a slide at rest whose first piece is this far from the ball [m]."""
    guard.reset()
    guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), 5.0)
    tip = POINTED[:, 0].max()
    return guard.step([APART - RADIUS - tip - gap], 5.0, velocity=[0.0], now=5.0)


@kernel(entry=True)
def left_of_exact(i, j, need, drift, lines):
    """What exact shapes have left, looked at once and span by span [m]."""
    w = open_workspace(lines)
    m, pair = w.motion, new_pair()
    pair.need, pair.drift = need, drift
    describe_pair(i, j, NEXT, NEXT, w, m, pair)
    once = look_at_exact(i, j, w, pair)
    describe_pair(i, j, NEXT, NEXT, w, m, pair)
    return once, prove_exact(i, j, w, pair)[1]


def test_exact_shapes_have_left_what_the_nearest_of_them_has(pointed):
    measured(pointed, 0.3)
    moving, lines = pointed.tables.moving_count, pointed._lines.ctypes.data
    # It is let go with two cycles of reserve.
    known = 0.3 - 0.1 - COMES * (SETTLES + 2.0 * PERIOD)
    for i in range(moving):
        found = left_of_exact(i, moving, 0.1, COMES, lines)
        assert found == pytest.approx((known, known), abs=1e-6)


def test_of_what_lacks_the_exact_shapes_lack_no_more_than_they_do(pointed):
    need = FLOOR + COMES * (SETTLES + 2.0 * PERIOD)
    for spare in (-1e-4, 1e-4):
        verdict = measured(pointed, need + spare)
        assert (verdict.reason is Reason.RESTING) == (spare < 0.0)
        assert verdict.nearest.headroom == pytest.approx(spare, abs=1e-6)


def test_two_bodies_are_as_far_apart_as_their_exact_shapes(pointed):
    verdict, moving = measured(pointed, 0.3), pointed.tables.moving_count
    assert verdict.nearest.distance < 0.299
    own, ball, out = (0, moving), (moving, moving + 1), np.zeros(WITNESS_WIDTH)
    for a, b in ((own, ball), (ball, own)):
        body_distance(*a, *b, pointed._lines, out)
        # Their files hold numbers of single precision.
        assert out[0] == pytest.approx(0.3, abs=1e-7)
