"""Stamps, speeds and rates just inside and just outside the bounds of their kernels."""

from itertools import product

import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.guard import Reason, contact_speed, needs, settling, stops
from armguard.guard.grips import ContractRow
from armguard.guard.layout import NearRow
from armguard.guard.watch import BRAKING
from armguard.kernel import kernel
from armguard.motion.figures import CURVE_POINTS, JointFigures, RobotFigures
from armguard.motion.state import PLANS, StopClock
from armguard.record import records
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from records import record
from sliding import APART, EXACT, let_go, slides

PERIOD = 0.01


def test_an_objects_stamp_may_be_ahead_by_the_rounding_of_a_large_clock():
    now = 1e8
    # One microsecond, and a millionth of a millionth of the clock.
    rounding = 1e-6 + 1e-4
    guard = slides({}, mover={"top_speed": 0.1}, period=PERIOD)
    for share in (0.9, 1.1):
        guard.reset()
        guard.place("ball", Pose(xyz=(APART, 0, 0)), stamp=now + share * rounding)
        verdict = guard.step([0.0], now, velocity=[0.0], now=now)
        assert (verdict.reason is Reason.OBJECT_AHEAD) == (share > 1.0)


@pytest.mark.parametrize("way", [-1.0, 0.0, 1.0])
def test_a_stamp_that_repeats_with_another_position_is_no_jump(way):
    guard = slides({}, period=PERIOD)
    let_go(guard)
    guard.step([0.0], 5.0, velocity=[0.0], now=5.0)
    verdict = guard.step([way], 5.0, velocity=[0.0], now=5.0 + PERIOD)
    assert (verdict.reason is Reason.STAMP_REPEATED) == (way != 0.0)
    assert verdict.reason is not Reason.STATE_JUMPED


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_slide_near_its_top_speed_is_no_faster_than_declared(sign):
    error, top = 0.03, EXACT["velocity"]
    guard = slides({"velocity_error": error}, period=PERIOD)
    # The slowest that it may be is less than the top speed, or more.
    for slowest in (0.98 * top, 1.01 * top):
        let_go(guard)
        guard.step([0.0], 5.0, velocity=[sign * (slowest + error)], now=5.0)
        fastest = top if slowest <= top else slowest + 2.0 * error
        bounds = guard._motion.v_low[0], guard._motion.v_high[0]
        known = sign * slowest, sign * fastest
        assert sorted(bounds) == pytest.approx(sorted(known))


@kernel(entry=True)
def swing_speed(m):
    """Greatest speed of a joint's swing."""
    return settling.swing_speed(m.robot_figures[0], m.joint_figures[0])


@pytest.mark.parametrize("longest", [0.1, 0.5])
def test_a_swing_is_as_fast_as_half_a_sine_of_three_tenths_of_its_time(longest):
    robot, joint = records(1, RobotFigures), records(1, JointFigures)
    swing = 0.02
    robot.settle_time, joint.settle = longest, swing
    # It is not the hardness of its stop that bounds it.
    joint.deceleration, joint.deceleration_most = 1e-3, 2e-3
    times = np.linspace(0.0, 0.3 * longest, 10_001)
    speeds = np.gradient(swing * np.sin(np.pi * times / times[-1]), times)
    bound = swing_speed(record(robot_figures=robot, joint_figures=joint))
    assert speeds.max() <= bound <= 1.01 * speeds.max()


@kernel(entry=True)
def slowed(bound, start, end, m):
    """Greatest speed of a joint after a part of a brake."""
    return stops.slowed(0, bound, start, end, BRAKING, m)


@pytest.mark.parametrize("deceleration", [0.5, 3.0])
@pytest.mark.parametrize("start", [-0.2, 0.0, 0.1])
@pytest.mark.parametrize("end", [-0.1, 0.15, 0.4, 2.0])
def test_a_brake_slows_by_its_deceleration_from_its_effect_on(deceleration, start, end):
    joint = records(1, JointFigures)
    joint.brake_deceleration = deceleration
    m = record(
        joint_figures=joint,
        robot_figures=records(1, RobotFigures),
        robot_of_joint=np.zeros(1, dtype=np.int32),
        curves=np.zeros((1, 2 * CURVE_POINTS)),
    )
    known, step = 0.9, 1e-4
    for time in np.arange(start, end, step) + 0.5 * step:
        known = max(known - deceleration * step * (time > 0.0), 0.0)
    assert slowed(0.9, start, end, m) == pytest.approx(known, abs=1e-3)


