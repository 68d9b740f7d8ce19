"""The planner's example: its path against dense samples, measured by Coal."""

import importlib.util
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import armguard as ag
from peers.pinocchio_coal import AllDistances

EXAMPLE = Path(__file__).parents[1] / "examples" / "plan_with_ompl.py"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("plan_with_ompl", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_planned_path_keeps_every_buffer_between_its_rows(example):
    scene = example.panda_among_boxes()
    checker = ag.Checker(scene)
    start, goal = np.array(scene.home), np.array(scene.home)
    start[0], goal[0] = -1.0, 1.0
    path = example.plan(checker, start, goal, seconds=60.0)
    np.testing.assert_array_equal(path[[0, -1]], [start, goal])
    tables = ag.Guard(scene).tables
    peer = AllDistances(tables)
    buffers = [
        tables.buffers[tables.groups[pair.first], tables.groups[pair.second]]
        for pair in peer.geometry.collisionPairs
    ]
    for one, other in pairwise(path):
        shares = np.linspace(0.0, 1.0, 200)[:, None]
        for q in peer.positions(one + shares * (other - one)):
            peer.step(q)
            for pair, needed in zip(peer.results.distanceResults, buffers, strict=True):
                assert pair.min_distance >= needed - 1e-6


def test_a_goal_inside_the_post_has_no_path(example):
    scene = example.panda_among_boxes()
    checker = ag.Checker(scene)
    start, goal = np.array(scene.home), np.array(scene.home)
    start[0] = -1.0
    goal[1], goal[3] = 0.4, -1.4
    assert not checker.clear([goal])[0]
    assert example.plan(checker, start, goal, seconds=0.5) is None
