"""What a verdict says where stops are predicted: sums, scales, who yields, ages."""

import json
import re

import numpy as np
import pytest

from approach import (
    FIGURES,
    PERIOD,
    angle_at,
    ball_guard,
    ball_scene,
    gap_of,
    moving,
    moving_bay,
)
from armguard.cli.stopping import stopping_findings
from armguard.geometry import Capsule, Pose
from armguard.guard import EventLog, Level, Reason
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm
from sliding import APART, EXACT, at_gap, slide

# Where the second arm is fixed, and how it is turned [m], [rad].
SECOND, TURN = (1.3, 0.7, 0.0), -2.0


def terms_of(sentence):
    """Total and terms of "must keep 12.3 mm: floor 5.0 + ...; 0.1 mm ..." [mm]."""
    total, sum_of = re.fullmatch(r"must keep ([\d.]+) mm: (.*)", sentence).groups()
    sum_of, _, returned = sum_of.partition("; ")
    terms = {name: float(v) for name, v in re.findall(r"([a-z]+) (\d+\.\d)", sum_of)}
    if returned:
        opens, way = re.match(r"(the pair opens: )?([\d.]+) mm", returned).groups()
        terms["path"] = -float(way)
        assert bool(opens) == (sum(terms.values()) < terms["floor"] - 1e-9)
        assert bool(opens) == (f"floor {terms['floor']} mm stays" in returned)
    return float(total), terms


def test_a_sentence_sums_to_its_total_in_200_states_of_the_bay():
    guard = Guard(moving_bay())
    rng = np.random.default_rng(5)
    low, high = guard.tables.lower, guard.tables.upper
    reported = opened = 0
    while reported < 200:
        guard.reset()
        q = np.clip(guard.home + rng.normal(0.0, 0.6, guard.home.shape), low, high)
        v = rng.uniform(-0.5, 0.5, q.shape)
        # A joint at its limit does not move on.
        v[(q + 2 * v * PERIOD < low) | (q + 2 * v * PERIOD > high)] = 0.0
        for k in range(3):
            verdict = guard.step(
                np.clip(q + k * v * PERIOD, low, high),
                k * PERIOD,
                velocity=v if k else 0.0 * v,
                now=k * PERIOD,
            )
        if verdict.budget is None:
            continue
        reported += 1
        total, terms = terms_of(verdict.budget.sentence)
        sum_of = max(sum(terms.values()), terms["floor"])
        assert sum_of == pytest.approx(total, abs=0.01)
        needed = max(verdict.budget.needed, verdict.budget.floor)
        assert total == pytest.approx(needed * 1e3, abs=0.051)
        text = verdict.explain()
        assert f"must keep {total} mm" in text
        rows = re.findall(r"^ +([\d.]+) mm  ([a-z]+): ", text, re.MULTILINE)
        assert {n: float(v) for v, n in rows} == {
            n: v for n, v in terms.items() if v > 0.0
        }
        opened += terms.get("path", 0.0) < 0.0
        nearest = verdict.nearest
        assert nearest.headroom == pytest.approx(
            nearest.distance - verdict.budget.needed, abs=1e-12
        )
        json.dumps(verdict.to_dict(), allow_nan=False)
    assert opened


def test_a_scale_lies_in_0_to_1_and_falls_with_the_time_that_is_left():
    guard = ball_guard()
    guard.step([-1.0], 0.0, velocity=[0.0])
    q, speed, seen = -1.0, 0.8, []
    for k in range(1, 2000):
        q += speed * PERIOD
        verdict = guard.step([q], k * PERIOD, velocity=[speed])
        seen.append((verdict.headroom.s, verdict.speed_scale["arm"]))
        if verdict.level >= Level.STOP:
            break
    assert verdict.level is Level.STOP
    slack, scale = np.array(seen).T
    assert scale.min() == 0.0
    assert scale.max() == 1.0
    order = np.argsort(slack)
    assert np.all(np.diff(scale[order]) >= 0.0)
    assert scale[np.argmax(slack < 0.1) - 1] == 1.0


def second_arm(scene, kind):
    """Something of the same shape: an arm that is parked, or an object."""
    if kind == "arm":
        scene.add_robot(
            simple_arm(joints=1, length=1.0),
            name="right",
            base=Pose(xyz=SECOND),
            stopping=FIGURES,
            home={"joint1": TURN},
        )
        return
    x, y = np.cos(TURN), np.sin(TURN)
    scene.add(
        Capsule(start=(0.1 * x, 0.1 * y, 0), end=(x, y, 0), radius=0.04),
        name="right",
        pose=Pose(xyz=(*SECOND[:2], 0.2)),
    )


