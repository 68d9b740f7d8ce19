"""Velocities that contradict positions over time are named; declared errors never."""

import numpy as np
import pytest

from armguard.guard import Level, Reason
from armguard.guard.watch import STOPPING
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm
from sliding import let_go

PERIOD = 1e-3

# Longest motion until a contradiction is named [s].
SOON = 0.08

FIGURES = {
    "velocity": 2.0,
    "acceleration": 8.0,
    "deceleration": 4.0,
    "position_error": 1e-4,
    "velocity_error": 0.01,
    "sensing": 0.002,
    "command": 0.004,
    "stale": 0.02,
}

# When a contradiction begins [s]; both joints move evenly by then.
BEGIN = 0.6


def two_joints(**more):
    """A guard of an arm with two joints, far from anything."""
    scene = Scene(period=PERIOD)
    scene.add_robot(simple_arm(joints=2), name="arm", stopping={**FIGURES, **more})
    guard = Guard(scene, self_test=False)
    let_go(guard)
    return guard


def motion(t, speeds=(0.3, -0.1)):
    """Positions and velocities of joints that got up to speed in 0.2 s."""
    v = np.array(speeds)
    rise = min(t, 0.2)
    return v * (t - rise + 2.5 * rise * rise), v * min(5.0 * t, 1.0)


def frozen(t):
    """Where everything was when the contradiction began."""
    return motion(min(t, BEGIN))


