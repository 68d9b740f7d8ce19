"""What rows of a program leave: shares of two robots, and what drives may miss."""

from collections import deque
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from approach import FIGURES
from armguard.geometry import Pose
from armguard.guard import Reason
from armguard.guard.pair_row import pair_row
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.record import records
from armguard.respond import Guard
from armguard.respond.constraints import part_of
from armguard.respond.state import (
    BY_CONTRIBUTION,
    BY_PRIORITY,
    EQUALLY,
    Behaviour,
)
from armguard.scene import Scene
from arms import simple_arm
from grippers import Loop, add_gantry, add_table, guard_of
from records import record
from sliding import at_gap, let_go, slides

PERIOD = 0.005


@kernel(entry=True)
def share(r, own, its, a):
    return part_of(r, 1 - r, own, its, a)


@pytest.mark.parametrize("sharing", [BY_CONTRIBUTION, EQUALLY, BY_PRIORITY])
@pytest.mark.parametrize("priorities", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
def test_two_robots_that_close_a_pair_share_no_more_than_it_has(sharing, priorities):
    settings = records(2, Behaviour)
    settings.sharing, settings.priority = sharing, priorities
    a = record(settings=settings)
    for one, other in product((0.1, 0.3, 1.0), repeat=2):
        shares = share(0, one, other, a), share(1, other, one, a)
        assert sum(shares) == pytest.approx(1.0)
        if sharing == BY_CONTRIBUTION:
            assert shares[0] / shares[1] == pytest.approx(one / other)
        if sharing == BY_PRIORITY and priorities[0] > priorities[1]:
            assert shares[0] == 1.0


@pytest.mark.parametrize("missed", [0.05, 0.1])
def test_a_slide_keeps_what_its_drive_may_miss_until_a_command_matters(missed):
    figures = {
        "command": 0.02,
        "acceleration": 8.0,
        "deceleration": 4.0,
        "tracking_error": missed,
    }
    guard = slides(figures, period=PERIOD)
    x, v, under_way, least = at_gap(0.12)[0], 0.0, deque([0.0] * 4), np.inf
    for k in range(200):
        now = 5.0 + k * PERIOD
        command = guard.filter([x], [0.5], now, velocity=[v], now=now)
        under_way.append(command.velocity[0])
        target = under_way.popleft()
        # Its drive misses as much as it may, towards the ball.
        target += missed * (target != 0.0)
        before, gain = v, figures["acceleration"] * PERIOD
        v += float(np.clip(target - v, -gain, gain))
        x += 0.5 * (before + v) * PERIOD
        least = min(least, command.verdict.nearest.headroom)
    assert least >= missed * (figures["command"] + PERIOD)
    assert abs(v) < 1e-3


@pytest.mark.parametrize(("budget", "commanded"), [(0, 0.0), (2, 0.1), (4, 0.108)])
def test_a_budget_that_is_spent_leaves_what_is_under_way_and_no_share_of_the_new(
    budget, commanded
):
    # Two fingers glide over a table, so low that levers alone prove nothing.
    scene = Scene(mode="path")
    add_gantry(scene, "arm")
    add_table(scene)
    guard = guard_of(scene)
    loop = Loop(guard)
    loop.go({"arm/z": 0.0}, speed=0.1, longest=4000)
    loop.push({"arm/x": 0.1}, 200)
    # Each pair takes one test for what is under way, and one for what is new.
    guard._motion.effort.budget = budget
    desired = np.array([0.2, 0.0, 0.0, 0.0, 0.0])
    command = guard.filter(loop.q, desired, loop.t, velocity=loop.v)
    if budget == 0:
        assert command.verdict.reason is Reason.BUDGET_SPENT
    else:
        assert command.velocity[0] == pytest.approx(commanded, abs=1e-12)


@kernel(entry=True)
def closing_row(i, j, row, lines):
    """How fast each joint closes a pair whose witness is in the first row."""
    w = open_workspace(lines)
    pair_row(i, j, w.near[0], row, w, w.motion)


def test_a_joint_closes_a_pair_as_fast_as_it_moves_its_points_together():
    rng, step = np.random.default_rng(3), 1e-6
    model = simple_arm(joints=3)
    # As many shapes as a real arm has; the last link has none.
    links = {
        name: replace(link, collisions=link.collisions * (0 if name == "link3" else 18))
        for name, link in model.links.items()
    }
    scene = Scene(mode="path")
    for name, x in (("left", 0.0), ("right", 3.0)):
        at = Pose(xyz=(x, 0.0, 0.0))
        arm = replace(model, links=links)
        scene.add_robot(arm, name=name, base=at, stopping=FIGURES)
    guard = Guard(scene, self_test=False)
    w, moving = guard._workspace, guard.tables.moving_count
    q = guard.home + rng.uniform(-0.5, 0.5, 6)
    near = w.near[0]

    def poses(q):
        """Where each body is."""
        guard.reset()
        guard.step(q, 5.0, velocity=np.zeros(6), now=5.0)
        return w.T_world.reshape(-1, 3, 4).copy()

    here = poses(q)
    for pair in [(0, moving - 1), *rng.integers(0, moving, (20, 2))]:
        i, j = sorted(pair)
        points = rng.normal(size=(2, 3))
        n = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        near.point_a, near.point_b, near.normal = *points, n
        row = np.zeros(6)
        closing_row(i, j, row, guard._lines.ctypes.data)
        bodies = w.bodies[[i, j]]
        frames = zip(here[bodies], points, strict=True)
        local = [T[:, :3].T @ (p - T[:, 3]) for T, p in frames]
        for k in range(6):
            moved = poses(q + step * np.eye(6)[k])[bodies]
            ways = [
                T[:, :3] @ x + T[:, 3] - p
                for T, x, p in zip(moved, local, points, strict=True)
            ]
            assert row[k] == pytest.approx(n @ (ways[0] - ways[1]) / step, abs=1e-5)


def test_desired_motion_keeps_its_direction_while_the_robot_speeds_up_to_it():
    model = simple_arm(joints=2)
    scene = Scene(mode="path", period=PERIOD)
    scene.add_robot(model, name="arm", stopping=FIGURES)
    guard = Guard(scene, self_test=False)
    let_go(guard)
    q, v, asked = guard.home, np.zeros(2), np.array([1.0, -0.2])
    for k in range(5):
        now = 5.0 + k * PERIOD
        v = guard.filter(q, asked, now, velocity=v, now=now).velocity
        speed = (k + 1) * FIGURES["acceleration"] * PERIOD
        assert v == pytest.approx(speed * asked)
        q = q + v * PERIOD
