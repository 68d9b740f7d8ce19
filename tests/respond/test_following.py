"""Followers of sensed surfaces: planar arms, and any arm along tangents."""

import numpy as np
import pytest

from armguard.errors import GoalError, SceneError, UnknownNameError
from armguard.geometry import Box, PlacedShape, Pose, Sphere
from armguard.respond import Changed, Guard
from armguard.respond.following import (
    PlanarArm,
    PlanarFollower,
    State,
    SurfaceFollower,
)
from armguard.respond.following.curve import TURN, Curve
from armguard.scene import Scene
from following_campaign import episode
from sensed import CELL, LOW, PERIOD, changes, feed, grid, sensed_guard

ARM = PlanarArm((0.6, 0.5), 0.05)
LONG = PlanarArm((0.5, 0.4), 0.05, travel=0.3)


@pytest.mark.parametrize("arm", [ARM, LONG])
def test_the_distance_of_a_planar_arm_is_that_of_points_on_its_links(arm):
    rng = np.random.default_rng(0)
    q = rng.uniform(-4.0, 4.0, (20, 3))[:, : 3 if arm.travel else 2]
    q[:, 2:] = rng.uniform(0.0, arm.travel, q[:, 2:].shape)
    points = rng.uniform(-1.3, 1.3, (30, 2))
    for row, found in zip(q, arm.distance(q, points), strict=True):
        share = np.linspace(0.0, 1.0, 4001)[:, None]
        elbow = arm.lengths[0] * np.array([np.cos(row[0]), np.sin(row[0])])
        second = arm.lengths[1] + row[2:].sum()
        along = np.array([np.cos(row[0] + row[1]), np.sin(row[0] + row[1])])
        line = np.concatenate([share * elbow, elbow + share * second * along])
        apart = np.linalg.norm(points[:, None] - line, axis=2).min(axis=1)
        assert found == pytest.approx(apart - arm.radius, abs=1e-4)


def ring(middle, radius):
    """Points of a circle."""
    turn = np.linspace(0.0, TURN, 200, endpoint=False)
    return middle + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


@pytest.mark.parametrize("way", [1, -1])
def test_a_closed_curve_divides_what_is_inside(way):
    """The obstacle is on the same side in either direction of the curve."""
    goals = np.array([[1.0, 1.0], [1.0 + TURN, 1.0], [1.4, 1.0]])
    line = ring((1.0, 1.0), 0.5)[::way]
    island = Curve(line, np.zeros(2), way)
    assert island.free_side(goals).tolist() == [False, True, False]
    assert island.closed and not island.around_arm
    room = Curve(line, np.zeros(2), -way)
    assert room.free_side(goals).tolist() == [True, False, True]
    assert room.around_arm


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("period", [(1, 0), (0, -1), (1, 1), (2, -1)])
def test_a_curve_around_the_torus_divides_what_is_on_either_side(period, way):
    """It winds about a line by 0.3 and goes back on a part of it."""
    vector = TURN * np.array(period)
    aside = np.array([-vector[1], vector[0]]) / np.linalg.norm(vector)
    share = np.linspace(0.0, 1.0, 200, endpoint=False)
    place = share + 0.1 * np.sin(6.0 * np.pi * share)
    line = place[:, None] * vector + 0.3 * np.sin(TURN * share)[:, None] * aside
    # The obstacle is aside of it, and to its left where it goes along the vector.
    curve = Curve(line[::way] + 1.0, way * vector, way)
    along = np.array([-8.2, -0.4, 0.1, 3.6])[:, None] * vector + 1.0
    assert not curve.free_side(along + 0.5 * aside).any()
    assert curve.free_side(along - 0.5 * aside).all()
    assert not curve.closed and not curve.around_arm