# What is measured from `BEGIN` on, by the time; and the reasons that may be given.
DISAGREES = {Reason.STATE_DISAGREES}
KINDS = {
    "velocities stuck at 0": (lambda t: (motion(t)[0], np.zeros(2)), DISAGREES),
    "velocities stuck at half": (
        lambda t: (motion(t)[0], 0.5 * motion(BEGIN)[1]),
        DISAGREES,
    ),
    "a velocity of the wrong sign": (
        lambda t: (motion(t)[0], motion(t)[1] * (-1.0, 1.0)),
        DISAGREES,
    ),
    "velocities half as large": (
        lambda t: (motion(t)[0], 0.5 * motion(t)[1]),
        DISAGREES,
    ),
    "velocities twice as large": (
        lambda t: (motion(t)[0], 2.0 * motion(t)[1]),
        DISAGREES,
    ),
    "velocities in degrees": (
        lambda t: (motion(t)[0], np.degrees(motion(t)[1])),
        {*DISAGREES, Reason.TOO_FAST},
    ),
    "velocities of the other joint": (
        lambda t: (motion(t)[0], motion(t)[1][::-1]),
        DISAGREES,
    ),
    "a velocity that is off": (
        lambda t: (motion(t)[0], motion(t)[1] + (0.03, 0.0)),
        DISAGREES,
    ),
    "positions stand still": (
        lambda t: (frozen(t)[0], motion(t)[1]),
        {Reason.STATE_FROZEN},
    ),
    "everything stands still": (frozen, {Reason.STATE_FROZEN}),
    "positions half as far": (
        lambda t: (0.5 * (frozen(t)[0] + motion(t)[0]), motion(t)[1]),
        DISAGREES,
    ),
    "a position that goes back": (
        lambda t: (2.0 * frozen(t)[0] - motion(t)[0], motion(t)[1]),
        DISAGREES,
    ),
    "positions of the other joint": (
        lambda t: (motion(t)[0][::-1], motion(t)[1]),
        {*DISAGREES, Reason.STATE_JUMPED},
    ),
    "positions that creep": (
        lambda t: (motion(t)[0] + 0.03 * (t - min(t, BEGIN)), motion(t)[1]),
        DISAGREES,
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_contradiction_is_named_within_80_ms_of_motion(kind):
    wrong, reasons = KINDS[kind]
    guard = two_joints()
    for k in range(1, 800):
        t = k * PERIOD
        q, v = wrong(t) if t > BEGIN + 1e-9 else motion(t)
        verdict = guard.step(q, 5.0 + t - 0.001, velocity=v, now=5.0 + t)
        if verdict.reason is not Reason.OK:
            break
    assert BEGIN < t <= BEGIN + SOON
    assert verdict.reason in reasons
    assert verdict.level is Level.STOP
    assert verdict.joint in guard.q_names
    assert verdict.why.startswith("joint 'arm/joint")


@pytest.mark.parametrize("skew", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_errors_at_their_limits_are_no_contradiction(skew, sign):
    """Also where velocities are half a period off their positions."""
    guard = two_joints()
    rng = np.random.default_rng(int(10 * skew) + 7)
    q, v, aim, before = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    age = 0.0
    for k in range(4000):
        now = 5.0 + k * PERIOD
        if k % 150 == 0:
            aim = rng.uniform(-1.5, 1.5, 2)
            aim = np.where(np.abs(q) > 1.0, -np.sign(q) * np.abs(aim), aim)
        later = rng.uniform(0.0, 0.9 * PERIOD)
        time = PERIOD + age - later
        most = FIGURES["acceleration"] * time
        change = np.clip(aim - v, -most, most)
        push = change / time if skew > 0.0 else before
        verdict = guard.step(
            q + FIGURES["position_error"] * (-1.0) ** k,
            now - age,
            velocity=v + skew * PERIOD * push + sign * FIGURES["velocity_error"],
            now=now,
        )
        assert verdict.reason is Reason.OK, (k, verdict.why)
        q, v, before, age = (
            q + (v + 0.5 * change) * time,
            v + change,
            change / time,
            later,
        )


def test_just_inside_the_limit_is_believed_and_just_outside_is_not():
    """A velocity that is off: by its error and half a period's push, twice."""
    period = PERIOD
    within = FIGURES["velocity_error"] + FIGURES["acceleration"] * period
    for share in (0.97, 1.3):
        guard = two_joints()
        named = False
        for k in range(2000):
            t = k * period
            q = np.array([0.1 * t, 0.0])
            v = np.array([0.1 + share * within, 0.0])
            verdict = guard.step(q, 5.0 + t, velocity=v, now=5.0 + t)
            named |= verdict.reason is Reason.STATE_DISAGREES
        assert named == (share > 1.0)


def test_a_hard_stop_is_no_contradiction():
    """Where it is unknown how hard stops are, one may end within a period."""
    guard = two_joints(deceleration_most=np.inf)
    for k in range(200):
        t = k * PERIOD
        q, v = motion(min(t, 0.1))
        v = v * (t <= 0.1)
        verdict = guard.step(q, 5.0 + t, velocity=v, now=5.0 + t)
        assert verdict.reason is Reason.OK, verdict.why


def test_one_wrong_velocity_does_not_make_a_liar_of_a_stop():
    """In the middle of a stop as declared, one sample says that the joint rests."""
    guard, order = two_joints(), 300
    for k in range(500):
        now, since = 5.0 + k * PERIOD, (k - order) * PERIOD - 0.004
        q, v = motion(min(k * PERIOD, order * PERIOD + 0.004))
        left = np.maximum(np.abs(v) - 4.0 * max(since, 0.0), 0.0)
        time = (np.abs(v) - left) / 4.0
        q = q + np.sign(v) * (np.abs(v) * time - 2.0 * time * time)
        v = np.sign(v) * left
        if k == order:
            q = q * np.nan
        if k == order + 30:
            v = 0.0 * v
        verdict = guard.step(q, now, velocity=v, now=now)
        assert verdict.level <= Level.STOP, (k, verdict.why)
    assert not guard._watch.disproved.any()


@pytest.mark.parametrize("swing", [0.0, 0.05])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_joint_that_stops_speeds_up_by_more_than_its_errors_and_its_swing(
    sign, swing
):
    """By its error and half a period's push, twice; a swing also turns it round."""
    figures = {**FIGURES, "position_error": 0.05, "settle": swing, "settle_time": 10.0}
    figures["deceleration_most"] = 8.0
    most = FIGURES["velocity_error"] + FIGURES["acceleration"] * PERIOD
    most = 2.0 * most + np.sqrt(2.0 * 8.0 * swing)
    for before in (0.0, 0.2):
        for share in (0.99, 1.01):
            guard, still = two_joints(**figures), np.zeros(2)
            guard.step(still, 5.0, velocity=[sign * before, 0.0], now=5.0)
            guard._watch.phase[0] = STOPPING
            now, speed = 5.0 + PERIOD, sign * (before + share * most)
            verdict = guard.step(still, now, velocity=[speed, 0.0], now=now)
            assert (verdict.reason is Reason.STATE_DISAGREES) == (share > 1.0)


@pytest.mark.parametrize("what", ["q", "velocity"])
def test_a_stamp_that_is_not_new_brings_nothing_new(what):
    guard = two_joints()
    given = {"q": np.zeros(2), "velocity": np.zeros(2)}
    for k in range(3):
        now = 5.0 + k * PERIOD
        verdict = guard.step(given["q"], 5.0, velocity=given["velocity"], now=now)
        assert verdict.reason is Reason.OK
    given[what] = np.array([0.0, 1e-6])
    now = 5.0 + 3 * PERIOD
    verdict = guard.step(given["q"], 5.0, velocity=given["velocity"], now=now)
    assert verdict.reason is Reason.STAMP_REPEATED
    assert verdict.subject == "arm/joint2"


def test_a_robot_that_swings_after_its_stop_contradicts_nothing():
    guard = two_joints(settle=0.01, settle_time=0.2)
    fault = 300
    for k in range(700):
        now = 5.0 + k * PERIOD
        q, v = motion(k * PERIOD)
        if k > fault:
            # It stops within 4 ms + 50 ms and swings out and back.
            since = (k - fault) * PERIOD
            base, speed = motion(fault * PERIOD)
            run = min(since, 0.004)
            left = max(speed[0] - 8.0 * max(since - 0.004, 0.0), 0.0)
            brakes = min(max(since - 0.004, 0.0), speed[0] / 8.0)
            way = speed[0] * run + speed[0] * brakes - 4.0 * brakes * brakes
            swing = max(since - 0.004 - speed[0] / 8.0, 0.0)
            out = 0.0015 * np.sin(np.pi * min(swing / 0.1, 1.0)) ** 2
            rate = 0.0015 * np.pi / 0.1 * np.sin(2 * np.pi * min(swing / 0.1, 1.0))
            q = base + np.array([way + out, 0.0])
            v = np.array([left + (rate if swing < 0.1 else 0.0), 0.0])
            q[1], v[1] = base[1] - 0.1 * min(since, 0.004), 0.0
        if k == fault:
            q = [np.nan, 0.0]
        verdict = guard.step(q, now, velocity=v, now=now)
        assert verdict.reason not in DISAGREES, (k, verdict.why)