def passing(kind, speed=0.5, cycles=1400):
    """Verdicts of an arm that comes up to a second one and stops when it must."""
    scene = Scene(mode="path", margin=1.0)
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="left",
        stopping=FIGURES,
        home={"joint1": -1.0},
    )
    second_arm(scene, kind)
    guard = Guard(scene)
    q, v = guard.home, np.zeros_like(guard.home)
    guard.step(q, 0.0, velocity=v)
    v[0] = speed
    verdicts = []
    for k in range(1, cycles):
        q[0] += v[0] * PERIOD
        verdicts.append(guard.step(q, k * PERIOD, velocity=v))
        if verdicts[-1].levels["left"] >= Level.STOP:
            v[0] = max(v[0] - FIGURES["deceleration"] * PERIOD, 0.0)
    return verdicts


@pytest.fixture(scope="module")
def met():
    return passing("arm")


def test_a_parked_arm_never_stops_for_one_that_comes(met):
    assert any(v.levels["left"] is Level.STOP for v in met)
    assert max(v.levels["right"] for v in met) < Level.STOP
    assert all("right" not in v.causes for v in met)
    assert min(p.distance for v in met for p in v.near) > 0.0


def test_the_one_that_comes_loses_no_speed_until_its_own_stop_is_near(met):
    for verdict in met:
        if verdict.headroom.s >= 0.1 and verdict.levels["left"] < Level.STOP:
            assert verdict.speed_scale["left"] == 1.0
    first = next(k for k, v in enumerate(met) if v.speed_scale["left"] < 1.0)
    alone = passing("post")
    as_alone = next(k for k, v in enumerate(alone) if v.speed_scale["left"] < 1.0)
    # An object that cannot move costs the same, to within what a parked arm's errors
    # may make of a few millimetres.
    assert abs(first - as_alone) * PERIOD * 0.5 < 0.005


def test_a_parked_arm_may_move_at_full_speed_while_another_one_comes(met):
    assert min(v.speed_scale["right"] for v in met) == 1.0


@pytest.mark.parametrize("delay", [0.004, 0.010, 0.020])
def test_age_grows_the_need_by_speed_times_delay(delay):
    # At top speed nothing speeds up meanwhile: the need grows by the way alone.
    top = 0.5
    guard = ball_guard(velocity=top)
    old, aged = FIGURES["sensing"], FIGURES["sensing"] + delay
    fresh = moving(guard, 0.06, top, age=old)
    late = moving(guard, 0.06, top, age=aged)
    assert late.ages["arm"] == pytest.approx(aged, abs=1e-9)
    grown = late.budget.needed - fresh.budget.needed
    # Reported before it binds, the need is that of the fastest point, one metre out.
    assert grown == pytest.approx(1.0 * top * delay, abs=1e-3)
    # Where it binds it is that of the points that would meet.
    binds = [gap_of(guard, top, 0.0, age=age) for age in (old, aged)]
    assert binds[1] - binds[0] == pytest.approx(0.69 * top * delay, abs=1e-3)
    lever = np.hypot(*late.nearest.point_a[:2])
    assert late.budget.reaction - fresh.budget.reaction == pytest.approx(
        lever * top * delay, abs=1e-3
    )


def test_the_age_of_one_arm_is_its_own():
    scene = Scene(mode="path", margin=2.0)
    for name, x, turn in (("left", 0.0, 0.3), ("right", 2.3, 0.0)):
        scene.add_robot(
            simple_arm(joints=1, length=1.0),
            name=name,
            base=Pose(xyz=(x, 0, 0), rpy=(0, 0, np.pi if x else 0)),
            stopping=FIGURES,
            home={"joint1": turn},
        )
    guard = Guard(scene)
    needs = []
    top = FIGURES["velocity"]
    v = np.array([-top, 0.0])
    for delay in (0.0, 0.010):
        guard.reset()
        now = 0.1
        stamps = {"left": now - 0.003 - delay, "right": now - 0.003}
        before = {name: stamp - PERIOD for name, stamp in stamps.items()}
        guard.step([1.2, 0.0], before, velocity=[0.0, 0.0], now=now - PERIOD)
        verdict = guard.step([1.2 - top * PERIOD, 0.0], stamps, velocity=v, now=now)
        assert verdict.ages == pytest.approx({"left": 0.003 + delay, "right": 0.003})
        needs.append(verdict.budget)
    grown = needs[1].reaction_a - needs[0].reaction_a
    lever = np.hypot(*(verdict.nearest.point_a[:2]))
    closing = abs(verdict.nearest.normal @ np.array([0.0, 1.0, 0.0]))
    assert 0.0 < grown <= top * lever * 0.010 + 1e-3
    assert needs[1].reaction_b == pytest.approx(needs[0].reaction_b, abs=1e-12)
    assert closing > 0.0