@pytest.mark.parametrize("arm", [ARM, LONG])
def test_a_goal_in_free_space_is_reached_straight_and_the_short_way(arm):
    q = np.array([3.0, 0.2, 0.1])[: 3 if arm.travel else 2]
    goal = np.array([-3.0, 1.0, 0.3])[: len(q)]
    follower = PlanarFollower(arm, q, goal)
    path = [q]
    while follower.state == State.TO_GOAL and len(path) < 1000:
        path.append(follower.step(path[-1], np.zeros((0, 2))))
    assert follower.state == State.ARRIVED and not follower.held
    assert path[-1] == pytest.approx(goal + np.array([TURN, 0.0, 0.0])[: len(q)])
    steps = np.diff([p[:2] for p in path], axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= 0.02 + 1e-9
    length = np.linalg.norm(steps, axis=1).sum()
    assert length == pytest.approx(np.hypot(TURN - 6.0, 0.8), abs=1e-6)


def test_a_goal_that_is_too_near_to_something_is_unreachable():
    """The tip at the goal is 100 mm from a point, and 130 mm when that is farther."""
    for gap, state in ((0.10, State.UNREACHABLE), (0.13, State.ARRIVED)):
        point = np.array([[1.1 + 0.05 + gap, 0.0]])
        follower = PlanarFollower(ARM, [1.5, 0.3], [0.0, 0.0])
        q, steps = np.array([1.5, 0.3]), 0
        while follower.state in (State.TO_GOAL, State.FOLLOWING) and steps < 5000:
            q, steps = follower.step(q, point), steps + 1
            assert ARM.distance(q[None], point)[0, 0] > 0.122
        assert follower.state == state


def test_a_final_state_holds_the_arm():
    follower = PlanarFollower(ARM, [0.0, 0.0], [0.0, 0.0])
    q = follower.step([0.0, 0.0], np.zeros((0, 2)))
    assert follower.state == State.ARRIVED
    assert (follower.step(q, [[1.0, 0.0]]) == q).all()


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("two links", 1),
        ("two links", 3),
        ("third prismatic", 2),
        ("two links, no way", 1),
        ("two links, no way", 3),
    ],
)
def test_unknown_worlds_are_passed_at_the_standoff_or_named_unreachable(kind, seed):
    found = episode(kind, seed)
    assert found["right"] and not found["looped"] and not found["contact"]
    assert found["held"] > 50 and found["kept"] == found["held"]
    assert found["least_mm"] > 105.0
    assert found["cycles"] > 500 and found["changed"] == 0


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("two links", 49), ("two links", 63), ("third prismatic, no way", 21)],
)
def test_a_boundary_that_sensed_points_move_is_left_or_known_after_a_round(kind, seed):
    """Noise brings points that move the hit point away from the boundary."""
    found = episode(kind, seed)
    assert found["right"] and not found["contact"]
    assert found["held"] > 15 and found["kept"] == found["held"]
    assert found["steps"] < 2_000 and found["changed"] == 0


HOME = {
    "panda_joint1": -1.2, "panda_joint2": 0.4, "panda_joint3": 0.0,
    "panda_joint4": -1.8, "panda_joint5": 0.0, "panda_joint6": 2.2, "panda_joint7": 0.8,
}  # fmt: skip


def panda(shape=None, pose=None, margin=0.35):
    """A guard of a Panda beside an obstacle, and a goal on the other side of that."""
    scene = Scene(mode="path", period=0.01, margin=margin)
    scene.add_robot("panda", "arm", home=HOME, response="deflect")
    if shape is not None:
        scene.add(shape, "obstacle", pose=pose)
    guard = Guard(scene, self_test=False)
    goal = guard.home.copy()
    goal[0] = 1.2
    return guard, goal


