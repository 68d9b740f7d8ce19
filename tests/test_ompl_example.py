"""The planner's example: its path against dense samples, measured by Coal."""

import importlib.util
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

import armguard as ag
from armguard.plans.coal_world import CoalWorld
from peers.pinocchio_coal import AllDistances

EXAMPLE = Path(__file__).parents[1] / "examples" / "plan_with_ompl.py"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("plan_with_ompl", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_planned_paths_keep_every_buffer_between_their_rows(example):
    scene = example.panda_among_boxes()
    checker = ag.Checker(scene)
    start, goal = np.array(scene.home), np.array(scene.home)
    start[0], goal[0] = -1.0, 1.0
    tables = ag.Guard(scene).tables
    peer, world = AllDistances(tables), CoalWorld(tables, exact=True)
    pairs = [(pair.first, pair.second) for pair in peer.geometry.collisionPairs]
    needed = np.array(
        [tables.buffers[tables.groups[i], tables.groups[j]] for i, j in pairs]
    )
    for _ in range(20):
        path = example.plan(checker, start, goal, seconds=60.0)
        np.testing.assert_array_equal(path[[0, -1]], [start, goal])
        rows = np.concatenate(
            [np.linspace(one, other, 200) for one, other in pairwise(path)]
        )
        for q, own in zip(rows, peer.positions(rows), strict=True):
            peer.step(own)
            every = [pair.min_distance for pair in peer.results.distanceResults]
            for k in np.flatnonzero(every < needed - 1e-6):
                # Primitives enclose their links: the meshes' hulls are farther apart.
                world.move(q)
                assert least_of_exact(world, tables, *pairs[k]) >= needed[k] - 1e-6


def least_of_exact(world, tables, *primitives):
    """Distance of the exact shapes of two primitives, or of those without any [m]."""
    first, of = len(tables.kinds), tables.exact.of_primitive

    def shapes(i):
        start, count = of[i].tolist()
        return range(first + start, first + start + count) if count else (i,)

    return min(world.distance(*ends) for ends in product(*map(shapes, primitives)))


def test_a_goal_inside_the_post_has_no_path(example):
    scene = example.panda_among_boxes()
    checker = ag.Checker(scene)
    start, goal = np.array(scene.home), np.array(scene.home)
    start[0] = -1.0
    goal[1], goal[3] = 0.4, -1.4
    assert not checker.clear([goal])[0]
    assert example.plan(checker, start, goal, seconds=0.5) is None
