"""Capacitive pads: something within a ball takes knowledge away, and is no point."""

import numpy as np
import pytest

import armguard as ag
from armguard.sense.capacitive import Capacitive, reach_of, response
from armguard.sense.view import View
from armguard.simulation.sensors import Rig
from one_sensor import CELL, POSE, one_sensor

PAD = 0.03


def pad(**settings):
    return Capacitive(View(one_sensor("capacitive", **settings).sensors["eye"], 0.05))


def test_a_signal_gives_the_greatest_distance_of_a_body_that_fills_the_view():
    one = pad().sensor
    for way in (0.02, 0.08, 0.2):
        signal = float(response(one, np.array(way)))
        assert signal == pytest.approx((PAD / (PAD + way)) ** 2)
        assert reach_of(one, signal) == pytest.approx(way)
    assert reach_of(one, 1e-9) == one.range[1]
    assert reach_of(one, 2.0) == one.range[0]


def known(value=0.0, error=0.0):
    return np.array([value, error])


def test_the_own_signal_is_learned_and_drifts_no_faster_than_declared():
    made = pad(drift=0.001, noise=(1e-6, 0, 0))
    for k in range(100):
        # Twice the drift that is declared for a hundredth of it.
        assert made.take(0.5 + 0.0009 * 0.02 * k, 0.02 * k, known()) == 0.0
    assert made.take(0.5 + 0.0018 + 0.0015, 2.0, known()) > 0.0
    slow = pad(drift=0.001, noise=(1e-6, 0, 0))
    slow.take(0.5, 0.0, known())
    assert slow.take(0.5 + 0.005, 1.0, known()) > 0.0


def test_what_links_and_models_add_is_not_noticed():
    made = pad(noise=(1e-6, 0, 0))
    made.take(0.5, 0.0, known(0.1, 0.01))
    assert made.take(0.6, 0.02, known(0.2, 0.01)) == 0.0
    # Both predictions may be off by their errors.
    assert made.take(0.5 + 0.019, 0.04, known(0.1, 0.01)) == 0.0
    assert made.take(0.5 + 0.021, 0.06, known(0.1, 0.01)) > 0.0


def watched(box):
    """A rig, its pad with a map that a camera has seen free, and the scene."""
    at = ag.Pose(xyz=(0.1, 0, 0), rpy=POSE.rpy)
    scene = one_sensor("capacitive", pose=at)
    scene.add_sensor(
        "top", kind="depth", size=(64, 48), focal=40, range=(0.1, 2.0), jitter=0.0,
        period=1.0,
        pose=ag.Pose(xyz=(0.4, 0, 0.62), rpy=(np.pi, 0, 0)),
    )  # fmt: skip
    return scene, Rig(scene, boxes=[box]), ag.Sense(scene)


def test_a_box_before_the_pad_takes_knowledge_away_in_a_ball_around_it():
    scene, rig, sense = watched((0.1, 0.1, 0.1))
    period = scene.sensors["eye"].period
    for k in range(40):
        sense.joints(scene.home, 0.01 * k)
    sense.depth("top", np.full((48, 64), 1.0), 0.35)
    free, occupied = sense.cells.known_free(), sense.cells.occupied()
    assert free.sum() > 1000
    stamp, noticed = 0.4, None
    for k in range(60):
        distance = 0.3 - 0.3 * period * k
        rig.place(0, ag.Pose(xyz=(0.1 + distance + 0.05, 0, 0)))
        for _ in range(4):
            stamp += period / 4
            sense.joints(scene.home, stamp)
        value = rig.read("eye", scene.home).distance
        assert sense.capacitive("eye", value, stamp) is ag.Intake.TAKEN
        if sense.noticed:
            noticed = distance, sense.noticed["eye"]
            break
    assert noticed is not None
    distance, radius = noticed
    assert distance >= 0.08
    assert radius >= distance
    lost = sense.cells.middles(np.argwhere(free & ~sense.cells.known_free()))
    assert len(lost) > 100
    # It is a region, and no cell is occupied.
    way = np.linalg.norm(lost - (0.1, 0, 0), axis=1)
    assert way.max() < radius + 0.01 + 2 * CELL
    assert np.array_equal(sense.cells.occupied(), occupied)


def test_without_a_box_nothing_is_noticed_while_the_ball_on_the_slide_moves():
    scene, rig, sense = watched((0.1, 0.1, 0.1))
    period = scene.sensors["eye"].period
    for k in range(300):
        q = scene.home + 0.005 * (1.0 - np.cos(0.1 * k))
        sense.joints(q, period * k)
        rig.drift = 0.001 * np.sin(2 * np.pi * period * k / 200)
        value = rig.read("eye", q).distance
        sense.capacitive("eye", value, period * k)
        assert not sense.noticed
