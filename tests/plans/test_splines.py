"""Curves between waypoints are those of SciPy, and tubes hold what is beside them."""

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicHermiteSpline, CubicSpline, make_interp_spline

import armguard as ag
from armguard.errors import TrajectoryError
from armguard.plans.plan import Plan, speeds_near
from armguard.prove.tube import Tube
from arms import wall_scene
from tubes import random_tube
from verifying.oracle import positions

TIMES = np.array([0.0, 0.4, 0.5, 1.3, 2.0, 2.2])


def waypoints(seed=0):
    rng = np.random.default_rng(seed)
    return [rng.uniform(-0.8, 0.8, (len(TIMES), 3)) for _ in range(3)]


def plan_of(q, v=None, a=None, times=TIMES, **options):
    motion = ag.Trajectory(
        ("joint1", "joint2", "joint3"), q, times, "x", velocities=v, accelerations=a
    )
    return Plan.of(motion, wall_scene(), **options)


SAMPLES = np.linspace(0.0, 2.2, 997)


def test_lines_cubics_and_quintics_follow_from_what_the_rows_have():
    q, v, a = waypoints()
    curves = {
        "linear": (plan_of(q), make_interp_spline(TIMES, q, k=1)),
        "cubic": (plan_of(q, v), CubicHermiteSpline(TIMES, q, v)),
        "quintic": (
            plan_of(q, v, a),
            BPoly.from_derivatives(TIMES, np.stack((q, v, a), axis=1)),
        ),
    }
    for name, (plan, expected) in curves.items():
        assert plan.interpolation == name
        np.testing.assert_allclose(
            plan.tube.at(SAMPLES), expected(SAMPLES), rtol=0, atol=1e-12
        )


def test_a_spline_through_positions_alone_rests_at_both_ends():
    q, _, _ = waypoints(1)
    cubic = plan_of(q, interpolation="cubic").tube
    expected = CubicSpline(TIMES, q, bc_type="clamped")(SAMPLES)
    np.testing.assert_allclose(cubic.at(SAMPLES), expected, rtol=0, atol=1e-12)
    quintic = positions(plan_of(q, interpolation="quintic").tube, SAMPLES)
    # Without velocity and acceleration, the way grows with the cube of time.
    once, twice = quintic[[1, 2]] - quintic[0]
    np.testing.assert_allclose(twice / once, 8.0, rtol=0.1)
    np.testing.assert_allclose(plan_of(q, interpolation="quintic").tube.at(TIMES), q)


def test_a_line_is_between_waypoints_of_which_one_has_no_velocity():
    q, v, _ = waypoints(2)
    v[3] = np.nan
    plan = plan_of(q, v)
    assert plan.interpolation == "mixed"
    alone = CubicHermiteSpline(TIMES[:3], q[:3], v[:3])
    early = SAMPLES[SAMPLES < TIMES[2]]
    np.testing.assert_allclose(plan.tube.at(early), alone(early), atol=1e-12)
    middle = plan.tube.at(np.array([(TIMES[2] + TIMES[3]) / 2.0]))[0]
    np.testing.assert_allclose(middle, (q[2] + q[3]) / 2.0, atol=1e-12)
    with pytest.raises(TrajectoryError, match="configuration 4 lacks what 'cubic'"):
        plan_of(q, v, interpolation="cubic")


def test_the_way_from_where_the_arms_rest_belongs_to_the_plan():
    q, v, _ = waypoints(3)
    here = np.array([0.1, 0.2, 0.3])
    later = plan_of(q, v, times=TIMES + 0.7, start=here).tube
    np.testing.assert_allclose(later.at(np.zeros(1))[0], here)
    rest = CubicHermiteSpline([0.0, 0.7], [here, q[0]], [np.zeros(3), v[0]])
    early = np.linspace(0.0, 0.7, 50)
    np.testing.assert_allclose(later.at(early), rest(early), atol=1e-12)
    at_once = plan_of(q, start=here).tube
    assert at_once.times[0] == -1.0
    np.testing.assert_allclose(at_once.at(np.array([-0.5]))[0], (here + q[0]) / 2.0)


def test_a_clock_that_is_off_moves_no_joint_out_of_the_width():
    q, v, _ = waypoints(4)
    plan, scene, skew = plan_of(q, v), wall_scene(), 0.05
    tube = plan.widened(scene, {"arm/joint2": 0.01}, {"arm": skew})
    segment, _ = tube.place(SAMPLES)
    for off in np.linspace(-skew, skew, 21):
        moved = plan.tube.at(np.clip(SAMPLES + off, 0.0, TIMES[-1]))
        way = np.abs(moved - plan.tube.at(SAMPLES))
        way[:, 1] += 0.01
        assert (way <= tube.wide[segment] + 1e-12).all()
    # The bound of speeds is that of control points: at most twice the true one here.
    half = plan.widened(scene, 0.0, {"arm": skew / 3.0}).wide[segment]
    moved = plan.tube.at(np.clip(SAMPLES + skew, 0.0, TIMES[-1]))
    assert (np.abs(moved - plan.tube.at(SAMPLES)) > half).any()


@pytest.mark.parametrize("skew", [0.0, 0.03, 0.4, 9.0])
def test_speeds_near_a_segment_are_the_greatest_of_all_it_may_be_in(skew):
    tube = random_tube(3, 3, 23, seed=5)
    speeds, found = tube.top_speeds(), speeds_near(tube, skew)
    for k, (start, end) in enumerate(zip(tube.times, tube.times[1:], strict=False)):
        near = (tube.times[:-1] <= end + skew) & (tube.times[1:] >= start - skew)
        within = (tube.times[:-1] < end + skew) & (tube.times[1:] > start - skew)
        assert (found[k] >= speeds[within].max(axis=0)).all()
        assert (found[k] <= speeds[near].max(axis=0)).all()


def test_top_speeds_bound_differences_of_samples():
    tube = random_tube(3, 5, 9, seed=6)
    times = np.linspace(tube.times[0], tube.times[-1], 4001)
    segment, _ = tube.place(0.5 * (times[1:] + times[:-1]))
    rates = np.abs(np.diff(tube.at(times), axis=0)) / np.diff(times)[:, None]
    speeds = np.maximum(tube.top_speeds()[segment], 0.0)
    same = segment == tube.place(times[:-1])[0]
    assert (rates <= speeds + 1e-9)[same & (segment == tube.place(times[1:])[0])].all()
    curves = BPoly(np.moveaxis(tube.control, 0, 1), tube.times).derivative()
    np.testing.assert_allclose(tube.velocities(times), curves(times), atol=1e-9)
    line = Tube.straight(np.array([0.0, 2.0]), np.array([[0.0], [1.0]]))
    assert line.top_speeds()[0, 0] == 0.5
