"""Two arms that come near each other: which one is slowed."""

import numpy as np
import pytest

from driven import Driven, two_arms


def gap(loop):
    """Reported distance of the two arms [m]."""
    return loop.commands[-1].verdict.nearest.distance


def test_a_parked_arm_is_not_pushed_and_slows_no_arm_before_its_own_stop():
    loop = Driven(two_arms(parked=0.9))
    parked = loop.q[1]
    while loop.cycle([-0.5, 0.0]).velocity[0] > -0.5:
        assert len(loop.commands) < 200
    free = 0
    while loop.cycle([-0.5, 0.0]).velocity[0] == -0.5:
        free += 1
        assert free < 3000
    assert loop.q[1] == parked
    # 0.5 rad/s at 0.9 m: a stop from there takes 0.45 m/s · 7 ms + 28 mm.
    assert 0.02 < gap(loop) < 0.12
    loop.run([-0.5, 0.0], 2000)
    assert loop.q[1] == parked
    assert loop.stops == []


@pytest.mark.parametrize("sharing", ["contribution", "equal"])
def test_arms_that_come_nearer_alike_are_slowed_alike(sharing):
    loop = Driven(two_arms(sharing))
    loop.run([-0.5, 0.5], 3000)
    ways = np.abs(loop.q - loop.guard.home)
    assert ways[0] == pytest.approx(ways[1], rel=1e-3)
    assert loop.stops == []
    assert 0.005 <= gap(loop) < 0.01


def test_by_priority_the_one_goes_on_and_the_other_one_yields():
    loop = Driven(two_arms("priority", (1.0, 0.0)))
    loop.run([-0.5, 0.5], 900)
    ways = np.abs(loop.q - loop.guard.home)
    assert ways[0] > 1.3 * ways[1]
    assert loop.stops == []


def test_one_that_leads_away_is_never_slowed():
    loop = Driven(two_arms())
    loop.run([-0.5, 0.5], 3000)
    command = loop.run([0.5, 0.5], 150)
    assert command.velocity[0] == 0.5
