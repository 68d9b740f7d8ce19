"""The plant honours its own figures."""

import numpy as np
import pytest
from scipy.integrate import quad

from armguard.robot.stopping import stopping_figures
from arms import simple_arm
from closed_loop import plant as plants
from closed_loop.measuring import Measuring
from closed_loop.plant import rest_after, stopping_travel, swing_out
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Styles, Truth

N = 3
FIRST = np.array([0, N])
VELOCITY = np.array([2.0, 1.0, 0.5])
ACCELERATION = np.array([8.0, 4.0, 20.0])
DECELERATION = np.array([4.0, 1.5, 12.0])
NOTHING = np.zeros(N)


def plant(q=None):
    """A free plant of one arm."""
    at = np.zeros(N) if q is None else q
    made = plants.plant_at(at, FIRST, VELOCITY, ACCELERATION, 2.0 * DECELERATION)
    assert plants.release(made, 0)
    return made


def run(p, tick, count, desired):
    """Rows of positions and velocities of some substeps."""
    q_rows, v_rows = np.zeros((2, count, N))
    free_rows = np.zeros((count, 1), dtype=bool)
    plants.advance(p, tick, SUBSTEP, desired, q_rows, v_rows, free_rows)
    return q_rows, v_rows


def deceleration_at(t, full, ramp):
    return full * min(t / ramp, 1.0) if ramp > 0.0 else full


@pytest.mark.parametrize("ramp", [0.0, 0.005, 0.06, 0.5])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 0.4, 2.0])
def test_a_stop_integrates_its_deceleration(speed, ramp):
    full = 4.0
    rest = rest_after(speed, full, ramp)
    corners = [c for c in (ramp,) if 0.0 < c < rest]

    def speed_at(t):
        inner = [c for c in corners if c < t]
        lost = quad(deceleration_at, 0.0, t, (full, ramp), points=inner or None)[0]
        return speed - lost

    assert speed_at(rest) == pytest.approx(0.0, abs=1e-12)
    for t in np.linspace(0.0, rest, 9):
        way, left = stopping_travel(t, speed, full, ramp)
        assert left == pytest.approx(speed_at(t), abs=1e-9)
        inner = [c for c in corners if c < t]
        assert way == pytest.approx(
            quad(speed_at, 0.0, t, points=inner or None)[0], abs=1e-9
        )
    after = stopping_travel(rest + 1.0, speed, full, ramp)
    assert after == stopping_travel(rest, speed, full, ramp)


def test_travel_after_an_order_is_delay_and_closed_form():
    p = plant()
    velocity = np.array([2.0, -1.0, 0.5])
    run(p, 0, 4000, velocity)
    assert (p.v == velocity).all()
    before, now, delay, ramp = p.q.copy(), 4000 * SUBSTEP, 0.00413, 0.02
    swing, duration = np.array([0.01, 0.0, 0.002]), np.full(N, 0.05)
    stop = (DECELERATION, np.full(N, ramp), swing, duration)
    plants.order_stop(p, 0, now + delay, stop)
    q_rows, v_rows = run(p, 4000, 8000, velocity)
    speeds = zip(VELOCITY, DECELERATION, strict=True)
    rest = np.array([rest_after(s, d, ramp) for s, d in speeds])
    by_hand = VELOCITY * delay + VELOCITY**2 / (2 * DECELERATION) + VELOCITY * ramp / 2
    by_hand -= DECELERATION * ramp**2 / 24
    np.testing.assert_allclose(np.abs(p.q - before), by_hand, atol=1e-12)
    assert p.phase[0] == plants.HELD and (p.v == 0.0).all()
    farthest = np.abs(q_rows - before).max(axis=0)
    np.testing.assert_allclose(farthest, by_hand + swing, atol=1e-5)
    held = int(np.ceil((delay + (rest + duration * (swing > 0)).max()) / SUBSTEP))
    assert (q_rows[held:] == q_rows[-1]).all() and (v_rows[held:] == 0.0).all()
    assert not (q_rows[held - 2] == q_rows[-1]).all()


def test_an_operator_is_bounded_in_speed_and_acceleration():
    rng, p = np.random.default_rng(0), plant()
    tick, rows, speeds = 0, [p.q.copy()], [p.v.copy()]
    for _ in range(100):
        count = int(10.0 ** rng.uniform(0.0, 3.5))
        q_rows, v_rows = run(p, tick, count, rng.uniform(-4.0, 4.0, N))
        tick += count
        rows += list(q_rows)
        speeds += list(v_rows)
    v, q = np.array(speeds), np.array(rows)
    assert (np.abs(v) <= VELOCITY).all() and np.abs(v).max() == 2.0
    gained = np.abs(np.diff(v, axis=0)).max(axis=0) / SUBSTEP
    np.testing.assert_allclose(gained, ACCELERATION, rtol=1e-9)
    # Positions are the integral of the velocities: within the curvature of a substep.
    steps = np.diff(q, axis=0) - 0.5 * (v[1:] + v[:-1]) * SUBSTEP
    assert np.abs(steps).max() <= 0.25 * ACCELERATION.max() * SUBSTEP**2