@kernel(entry=True)
def allowed_speed(distance, time, c):
    """Greatest closing speed that a contract allows."""
    return contact_speed.allowed_speed(distance, time, c)


@pytest.mark.parametrize("time", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("distance", [-0.01, 0.02, 0.3])
def test_what_closes_as_fast_as_is_allowed_is_no_faster_when_its_stop_begins(
    distance, time
):
    creep, gain = 0.02, 4.0
    c = records(1, ContractRow)[0]
    c.creep, c.gain = creep, gain
    speed = allowed_speed(distance, time, c)
    # Nearer by what it closes until then.
    then = creep + gain * (distance - speed * time)
    assert speed == pytest.approx(max(then, creep))


@kernel(entry=True)
def closing_speed(i, j, w, v, m):
    """Bound of the closing speed of two primitives."""
    return needs.closing_speed(i, j, w, v, m)


@pytest.mark.parametrize("speeds", [(0.5, 0.0), (0.0, 0.7), (0.5, 0.7)])
@pytest.mark.parametrize("trunk", [0.0, 2.0])
def test_two_arms_of_a_trunk_close_at_the_sum_of_both_whatever_the_trunk_does(
    trunk, speeds
):
    # Joint 0 turns both arms; joints 1 and 2 are of the one, joint 3 of the other.
    m = record(
        rate=np.full(2, 99.0),
        shared=np.array([[3, 1], [1, 2]], dtype=np.int32),
        length=np.array([3, 2], dtype=np.int32),
        joints=np.array([[0, 1, 2], [0, 3, -1]], dtype=np.int32),
        levers=np.array([[1.5, 0.8, 0.3], [1.2, 0.6, 0.0]]),
        speed=np.array([trunk, speeds[0], 0.2, speeds[1]]),
    )
    w, v = record(bodies=np.arange(2, dtype=np.int32)), record(top_speed=np.zeros(2))
    known = 0.8 * speeds[0] + 0.3 * 0.2 + 0.6 * speeds[1]
    assert closing_speed(0, 1, w, v, m) == pytest.approx(known)
    assert closing_speed(1, 0, w, v, m) == pytest.approx(known)


@kernel(entry=True)
def rate_along_normal(i, j, near, w, v, m):
    """Greatest closing speed of a pair, by its normal."""
    return needs.rate_along_normal(i, j, near, w, v, m)


@pytest.mark.parametrize("moves", ["one", "both"])
def test_a_pair_closes_as_fast_as_the_worst_corner_of_its_velocities(moves):
    rng = np.random.default_rng(0)
    for _ in range(20):
        axes, near = rng.normal(size=(4, 6)), records(1, NearRow)[0]
        points, n = rng.normal(size=(2, 3)), rng.normal(size=3)
        n /= np.linalg.norm(n)
        near.point_a, near.point_b, near.normal = *points, n
        kinds = np.array([REVOLUTE, PRISMATIC, REVOLUTE, REVOLUTE], dtype=np.int32)
        gains = rng.uniform(0.5, 2.0, 4)
        velocities = np.sort(rng.normal(size=(4, 2)), axis=1)
        both = moves == "both"
        clock = records(2 * PLANS, StopClock)
        # The last joint is of a robot at rest.
        clock[1].still = 1
        m = record(
            rate=np.zeros(2 if both else 1),
            shared=np.zeros((2, 2), dtype=np.int32),
            length=np.array([2, 2], dtype=np.int32),
            joints=np.array([[0, 1], [2, 3]], dtype=np.int32),
            q_index=np.arange(4, dtype=np.int32),
            robot_of_joint=np.array([0, 0, 0, 1], dtype=np.int32),
            joint_kind=kinds,
            gain=np.stack([gains, np.zeros(4)], axis=1),
            axes=axes,
            clock=clock,
            v_low=velocities[:, 0].copy(),
            v_high=velocities[:, 1].copy(),
        )
        w = record(bodies=np.arange(2, dtype=np.int32))
        v = record(top_speed=np.array([0.0, 0.0 if both else 0.3]))
        closing = []
        for corner in product(*velocities):
            speeds = np.zeros((2, 3))
            for b in range(3 if both else 2):
                side, axis = b // 2, axes[b, :3]
                away = points[side] - axes[b, 3:]
                way = axis if kinds[b] == PRISMATIC else np.cross(axis, away)
                speeds[side] += gains[b] * corner[b] * way
            closing.append(n @ (speeds[0] - speeds[1]))
        known = max(closing) + (0.0 if both else 0.3)
        assert rate_along_normal(0, 1, near, w, v, m) == pytest.approx(known)
