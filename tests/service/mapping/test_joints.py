"""Positions of robots whose states come at different times."""

from types import SimpleNamespace

import numpy as np
import pytest

from armguard.service.mapping.joints import StatesOfRobots

OWN = [slice(0, 2), slice(2, 3)]


def cycle(stamps, q):
    return SimpleNamespace(stamps=np.array(stamps), q=np.array(q, dtype=float))


@pytest.fixture
def states():
    return StatesOfRobots(OWN)


def test_no_positions_before_every_robot_has_had_a_state(states):
    assert states.add(cycle([np.nan, np.nan], [0, 0, 0])) is None
    assert states.add(cycle([1.0, np.nan], [1, 2, 0])) is None


def test_robots_that_are_measured_together_keep_their_positions(states):
    q, stamp = states.add(cycle([1.0, 1.0], [1, 2, 3]))
    assert stamp == 1.0 and q.tolist() == [1, 2, 3]


def test_the_robot_ahead_is_where_it_was_at_the_stamp_of_the_other(states):
    states.add(cycle([1.0, 1.0], [1, 2, 3]))
    assert states.add(cycle([2.0, 1.0], [2, 4, 3]))[1] == 1.0
    q, stamp = states.add(cycle([2.0, 1.5], [2, 4, 5]))
    assert stamp == 1.5 and q.tolist() == [1.5, 3, 5]


def test_a_robot_too_far_ahead_has_no_known_position(states):
    states.add(cycle([1.0, 1.0], [1, 2, 3]))
    states.add(cycle([2.0, 1.0], [2, 4, 3]))
    assert states.add(cycle([3.0, 1.0], [3, 6, 3])) is None
