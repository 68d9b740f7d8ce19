"""What rows of a program leave: shares of two robots, and what drives may miss."""

from collections import deque
from itertools import product

import numba
import numpy as np
import pytest

from armguard.respond.program import part_of
from armguard.respond.state import (
    BY_CONTRIBUTION,
    BY_PRIORITY,
    EQUALLY,
    PRIORITY,
    SHARING,
)
from sliding import at_gap, slides

PERIOD = 0.005


@numba.njit
def share(r, own, its, settings):
    return part_of(r, 1 - r, own, its, settings)


@pytest.mark.parametrize("sharing", [BY_CONTRIBUTION, EQUALLY, BY_PRIORITY])
@pytest.mark.parametrize("priorities", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
def test_two_robots_that_close_a_pair_share_no_more_than_it_has(sharing, priorities):
    settings = np.zeros((2, max(SHARING, PRIORITY) + 1))
    settings[:, SHARING] = sharing
    settings[:, PRIORITY] = priorities
    for one, other in product((0.1, 0.3, 1.0), repeat=2):
        shares = share(0, one, other, settings), share(1, other, one, settings)
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
        least = min(least, command.verdict.nearest.clearance)
    assert least >= missed * (figures["command"] + PERIOD)
    assert abs(v) < 1e-3