def drive(guard, follower, step=0.01, update=lambda stamp: None):
    """Distances at which a follower passes others, and changes of its commands."""
    q, moving, distances = guard.home.copy(), 0.0 * guard.home, []
    changed = Changed(0)
    command = guard.filter(q, moving, 0.0, velocity=moving)
    for k in range(1, round(30.0 / step)):
        desired = follower.velocity(q, command.verdict)
        update(step * k)
        command = guard.filter(q, desired, step * k, velocity=moving)
        moving = command.velocity.copy()
        q = q + step * moving
        changed |= command.changed["arm"]
        near = [p.distance for p in command.verdict.near if not p.b.startswith("arm/")]
        if follower.state == State.FOLLOWING:
            distances.append(min(near))
        if follower.state not in (State.TO_GOAL, State.FOLLOWING):
            break
    return q, np.array(distances), changed


def test_an_arm_slides_around_a_ball_at_the_standoff():
    guard, goal = panda(Sphere(radius=0.1), Pose(xyz=(0.6, 0.0, 0.45)))
    follower = SurfaceFollower(guard, "arm", goal)
    q, distances, changed = drive(guard, follower)
    assert follower.state == State.ARRIVED
    assert q == pytest.approx(goal, abs=0.003)
    # It begins to slow down before the standoff, and never comes nearer.
    assert distances.min() == pytest.approx(0.125, abs=0.005)
    assert np.median(distances) < 0.14
    assert not changed & (Changed.ROWS | Changed.PROOF | Changed.BLOCKED)


def test_a_wall_across_the_way_is_a_local_minimum():
    guard, goal = panda(Box(size=(0.1, 0.1, 3.0)), Pose(xyz=(0.45, 0.0, 0.0)))
    follower = SurfaceFollower(guard, "arm", goal)
    q, distances, changed = drive(guard, follower)
    assert follower.state == State.LOCAL_MINIMUM
    assert q[0] < 0.5
    assert distances.min() == pytest.approx(0.125, abs=0.005)
    assert not changed & (Changed.ROWS | Changed.PROOF | Changed.BLOCKED)
    assert not follower.velocity(q, guard.home_verdict).any()


def test_an_arm_between_two_bodies_that_are_too_near_still_moves():
    sides = [
        PlacedShape(Sphere(radius=0.05), Pose(xyz=(x, 0.0, 0.3))) for x in (-0.2, 0.2)
    ]
    guard, goal = panda(sides, Pose())
    near = [p for p in guard.home_verdict.near if p.b == "obstacle"]
    assert sum(p.distance < 0.12 for p in near) >= 2
    goal[0], goal[6] = guard.home[0], goal[6] + 0.5
    follower = SurfaceFollower(guard, "arm", goal)
    q, _, _ = drive(guard, follower)
    assert follower.state == State.ARRIVED
    assert q == pytest.approx(goal, abs=0.003)


def test_errors_of_a_surface_follower():
    guard, goal = panda(margin=0.1)
    with pytest.raises(SceneError, match=r"up to 0\.1 m .* `margin` of 0\.25"):
        SurfaceFollower(guard, "arm", goal)
    with pytest.raises(UnknownNameError, match="'leg'"):
        SurfaceFollower(guard, "leg", goal)
    with pytest.raises(GoalError, match="shape"):
        SurfaceFollower(guard, "arm", goal[:3])
    with pytest.raises(GoalError, match="limits"):
        SurfaceFollower(guard, "arm", goal + 9.0)


def test_an_arm_slides_around_cells_that_only_sensors_know():
    guard = sensed_guard(margin=0.35, speed=0.0)
    occupied = grid()
    low = np.floor((np.array([0.32, 0.28, 0.35]) - LOW) / CELL).astype(int)
    occupied[tuple(slice(k, k + 2) for k in low)] = True
    goal = guard.home.copy()
    goal[0] += 1.2
    follower = SurfaceFollower(guard, "arm", goal)
    _, distances, changed = drive(
        guard, follower, PERIOD,
        lambda stamp: feed(guard, changes(occupied, grid(), stamp), stamp),
    )  # fmt: skip
    assert len(distances) > 50
    assert distances.min() == pytest.approx(0.125, abs=0.005)
    assert not changed & (Changed.ROWS | Changed.BLOCKED)
