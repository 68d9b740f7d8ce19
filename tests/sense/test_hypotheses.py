"""Votes for another place or time of a sensor, and for the declared one."""

import numpy as np
import pytest

import armguard as ag
from armguard.geometry.pose import Pose
from armguard.scene.two_pandas import sensed_table_path
from armguard.sense import Fault
from armguard.sense.frames import Frame
from armguard.sense.hypotheses import LAGS, Hypotheses
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View
from armguard.simulation.sensed import sensed_bay
from armguard.simulation.sensors import Rig

SENSOR = sensed_bay(camera=False).sensors["left_ring/1"]
VIEW = View(SENSOR, 0.05, 0.025)
REST = Mount(np.eye(3), np.zeros(3), 0.0, 0.0)


def predicted(depth):
    """A prediction of depths, each of one surface, shape (8, 8)."""
    depth = np.broadcast_to(depth, (8, 8)).reshape(-1)
    zones = np.stack([depth, depth, np.zeros(64), np.zeros(64)], axis=1)
    return Prediction(zones)


def frame(depth):
    """A frame of depths, of which infinite ones are nothing within range."""
    depth = np.broadcast_to(depth, (8, 8))
    seen = np.isfinite(depth)
    none = np.zeros((8, 8), dtype=bool)
    return Frame(np.where(seen, depth, np.nan), seen, ~seen, none)


def found(frames, declared, others=((),)):
    """What is accepted of frames, by what is predicted at the declared place."""
    tests = Hypotheses(VIEW, [f"other/{k}" for k in range(len(others[0]))])
    out = []
    for k, (depth, own) in enumerate(zip(frames, declared, strict=True)):
        there = [predicted(one) for one in others[k % len(others)]]
        now = k * SENSOR.period
        out.append(tests.test(frame(depth), REST, predicted(own), there, now))
    return out


RELIEF = 0.5 + 0.05 * np.arange(64).reshape(8, 8) % 0.7


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (lambda d: d[:, ::-1], "columns reversed"),
        (lambda d: d[::-1], "rows reversed"),
        (lambda d: d[::-1, ::-1], "turned by 180 degrees"),
        (np.transpose, "rows and columns exchanged"),
        (np.rot90, "turned by 90 degrees"),
        (lambda d: np.rot90(d, -1), "turned by -90 degrees"),
        (lambda d: d[::-1, ::-1].T, "rows and columns exchanged and reversed"),
    ],
)
def test_each_image_of_a_grid_is_named(image, words):
    accepted = found([image(RELIEF)] * 2, [RELIEF] * 2)
    assert accepted[0] == (Fault.MOVED, words)


@pytest.mark.parametrize("lag", range(1, LAGS + 1))
def test_a_delay_is_named_with_its_size(lag):
    # One half of the view comes nearer, the other one goes away.
    sign = np.where(np.arange(8) < 4, 1.0, -1.0)
    depths = [1.2 + 0.06 * k * sign for k in range(12)]
    accepted = found([depths[max(k - lag, 0)] for k in range(12)], depths)
    assert accepted[-1] == (Fault.DELAYED, f"{1e3 * lag * SENSOR.period:.0f} ms")


def test_a_wrong_model_is_no_delay():
    # The surface is 60 mm farther than its model, and comes and goes.
    way = np.abs(np.arange(40) % 20 - 10) * 0.06
    depths = [np.full((8, 8), 0.6 + one) for one in way]
    assert not any(found([one + 0.06 for one in depths], depths))


def test_another_place_is_named_only_after_predictions_have_changed():
    # An unknown body before the sensor has the distance that another one has to see.
    own = [np.full((8, 8), 2.0)] * 12
    still = [np.full((8, 8), 0.3)] * 12
    assert not any(found(still, own, others=[(0.3,)]))
    moving = [0.3 + 0.04 * k for k in range(12)]
    accepted = found(moving, own, others=[(one,) for one in moving])
    assert accepted[-1] == (Fault.MOVED, "its distances are those of other/0")


