"""Simulated arms are late and inexact, but never more than their figures say."""

import numpy as np
import pytest

from armguard.errors import SceneError
from armguard.guard.levels import Level
from armguard.respond import Action, Guard
from armguard.scene import Scene, bay_scene
from armguard.simulation import PERFECT, Imperfection, Plant
from arms import simple_arm

SCENE = bay_scene("path")
COMMAND = SCENE.robots["left"].stopping.command
WISH = np.full(14, 0.1)


def test_orders_take_effect_after_their_delay_and_not_before():
    plant = Plant(SCENE, imperfection=Imperfection(errors=0.0, lateness=1.0))
    plant.advance(COMMAND, WISH)
    assert (plant.q == SCENE.home).all()
    plant.advance(0.001)
    assert (plant.v > 0.0).all()


def test_what_was_commanded_before_now_is_obeyed_from_now_on():
    plant = Plant(SCENE, imperfection=PERFECT)
    plant.advance(0.5)
    plant.send(WISH, {}, at=0.1)
    plant.advance(0.001)
    assert plant.v == pytest.approx(0.008)


def test_each_arm_obeys_its_own_action():
    plant = Plant(SCENE, imperfection=PERFECT)
    plant.advance(0.2, WISH)
    plant.advance(0.4, WISH, {"left": Action.STOP, "right": Action.FOLLOW})
    assert plant.held == {"left": True, "right": False}
    assert not plant.v[:7].any() and plant.v[7:] == pytest.approx(0.1)


def test_the_brake_comes_after_its_own_delay():
    figures = SCENE.robots["left"].stopping
    plant = Plant(SCENE, imperfection=PERFECT)
    plant.advance(0.2, np.full(14, 0.5))
    plant.send(np.zeros(14), dict.fromkeys(SCENE.robots, Action.BRAKE))
    plant.advance(figures.brake_delay)
    slowed = plant.v.copy()
    plant.advance(0.001)
    lost = slowed - plant.v
    assert lost == pytest.approx(0.001 * figures.brake_deceleration[0])


def test_the_same_seed_moves_the_same_to_the_bit():
    def run(seed):
        plant = Plant(SCENE, imperfection=Imperfection(seed=seed))
        rows = []
        for _ in range(200):
            plant.advance(0.004, WISH)
            rows.append(np.concatenate([plant.q, *plant.measure()]))
        return np.array(rows)

    assert (run(3) == run(3)).all()
    assert (run(3) != run(4)).any()


def test_errors_stay_within_what_is_declared():
    figures = SCENE.robots["left"].stopping
    plant = Plant(SCENE, imperfection=Imperfection(errors=1.0, lateness=1.0))
    for _ in range(500):
        plant.advance(0.004, WISH)
        q, v = plant.measure()
        assert (np.abs(q - plant.q) <= figures.position_error[0]).all()
        assert (np.abs(v - plant.v) <= figures.velocity_error[0]).all()
        if plant.time > 0.1:
            missed = np.abs(plant.v - WISH)
            assert 0.0 < missed.max() <= figures.tracking_error[0] + 1e-12


def test_an_arm_that_is_held_does_not_drift():
    plant = Plant(SCENE, imperfection=Imperfection(errors=1.0))
    for _ in range(100):
        plant.advance(0.01, np.zeros(14))
    assert (plant.q == SCENE.home).all()
    assert not plant.measure()[1].any()


def test_an_arm_rests_at_its_end_stops_and_can_be_led_away_again():
    plant = Plant(SCENE, imperfection=PERFECT)
    for _ in range(2):
        plant.advance(6.0, np.eye(14)[0])
        assert (plant.q[0], plant.v[0]) == (3.05, 0.0)
    plant.advance(0.5, -0.1 * np.eye(14)[0])
    assert plant.q[0] == pytest.approx(3.0, abs=0.001)


def test_a_stop_that_comes_too_late_ends_at_the_end_stop():
    plant = Plant(SCENE, imperfection=PERFECT)
    plant.advance(3.0, np.eye(14)[0])
    plant.advance(1.0, np.zeros(14), dict.fromkeys(SCENE.robots, Action.STOP))
    assert plant.held["left"]
    assert (plant.q[0], plant.v[0]) == (3.05, 0.0)


def test_an_arm_that_a_late_machine_let_run_on_is_engaged_and_led_back():
    scene = bay_scene("path")
    near_limit = scene.home.copy()
    near_limit[0] = 2.9
    plant = Plant(scene, q=near_limit)
    guard = Guard(scene, self_test=False)

    def cycle(speed, gap=0.004):
        q, v = plant.measure()
        command = guard.filter(q, speed * np.eye(14)[0], plant.time, velocity=v)
        plant.advance(gap, command.velocity, command.actions)
        return command

    for _ in range(40):
        cycle(1.0)
    cycle(1.0, gap=0.5)
    assert cycle(0.0).verdict.level >= Level.STOP
    for _ in range(400):
        cycle(0.0)
    guard.engage()
    for _ in range(250):
        last = cycle(-0.2)
    assert not last.held, last.why
    assert plant.q[0] < 2.95


def test_a_robot_without_figures_is_refused_in_words():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(), name="arm")
    with pytest.raises(SceneError, match="robot 'arm' has no stopping figures"):
        Plant(scene)
