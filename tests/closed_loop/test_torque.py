"""Arms with limited torque, and the check that a plant keeps its declared figures."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from armguard.robot.stopping import stopping_figures
from arms import simple_arm
from closed_loop import plant as plants
from closed_loop.arena import Arena
from closed_loop.conformance import Commanded, Stopping, broken, declared_of, misses
from closed_loop.plan import arena_of, work
from closed_loop.scenes import bare_scene, declared
from closed_loop.settings import SERVO_PROFILES, SUBSTEP, Plan, setting_of
from closed_loop.torque import LIGHT, TorqueArms, carry, driven_figures, torque_model
from closed_loop.truth import Styles, Truth

N = 3
FIRST = np.array([0, N])
SPEED = np.array([2.0, -1.0, 0.5])
BEGIN, COUNT = 2000, 6000


def figures(**changes):
    known = {
        "velocity": 2.0,
        "acceleration": 8.0,
        "deceleration": 4.0,
        "deceleration_most": 6.0,
        "ramp": 0.02,
        "settle": 0.01,
        "settle_time": 0.05,
        "position_error": 0.0,
        "velocity_error": 0.0,
    }
    return stopping_figures(simple_arm(), **{**known, **changes})


def stopped(**changes):
    """States of an arm that speeds up and stops, and its stops.

    Args:
        changes: Other numbers of the plant than the declared ones.
    """
    known = {"acceleration": 8.0, "deceleration": 4.0, "ramp": 0.02, "swing": 0.01}
    known |= {"swing_time": 0.05, "speed": 1.0, **changes}
    full = np.full(N, 1.0)
    p = plants.plant_at(
        np.zeros(N), FIRST, 4.0 * full, known["acceleration"] * full, 8.0 * full
    )
    plants.release(p, 0)
    q, v = np.zeros((2, COUNT, N))
    free = np.zeros((COUNT, 1), dtype=bool)
    desired = known["speed"] * SPEED
    # Swings are in proportion to the declared top speed.
    swing = known["swing"] * 2.0 * full
    names = ("deceleration", "ramp", "swing", "swing_time")
    stop = tuple(swing if n == "swing" else known[n] * full for n in names)
    parts = slice(BEGIN), slice(BEGIN, COUNT)
    plants.advance(p, 0, SUBSTEP, desired, q[parts[0]], v[parts[0]], free[parts[0]])
    plants.order_stop(p, 0, BEGIN * SUBSTEP, stop)
    plants.advance(p, BEGIN, SUBSTEP, desired, q[parts[1]], v[parts[1]], free[parts[1]])
    # A row is a state at the end of its substep: put the start before them.
    before = np.zeros((1, N))
    rows = np.vstack([before, q]), np.vstack([before, v]), np.vstack([[[False]], free])
    return (*rows, [Stopping(0, BEGIN * SUBSTEP, False)])


def broken_by(back=False, as_declared=None, **changes):
    q, v, free, stops = stopped(**changes)
    known = figures(**(as_declared or {}))
    truth = Truth(np.random.default_rng(0), [known], Styles.worst(), swings_back=back)
    return broken(q, v, free, FIRST, stops, declared_of([known], truth))


@pytest.mark.parametrize("changes", [{}, {"deceleration": 6.0}, {"ramp": 0.0}])
def test_a_plant_inside_its_figures_breaks_none(changes):
    # The swing of the hardest stop begins long before that of the softest could.
    assert broken_by(**changes) is None


@pytest.mark.parametrize(
    ("changes", "figure"),
    [
        ({"speed": 1.01}, "velocity"),
        ({"acceleration": 8.3}, "acceleration"),
        ({"deceleration": 3.88}, "stop, too far"),
        ({"deceleration": 6.2, "ramp": 0.0}, "stop, too hard"),
        ({"ramp": 0.021}, "stop, too far"),
        ({"swing": 0.0103}, "stop, too far"),
        ({"swing": -0.01, "deceleration": 6.0, "ramp": 0.0}, "stop, too hard"),
        ({"swing_time": 0.06}, "stop, no rest"),
    ],
)
def test_a_plant_just_outside_its_figures_breaks_that_one(changes, figure):
    assert broken_by(**changes) == figure


def test_a_swing_back_is_inside_where_it_is_declared():
    back = {"swing": -0.01, "deceleration": 6.0, "ramp": 0.0}
    assert broken_by(back=True, **back) is None
    assert broken_by(back=True, **{**back, "swing": -0.0103}) == "stop, too hard"


def test_what_sensors_leave_of_the_declared_errors_is_the_arms():
    q, v, free, stops = stopped(deceleration=3.88)
    known = figures(velocity_error=0.07)
    truth = Truth(np.random.default_rng(0), [figures()], Styles.worst())
    assert broken(q, v, free, FIRST, stops, declared_of([known], truth)) is None
    known = figures(velocity_error=0.02)
    assert broken(q, v, free, FIRST, stops, declared_of([known], truth)) is not None


@pytest.mark.parametrize(("share", "missed"), [(0.99, False), (1.01, True)])
def test_a_drive_may_miss_its_commands_by_the_tracking_error(share, missed):
    known = figures(tracking_error=0.05)
    truth = Truth(np.random.default_rng(0), [known], Styles.worst())
    as_declared, command = declared_of([known], truth), np.array([0.004])
    sent = [Commanded(0.0, 0, np.zeros(N)), Commanded(0.1, 0, np.full(N, 0.4))]
    sent.append(Commanded(0.2, 0, np.zeros(N)))
    free, ticks = np.ones((1200, 1), dtype=bool), np.arange(1200)[:, None]
    follows = np.where((ticks >= 416) & (ticks < 816), 0.4, 0.0) * np.ones(N)
    # Speeding up gradually leaves no velocity of before, nor any command.
    lags = np.clip(1e-3 * (ticks - 400), 0.0, 0.4) * np.ones(N)
    lags[816:] = 0.0
    for v in (follows, lags):
        assert not misses(v, free, FIRST, sent, as_declared, command)
        assert not misses(-v[:1], free[:1], FIRST, sent, as_declared, command)
    beyond = follows + np.where(follows > 0.0, share * 0.05, 0.0)
    assert misses(beyond, free, FIRST, sent, as_declared, command) is missed
    # Of a drive that turns the other way.
    away = follows - np.where(follows == 0.0, share * 0.05, 0.0)
    assert misses(away, free, FIRST, sent, as_declared, command) is missed


def model_of(name):
    scene = bare_scene(name)
    known = declared(setting_of(name, "path", 0, SERVO_PROFILES), scene)
    return scene, torque_model(scene, list(known.values()))


def test_masses_are_those_of_the_urdf():
    """The mass matrix, beside that of Pinocchio."""
    scene, built = model_of("bay")
    robot = next(iter(scene.robots.values()))
    model = pin.buildModelFromUrdf(str(robot.model.path))
    n, data = model.nq, model.createData()
    for body in built.payloads:
        carry(built.model, body, 1e-9)
    state = mujoco.MjData(built.model)
    mujoco.mj_setConst(built.model, state)
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, n)
        state.qpos[:n] = q
        mujoco.mj_forward(built.model, state)
        full = np.zeros((built.model.nv,) * 2)
        mujoco.mj_fullM(built.model, state, full)
        pin.crba(model, data, q)
        upper = np.triu(data.M)
        expected = upper + np.triu(upper, 1).T + np.diag(built.model.dof_armature[:n])
        np.testing.assert_allclose(full[:n, :n], expected, atol=1e-6)
    assert built.heaviest > 1.0 > LIGHT


def test_servos_hold_a_payload_and_follow_within_their_reserve():
    scene, built = model_of("bay")
    known = list(declared(setting_of("bay", "path", 0, SERVO_PROFILES), scene).values())
    arms, rng = TorqueArms(built), np.random.default_rng(2)
    q = rng.uniform(-1.0, 1.0, 14)
    arms.start(q, rng, full=True)
    first = np.array([0, 7, 14])
    truth = Truth(rng, [driven_figures(f) for f in known], Styles.worst())
    p = plants.plant_at(q, first, truth.velocity, truth.acceleration, truth.brake)
    rows, speeds = np.zeros((2, 4000, 14))
    free = np.zeros((4000, 2), dtype=bool)
    plants.advance(p, 0, SUBSTEP, q, rows[:400], speeds[:400], free[:400])
    arms.follow(rows[:400], speeds[:400])
    # At rest the weight of what the servos do not know moves them a little.
    assert 0.0 < np.abs(rows[:400] - q).max() < 2e-3
    for arm in (0, 1):
        plants.release(p, arm)
    desired = truth.velocity * rng.choice([-1.0, 1.0], 14)
    for k in range(400, 4000, 4):
        part = slice(k, k + 4)
        if k == 2400:
            for arm in (0, 1):
                plants.order_stop(p, arm, k * SUBSTEP, truth.stop(rng.normal(size=14)))
        plants.advance(p, k, SUBSTEP, desired, rows[part], speeds[part], free[part])
        arms.follow(rows[part], speeds[part])
    stops = [Stopping(arm, 2400 * SUBSTEP, False) for arm in (0, 1)]
    as_declared = declared_of(known, truth)
    shifted = [np.vstack([r[:1], r[:-1]]) for r in (rows, speeds, free)]
    assert broken(*shifted, first, stops, as_declared) is None
    assert arms.saturated == 0


@pytest.mark.parametrize("guard", ["armguard", "filter"])
def test_arms_with_limited_torque_touch_nothing_and_need_no_brake(guard):
    plan = Plan(guard=guard, plant="torque", duration=0.7)
    found = [work((plan, seed)) for seed in range(12)]
    assert [e["broke"] for e in found] == [None] * len(found)
    assert not any(e["contact"] for e in found)
    assert sum(e["brakes"] for e in found) == 0
    assert all(e["least"] >= e["floor"] - 1e-5 for e in found)
    assert min(e["least"] for e in found) < 0.03
    assert sum(e["joint_way"] for e in found) > 5.0


def test_motors_that_are_too_weak_are_noticed():
    plan = Plan(guard="threshold", plant="torque", duration=0.5)
    arena: Arena = arena_of(plan, 0)
    limits = arena.arms.built.model.jnt_actfrcrange
    kept = limits.copy()
    try:
        limits *= 0.2
        found = [work((plan, seed)) for seed in range(0, 12, 4)]
    finally:
        limits[:] = kept
    assert any(e["broke"] for e in found)
    assert any(e["saturated"] > 0.0 for e in found)