def test_a_place_that_explains_too_few_zones_is_not_accepted():
    # A quarter of the view has other distances than both places.
    own = [np.full((8, 8), 2.0)] * 12
    moving = [0.3 + 0.04 * k for k in range(12)]
    depths = [np.where(np.arange(8) < 3, 1.0, one) for one in moving]
    assert not any(found(depths, own, others=[(one,) for one in moving]))


def test_nothing_in_view_is_no_evidence_of_another_place():
    own = [1.0 + 0.04 * k for k in range(12)]
    assert not any(found([np.inf] * 12, own, others=[(np.inf,)]))


def test_a_sensor_that_is_in_order_again_is_accepted_as_such():
    mirrored = RELIEF[:, ::-1]
    # Two zones with an unknown body have the distances of the mirrored view.
    body = RELIEF.copy()
    body[0, :2] = mirrored[0, :2]
    frames = [*[mirrored] * 60, *[RELIEF] * 30, body]
    accepted = found(frames, [RELIEF] * len(frames))
    assert all(accepted[:60])
    assert not any(accepted[60:])


def test_a_frame_without_evidence_is_no_sign():
    # Most of its distances are invalid, and two are of an unknown body.
    tests, lost = Hypotheses(VIEW, []), np.full((8, 8), np.nan)
    lost[3, 3:5] = 0.2
    own = predicted(RELIEF)
    assert tests.test(frame(RELIEF[:, ::-1]), REST, own, (), 0.0)
    seen = np.isfinite(lost)
    none = np.zeros((8, 8), dtype=bool)
    assert not tests.test(Frame(lost, seen, none, none), REST, own, (), 0.1)


def test_a_delay_is_not_seen_on_one_side_alone():
    # Surfaces only come nearer, as those of a model that is too large may do.
    depths = [1.8 - 0.06 * k for k in range(16)]
    assert not any(found([depths[max(k - 1, 0)] for k in range(16)], depths))


def test_the_same_evidence_counts_once():
    # At rest four zones see a place too near and four too far, as if mirrored.
    own = np.full((8, 8), 1.0)
    own[:4, 7] = 1.5
    assert not any(found([own[:, ::-1]] * 60, [own] * 60))
    # More of them are enough, for as long as they are seen.
    own[:, 5:] = 1.5
    assert all(found([own[:, ::-1]] * 60, [own] * 60))


@pytest.mark.parametrize(("rows", "accepted"), [(3, False), (4, True)])
def test_votes_against_count_on_both_sides(rows, accepted):
    # Two columns differ in four rows, of which some are mirrored.
    declared, depths = [], []
    for k in range(12):
        own = np.full((8, 8), 1.0)
        own[:4, 0], own[:4, 7] = 1.1 + 0.05 * k, 1.4 + 0.05 * k
        depth = own.copy()
        depth[:rows] = own[:rows, ::-1]
        declared.append(own)
        depths.append(depth)
    assert any(found(depths, declared)) == accepted


def test_a_body_that_another_prediction_passes_again_and_again_is_no_evidence():
    nothing = [np.full((8, 8), np.inf)] * 30
    assert not any(found([0.3] * 30, nothing, others=[(0.3,), (np.inf,)]))


@pytest.mark.parametrize("seed", [2, 3, 7])
def test_a_paused_camera_above_resting_arms_is_in_order(seed):
    # The view of two arms face to face is nearly its own image, turned by 180 degrees.
    # Fits enclose the links, so a few pixels look past them, the same in each image.
    scene = ag.load_scene(sensed_table_path())
    rig, sense = Rig(scene, [(0.15, 0.12, 0.2)]), ag.Sense(scene)
    rig.place(0, Pose(xyz=(0.0, 0.25, 0.1)))
    rng = np.random.default_rng(seed)
    rest = scene.home + rng.uniform(-0.015, 0.015, len(scene.home))
    for k in range(400):
        stamp = 0.01 * k
        q = rest + 0.06 * np.sin(2.6 * min(stamp - 1.0, 0.0))
        sense.joints(q, stamp)
        paused = 0.5 < stamp < 1.5
        if k % 10 == 5 and not paused:
            sense.depth("top", rig.read("top", q).distance, stamp)
    past = {one.fault for one in sense.health["top"].past}
    assert past | set(sense.health["top"].faults) <= {Fault.SILENT}