def test_a_slow_names_its_pair_with_the_margin_as_it_comes():
    guard = Guard(ball_scene(settings={"margin": None}))
    verdict = moving(guard, 0.15, 1.0)
    assert verdict.level is Level.SLOW
    left = verdict.nearest.time_left * 1e3
    said = f"arm/link1 150 mm from ball: slowing, stop needed in {left:.0f} ms"
    assert verdict.why == said


def test_the_events_of_an_approach_rise_and_the_stop_is_one_up_to_the_rest():
    guard, log = ball_guard(settings={"margin": 0.3}), EventLog()
    guard.step([-1.0], 0.0, velocity=[0.0])
    q, speed = -1.0, 0.8
    for k in range(1, 2500):
        q = min(q + speed * PERIOD, angle_at(0.0051))
        verdict = guard.step([q], k * PERIOD, velocity=[speed])
        log.add(verdict)
        if verdict.levels["arm"] >= Level.STOP:
            speed = max(speed - FIGURES["deceleration"] * PERIOD, 0.0)
        if speed == 0.0 and verdict.level is not Level.STOP:
            break
    levels = [event.level for event in log.events]
    assert levels == sorted(levels) and levels[-1] is Level.STOP
    event = log.events[-1]
    assert (event.a, event.b) == ("arm/link1", "ball")
    assert event.reason in (Reason.TOO_CLOSE, Reason.NO_PROOF)
    assert log.faults == 0
    assert log.levels[Level.SLOW] > 0 < log.levels[Level.STOP]
    json.dumps(event.to_dict(), allow_nan=False)


def test_a_stop_that_lags_names_the_joint():
    guard, log = ball_guard(), EventLog()
    guard.step([-1.0], 0.0, velocity=[0.0])
    q = -1.0
    for k in range(1, 2500):
        q += 0.8 * PERIOD
        verdict = guard.step([q], k * PERIOD, velocity=[0.8])
        log.add(verdict)
        if verdict.level >= Level.BRAKE:
            break
    assert verdict.level is Level.BRAKE
    assert verdict.subject == "arm/joint1"
    said = "brake, the stop was slower than declared; removing power"
    assert verdict.why == f"'arm/joint1': {said}"
    assert log.events[-1].a == "arm/joint1"
    assert log.faults == 0


def test_what_is_forgotten_are_causes_too():
    used, fresh = ball_guard(), ball_guard()
    used.step([np.nan], 0.0, velocity=[0.0])
    used.reset()
    a = used.step([-1.0], 0.0, velocity=[0.0])
    b = fresh.step([-1.0], 0.0, velocity=[0.0])
    assert a.tobytes() == b.tobytes()


def test_beside_a_fixed_robot_it_is_said_that_nothing_is_proven_of_its_motion():
    scene = Scene(margin=1.0)
    scene.add_robot(slide(), name="left", stopping=EXACT, mode="path")
    away = Pose(xyz=(APART, 0.0, 0.0))
    scene.add_robot(slide(), name="right", base=away, stopping=EXACT, mode="fixed")
    guard = Guard(scene, self_test=False)
    q = at_gap(0.5, 2)
    verdict = guard.step(q, 5.0, velocity=[0.0, 1.0])
    assert verdict.unbounded == ("right",)
    (line,) = [k for k in verdict.explain().splitlines() if k.startswith("right: ")]
    assert line.startswith("right: CAUTION, speed 100%, ")
    assert line.endswith(", nothing is proven about its motion, mode fixed")
    assert verdict.to_dict()["unbounded"] == ["right"]
    left, right = stopping_findings(scene)
    assert "nothing is proven" not in left.sentence
    assert right.status == "WARN"
    assert "nothing is proven about its motion" in right.sentence