def test_an_operator_has_no_influence_from_the_effect_on():
    ways = []
    for sign in (1.0, -1.0):
        p = plant()
        run(p, 0, 2000, VELOCITY)
        stop = (DECELERATION, NOTHING, NOTHING, NOTHING)
        plants.order_stop(p, 0, 2000 * SUBSTEP, stop)
        ways.append(run(p, 2000, 3000, sign * VELOCITY)[0])
    assert (ways[0] == ways[1]).all()


def test_a_plant_is_at_rest_until_it_is_given_to_its_operator():
    p = plants.plant_at(NOTHING, FIRST, VELOCITY, ACCELERATION, 2.0 * DECELERATION)
    assert not run(p, 0, 400, VELOCITY)[0].any()
    assert plants.release(p, 0)
    assert run(p, 400, 4, VELOCITY)[0].all()


def test_a_row_says_whose_the_arm_is_after_it():
    p = plant()
    plants.order_stop(p, 0, 10 * SUBSTEP, (DECELERATION, *(NOTHING,) * 3))
    rows, free = np.zeros((2, 20, N)), np.zeros((20, 1), dtype=bool)
    plants.advance(p, 0, SUBSTEP, VELOCITY, *rows, free)
    assert free[:10].all() and not free[10:].any()


def test_a_stop_is_carried_out_and_only_a_resting_arm_is_given_back():
    p = plant()
    run(p, 0, 2000, VELOCITY)
    plants.order_stop(p, 0, 2000 * SUBSTEP, (DECELERATION, *(NOTHING,) * 3))
    run(p, 2000, 10, VELOCITY)
    assert not plants.release(p, 0)
    run(p, 2010, 4000, VELOCITY)
    assert plants.release(p, 0)
    run(p, 6010, 10, VELOCITY)
    assert (p.v > 0.0).all()


def test_a_brake_takes_the_place_of_a_stop():
    p = plant()
    run(p, 0, 4000, VELOCITY)
    now = 4000 * SUBSTEP
    plants.order_stop(p, 0, now, (0.1 * DECELERATION, *(NOTHING,) * 3))
    plants.order_brake(p, 0, now + 0.1)
    before = p.q.copy()
    run(p, 4000, 8000, VELOCITY)
    slow = 0.1 * DECELERATION
    left = VELOCITY - slow * 0.1
    way = VELOCITY * 0.1 - slow * 0.1**2 / 2 + left**2 / (4 * DECELERATION)
    np.testing.assert_allclose(p.q - before, way, atol=1e-12)


def test_a_swing_goes_out_and_back():
    ways = [swing_out(t, 0.01, 0.05)[0] for t in np.linspace(0.0, 0.05, 101)]
    assert ways[0] == ways[-1] == 0.0 and max(ways) == pytest.approx(0.01)
    t, h = 0.013, 1e-7
    slope = (swing_out(t + h, 0.01, 0.05)[0] - swing_out(t - h, 0.01, 0.05)[0]) / 2 / h
    assert swing_out(t, 0.01, 0.05)[1] == pytest.approx(slope, rel=1e-6)


def test_a_stop_may_swing_back_before_its_rest():
    p = plant()
    velocity = np.array([2.0, -1.0, 0.5])
    run(p, 0, 4000, velocity)
    swing, duration = np.array([-0.01, -0.01, 0.0]), np.full(N, 0.05)
    plants.order_stop(p, 0, 1.0, (DECELERATION, NOTHING, swing, duration))
    before = p.q.copy()
    q_rows, v_rows = run(p, 4000, 8000, velocity)
    way = np.sign(velocity) * (q_rows - before)
    rest = VELOCITY**2 / (2 * DECELERATION)
    np.testing.assert_allclose(way.max(axis=0), rest, atol=1e-12)
    np.testing.assert_allclose(np.abs(p.q - before), rest, atol=1e-12)
    rests = np.round(VELOCITY / DECELERATION / SUBSTEP).astype(int)
    lowest = [way[begin:, j].min() for j, begin in enumerate(rests)]
    np.testing.assert_allclose(lowest, rest + np.minimum(swing, 0.0), atol=1e-5)
    # Velocities are the slope of the positions, back and onwards again.
    assert v_rows[rests[0] :, 0].min() < 0.0 < v_rows[rests[0] :, 0].max()
    steps = np.diff(q_rows, axis=0) - 0.5 * (v_rows[1:] + v_rows[:-1]) * SUBSTEP
    assert np.abs(steps).max() < 1e-6


