"""Start, stop, resume, re-sync: one machine, and nothing is wound up meanwhile."""

import numpy as np
import pytest

from approach import ball_scene
from armguard.errors import UnknownNameError
from armguard.geometry import Pose, Sphere
from armguard.respond import Action, Blocked, Guard
from armguard.scene.settings import ResponseSettings
from driven import Driven, ball_guard


def stopped(form="filter", desired=0.5, **response):
    """A loop whose arm was stopped by invalid desired motion, and now rests."""
    guard = Guard(ball_scene(response=ResponseSettings(**response)), self_test=False)
    loop = Driven(guard)
    loop.run([desired], 150, form)
    loop.cycle([np.nan], form)
    while loop.cycle([desired], form).action >= Action.STOP:
        assert len(loop.commands) < 1000
    return loop


def test_after_a_stop_desired_motion_that_never_ended_is_not_followed():
    loop = stopped()
    command = loop.run([0.5], 200)
    assert command.action is Action.HOLD
    assert command.blocked == {"arm": Blocked.STOPPED}
    assert command.velocity[0] == 0.0


def test_nor_where_nothing_is_near_that_it_could_lead_away_from():
    guard = ball_guard(settings={"margin": 0.01})
    loop = Driven(guard)
    loop.run([-0.2], 100)
    loop.cycle([np.nan])
    command = loop.run([-0.2], 400)
    assert command.action is Action.HOLD
    assert command.velocity[0] == 0.0
    assert command.blocked == {"arm": Blocked.STOPPED}


def test_letting_go_once_is_enough():
    loop = stopped()
    loop.run([0.5], 20)
    loop.cycle([0.0])
    command = loop.run([0.5], 120)
    assert command.blocked == {"arm": Blocked.NOT}
    assert command.velocity[0] == 0.5


def test_so_is_desired_motion_that_leads_away():
    loop = stopped()
    loop.run([0.5], 20)
    command = loop.run([-0.5], 120)
    assert command.velocity[0] == -0.5


def test_so_is_a_call():
    loop = stopped()
    loop.run([0.5], 20)
    loop.guard.engage("arm")
    assert loop.run([0.5], 120).velocity[0] == 0.5
    with pytest.raises(UnknownNameError, match="known names are 'arm'"):
        loop.guard.engage("amr")


def test_positions_are_followed_where_they_are_near():
    loop = Driven(ball_guard())
    goal = loop.guard.home + 0.04
    command = loop.run(goal, 600, "filter_positions")
    assert loop.q == pytest.approx(goal, abs=1e-5)
    assert command.position == pytest.approx(goal, abs=1e-5)
    assert command.blocked == {"arm": Blocked.NOT}


def test_a_first_position_far_away_is_gone_to_slowly():
    loop = Driven(ball_guard())
    goal = loop.guard.home + 0.5
    first = loop.cycle(goal, "filter_positions")
    assert first.blocked == {"arm": Blocked.CATCHING_UP}
    assert first.far_joints == ("arm/joint1",)
    loop.run(goal, 3000, "filter_positions")
    limit = 0.1 * 2.0
    assert any(not c.far_joints for c in loop.commands)
    slow = [c for c in loop.commands if c.blocked["arm"] is Blocked.CATCHING_UP]
    assert max(c.velocity[0] for c in slow) <= limit + 1e-12
    assert loop.q == pytest.approx(goal, abs=1e-4)


def test_or_it_is_refused_with_the_joints_named():
    guard = Guard(
        ball_scene(response=ResponseSettings(far_start="refuse")), self_test=False
    )
    loop = Driven(guard)
    command = loop.run(guard.home + 0.5, 100, "filter_positions")
    assert command.blocked == {"arm": Blocked.FAR_START}
    assert command.far_joints == ("arm/joint1",)
    assert (loop.q == guard.home).all()
    # The leader arm comes to where the arm is, and has it.
    loop.run(guard.home + 0.02, 5, "filter_positions")
    assert loop.commands[-1].blocked == {"arm": Blocked.NOT}


def test_a_leader_arm_moved_half_a_radian_during_a_stop_is_caught_up_with_slowly():
    loop = Driven(ball_guard())
    loop.run(lambda loop: loop.guard.home + 0.5 * loop.t, 400, "filter_positions")
    loop.cycle([np.nan], "filter_positions")
    leader = loop.q + 0.5
    command = loop.run(leader, 600, "filter_positions")
    assert command.blocked == {"arm": Blocked.STOPPED}
    assert command.far_joints == ("arm/joint1",)
    assert (np.diff(loop.q_rows[-300:], axis=0) == 0.0).all()
    loop.guard.engage()
    begin = len(loop.v_rows)
    command = loop.run(leader, 100, "filter_positions")
    assert command.blocked == {"arm": Blocked.CATCHING_UP}
    loop.run(leader, 4000, "filter_positions")
    speeds = np.abs(np.array(loop.v_rows[begin:]))[:, 0]
    far = np.abs(np.array(loop.q_rows[begin:]) - leader)[:, 0] > 0.101
    assert far.sum() > 1000
    assert speeds[: far.sum()].max() <= 0.1 * 2.0 + 1e-12
    assert loop.q == pytest.approx(leader, abs=1e-4)


