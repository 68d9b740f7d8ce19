"""Twists of tools become joint velocities that do what was asked, near limits too."""

import numpy as np
import pytest

from armguard import Action, Guard, Reason, bay_scene
from armguard.respond.joint_bounds import LIMIT_SPARE
from armguard.respond.state import MOST_TWISTS
from bay_loop import LEFT, RIGHT, bay_loop, tool_pose

STEP = 1e-6
TWIST = np.array([0.03, -0.02, 0.04, 0.05, -0.04, 0.03])

# From home to where no joint is at an end and nothing is near [rad].
BENT = np.array([0.1, -0.2, -0.5, -0.5, 0.3, 0.4, 0.1])


@pytest.fixture(scope="module")
def guard():
    return Guard(bay_scene("path"), self_test=False)


def requested_by(guard, q, twists):
    """Joint velocities a guard makes of twists at a configuration."""
    guard.reset()
    still = np.zeros(len(q))
    command = guard.filter_twists(q, twists, 0.0, velocity=still)
    assert command.verdict.reason is not Reason.WRONG_COMMAND
    return guard._response.requested.copy()


def twist_of(guard, q, v, name):
    """How a tool moves at joint velocities, by central differences, shape (6,)."""
    before, after = (tool_pose(guard, q + s * STEP * v, name) for s in (-0.5, 0.5))
    turn = (after[:3, :3] @ before[:3, :3].T - np.eye(3)) / STEP
    linear = (after[:3, 3] - before[:3, 3]) / STEP
    return np.array([*linear, turn[2, 1], turn[0, 2], turn[1, 0]])


def test_the_tools_of_both_arms_move_as_asked(guard):
    q = guard.home
    v = requested_by(guard, q, {"left": TWIST, "right": -TWIST})
    assert twist_of(guard, q, v, "left") == pytest.approx(TWIST, abs=2e-3)
    assert twist_of(guard, q, v, "right") == pytest.approx(-TWIST, abs=2e-3)


def test_no_motion_is_desired_of_a_robot_that_is_not_named(guard):
    v = requested_by(guard, guard.home, {"left": TWIST})
    assert np.abs(v[LEFT]).max() > 0.0
    assert np.all(v[RIGHT] == 0.0)


def test_two_tools_of_an_arm_are_led_at_once(guard):
    q = guard.home
    # What the elbow does for the tool is asked of it as well: both can be had.
    free = requested_by(guard, q, {"left": TWIST})
    elbow = twist_of(guard, q, free, "left/link4")
    v = requested_by(guard, q, {"left": TWIST, "left/link4": elbow})
    assert twist_of(guard, q, v, "left") == pytest.approx(TWIST, abs=3e-3)
    assert twist_of(guard, q, v, "left/link4") == pytest.approx(elbow, abs=3e-3)


@pytest.mark.parametrize("k", range(7))
def test_the_others_take_over_what_a_joint_at_its_limit_would_do(guard, k):
    q, tables = guard.home.copy(), guard.tables
    q[LEFT] += BENT
    free = requested_by(guard, q, {"left": TWIST})
    limits = (tables.lower.copy(), tables.upper.copy())
    # The limit is brought to the joint, for its arm to be where it was.
    away = 2.0 * guard._motion.joint_figures[k].position_error + 0.5 * LIMIT_SPARE
    side = tables.upper if free[k] > 0.0 else tables.lower
    side[k] = q[k] + np.sign(free[k]) * away
    try:
        v = requested_by(guard, q, {"left": TWIST})
    finally:
        tables.lower[:], tables.upper[:] = limits
    assert v[k] == 0.0 != free[k]
    without = free.copy()
    without[k] = 0.0
    missed = np.linalg.norm(twist_of(guard, q, v, "left") - TWIST)
    lost = np.linalg.norm(twist_of(guard, q, without, "left") - TWIST)
    # An elbow and a shoulder that turns it do what no other joint can.
    assert missed < (0.25 if k in (2, 3) else 0.1) * lost


def test_more_twists_than_can_be_led_are_refused(guard):
    guard.reset()
    links = [name for name in guard.tables.links if name.startswith("left/")]
    names = [*links, *(f"right/{name[5:]}" for name in links)][: MOST_TWISTS + 1]
    assert len(names) > MOST_TWISTS
    twists = dict.fromkeys(names, TWIST)
    still = np.zeros(len(guard.home))
    command = guard.filter_twists(guard.home, twists, 0.0, velocity=still)
    assert command.action is Action.STOP
    assert command.verdict.reason is Reason.WRONG_COMMAND
    assert str(MOST_TWISTS) in command.verdict.why


def test_a_tool_goes_where_it_is_led(guard):
    guard.reset()
    loop = bay_loop(guard)
    before = tool_pose(guard, loop.q, "left")
    loop.run({"left": [0.0, 0.0, 0.04, 0.0, 0.0, 0.0]}, 500, "filter_twists")
    way = tool_pose(guard, loop.q, "left")[:3, 3] - before[:3, 3]
    assert loop.stops == []
    assert way == pytest.approx([0.0, 0.0, 0.02], abs=3e-3)
