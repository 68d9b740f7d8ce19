"""Ways by RRT-connect, in a plane with a wall."""

from itertools import pairwise

import numpy as np
import pytest

from reach.goals import find_way

LOW, HIGH = np.zeros(2), np.ones(2)


def wall_with_gap(gap):
    """Whether a line keeps clear of a wall at x = 0.5 that ends at y = 1 - gap."""

    def is_clear(a, b):
        line = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
        return not ((np.abs(line[:, 0] - 0.5) < 0.02) & (line[:, 1] < 1.0 - gap)).any()

    return is_clear


@pytest.mark.parametrize("seed", range(5))
def test_a_way_leads_from_start_to_goal_by_clear_lines(seed):
    start, goal = np.array([0.1, 0.1]), np.array([0.9, 0.1])
    is_clear = wall_with_gap(0.3)
    rng = np.random.default_rng(seed)
    way = find_way(start, goal, LOW, HIGH, is_clear, rng, 400)
    assert way is not None and len(way) > 2
    assert (way[0] == start).all() and (way[-1] == goal).all()
    assert all(is_clear(a, b) for a, b in pairwise(way))


def test_no_way_is_found_where_there_is_none():
    start, goal = np.array([0.1, 0.1]), np.array([0.9, 0.1])
    rng = np.random.default_rng(0)
    assert find_way(start, goal, LOW, HIGH, wall_with_gap(0.0), rng, 200) is None


def test_joints_without_room_stay():
    start, goal = np.array([0.1, 0.4]), np.array([0.9, 0.4])
    low, high = np.array([0.0, 0.4]), np.array([1.0, 0.4])
    rng = np.random.default_rng(1)
    way = find_way(start, goal, low, high, lambda a, b: True, rng, 50)
    assert way is not None and all(q[1] == 0.4 for q in way)