def test_nothing_winds_up_while_the_ball_is_in_the_way():
    loop = Driven(ball_guard(), q=[0.3])
    for k in range(4000):
        loop.cycle([min(0.3 + 2e-4 * k, 1.2)], "filter_positions")
    held = loop.commands[-1].position[0]
    assert held == pytest.approx(loop.q[0], abs=2e-3)
    # The leader arm turns round: the arm follows at once, not after what was summed up.
    turned = loop.run([held - 0.02], 150, "filter_positions")
    assert turned.velocity[0] < -0.01


def test_an_arm_too_near_to_what_came_may_leave_it_at_the_speed_of_recovery():
    scene = ball_scene()
    scene.add(Sphere(radius=0.1), name="cart", present=False)
    guard = Guard(scene, self_test=False)
    loop = Driven(guard)
    loop.run([0.5], 200)
    angle = loop.q[0] + 0.21
    guard.place("cart", Pose(xyz=(0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.2)))
    stop = loop.cycle([0.5])
    assert stop.action is Action.STOP
    loop.run([0.5], 400)
    pressed = loop.q.copy()
    # Pushing on does nothing.
    command = loop.run([0.5], 100)
    assert command.blocked == {"arm": Blocked.TOO_NEAR}
    assert command.action is Action.STOP
    assert (loop.q == pressed).all()
    begin = len(loop.v_rows)
    out = loop.run([-0.5], 300)
    assert loop.q[0] < pressed[0] - 0.02
    slow = [
        abs(v[0])
        for v, c in zip(loop.v_rows[begin:], loop.commands[-300:], strict=True)
        if c.blocked["arm"] is Blocked.TOO_NEAR
    ]
    assert 0.15 < max(slow) <= 0.1 * 2.0 + 1e-12
    # Out of it, and led away: it has followed ever since.
    assert out.blocked == {"arm": Blocked.NOT}
    assert out.velocity[0] == -0.5


def test_between_two_bodies_too_near_it_says_that_it_is_pinched():
    scene = ball_scene()
    for name in ("one", "other"):
        scene.add(Sphere(radius=0.1), name=name, present=False)
    guard = Guard(scene, self_test=False)
    loop = Driven(guard)
    loop.run([0.0], 20)
    for name, side in (("one", 0.19), ("other", -0.19)):
        angle = loop.q[0] + side
        guard.place(name, Pose(xyz=(0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.2)))
    loop.run([0.0], 400)
    command = loop.run([0.5], 10)
    assert command.blocked == {"arm": Blocked.PINCHED}
    assert command.velocity[0] == 0.0


@pytest.mark.parametrize("value", [1e308, 50.0, np.nan])
def test_so_has_one_whose_stop_was_over_while_nothing_could_be_judged(value):
    guard, period = ball_guard(), 0.001
    q, v = guard.home, np.zeros(len(guard.q_names))
    for k in range(3000):
        measured = np.full_like(q, value) if 500 <= k < 2000 else q
        command = guard.filter(
            measured, np.full_like(q, -0.2), k * period, velocity=v, now=k * period
        )
        v = command.velocity
        q = q + v * period
        if k >= 500:
            assert command.action is not Action.FOLLOW or not command.velocity.any()
    assert command.blocked["arm"] is Blocked.STOPPED
    guard.filter(q, 0.0 * v, 3.0, velocity=v, now=3.0)
    command = guard.filter(q, 0.0 * v - 0.1, 3.001, velocity=v, now=3.001)
    assert command.velocity.any()


@pytest.mark.parametrize("begins", ["new", "reset"])
@pytest.mark.parametrize("wrong", ["stamp", "nan", "infinite", "far out", "velocity"])
def test_before_anything_is_known_no_position_is_commanded(begins, wrong):
    guard = ball_guard()
    home, nothing = guard.home, np.zeros(len(guard.q_names))
    there = home + 0.3
    if begins == "reset":
        guard.filter(home, nothing, 0.0, velocity=nothing, now=0.0)
        guard.reset()
    values = {"nan": np.nan, "infinite": -np.inf, "far out": 1e6}
    for k in range(3):
        # Elsewhere each time: what was said before is not said again.
        q, v = there + 0.1 * k, nothing.copy()
        now = 0.001 * k
        stamp = now + 5.0 if wrong == "stamp" else now
        if wrong in values:
            q[0] = values[wrong]
        if wrong == "velocity":
            v = np.full(len(q), 1e6)
        command = guard.filter(q, nothing, stamp, velocity=v, now=now)
        assert command.action is not Action.FOLLOW
        assert not command.velocity.any()
        # Where it says that it is, or nothing: anything else might be far from there.
        known = np.where(np.isfinite(q), q, np.nan)
        assert np.array_equal(command.position, known, equal_nan=True)
    for k in range(3, 200):
        stamp = k * 0.001
        command = guard.filter(there, nothing, stamp, velocity=nothing, now=stamp)
        assert np.abs(command.position - there).max() < 1e-9