@pytest.mark.parametrize("style", ["adverse", "least", "random"])
def test_swings_back_are_drawn_where_they_are_requested(style):
    rng, known = np.random.default_rng(3), [figures()]
    styles = Styles("most", style, "none", True)
    closing = np.array([1.0, -1.0, 0.0])
    for both in (False, True):
        truth = Truth(rng, known, styles, swings_back=both)
        swings = np.array([truth.stop(closing)[2] for _ in range(20)])
        assert (np.abs(swings) <= 0.002).all()
        assert (swings < 0.0).any() == both
        if style == "adverse" and both:
            # Towards the nearest pair: back where a joint moves away from it.
            np.testing.assert_allclose(swings, [[0.002, -0.002, 0.002]] * 20)


def figures():
    return stopping_figures(
        simple_arm(),
        velocity=2.0,
        acceleration=8.0,
        deceleration=4.0,
        deceleration_most=6.0,
        ramp=0.01,
        settle=0.002,
        settle_time=0.05,
        position_error=1e-3,
        velocity_error=0.02,
        sensing=0.003,
        command=0.004,
        stale=0.02,
        base_error=0.002,
        base_turn=0.003,
        model_error=0.004,
    )


@pytest.mark.parametrize("times", ["most", "random", "least"])
@pytest.mark.parametrize("stops", ["least", "most", "random", "corner", "adverse"])
@pytest.mark.parametrize("full", [True, False])
def test_what_is_true_lies_in_what_is_declared(times, stops, full):
    rng, declared = np.random.default_rng(1), figures()
    for _ in range(20):
        truth = Truth(rng, [declared], Styles(times, stops, "bias", full))
        assert (truth.velocity <= 2.0).all() and (truth.acceleration <= 8.0).all()
        assert (truth.brake >= 4.0).all()
        strength, ramp, swing, duration = truth.stop(rng.normal(size=N))
        assert (strength >= 4.0).all() and (strength <= 6.0).all()
        assert (ramp >= 0.0).all() and (ramp <= 0.01).all()
        assert (swing >= 0.0).all() and (swing <= 0.002).all()
        assert (duration > 0.0).all() and (duration <= 0.05).all()
        assert 0.0 <= truth.command_delay(0) <= 0.004
        assert 0.0 <= truth.lateness(3, 0.001) <= 0.001
        shift = truth.base_shifts[0]
        assert np.linalg.norm(shift[:3, 3]) <= 0.002 + 1e-12
        assert np.arccos((np.trace(shift[:3, :3]) - 1) / 2) <= 0.003 + 1e-9
        assert 0.0 <= truth.outer[0] <= 0.004


ERROR_STYLES = ["adverse", "quiet", "bias", "noise", "alternating", "none"]


@pytest.mark.parametrize("errors", ERROR_STYLES)
def test_measurements_are_old_and_wrong_within_their_bounds(errors):
    rng = np.random.default_rng(2)
    truth = Truth(rng, [figures()], Styles("random", "least", errors, True))
    q_rows = np.cumsum(rng.normal(size=(400, N)), axis=0)
    v_rows = rng.normal(size=(400, N))
    measuring = Measuring(truth, FIRST, q_rows, v_rows)
    last, worst = 0.0, 0.0
    for cycle, tick in enumerate(range(0, 400, 4)):
        outward = rng.normal(size=N)
        q, v, (stamp,) = measuring.measure(tick, cycle, outward)
        age = tick * SUBSTEP - stamp
        assert -1e-12 <= age <= 0.003 + 1e-12 and stamp >= last
        repeated = cycle > 0 and stamp == last
        last, at = stamp, round(stamp / SUBSTEP)
        assert (np.abs(q - q_rows[at]) <= 1e-3 + 1e-12).all()
        assert (np.abs(v - v_rows[at]) <= 0.02 + 1e-12).all()
        worst = max(worst, float(np.abs(q - q_rows[at]).max()))
        # The same measurement has the same errors.
        if errors == "adverse" and not repeated:
            assert (np.sign(q - q_rows[at]) == np.sign(outward)).all()
    if errors == "quiet":
        assert 0.0 < worst
    else:
        assert worst == 0.0 if errors == "none" else worst > 0.9e-3
