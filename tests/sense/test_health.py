"""Faults of sensors are named within a second of motion, and healthy ones are not."""

import numpy as np
import pytest

import armguard as ag
from armguard.sense import Fault
from armguard.sense.frames import frame_of
from armguard.sense.health import FrameTests, SensorHealth
from armguard.sense.prediction import Mount, Prediction
from armguard.sense.view import View
from armguard.simulation.sensed import drive, sensed_bay, swing
from armguard.simulation.sensors import Rig, mounted
from sensor_faults import KINDS

NAME = "left_ring/1"

# When a fault begins [s].
BEGIN = 1.0


def watched(tamper=None, seconds=1.0, change=None, without=(), zones=True, speed=1.5):
    """Faults that are found before a fault begins, and after it with their times."""
    scene = sensed_bay(zones=zones, camera=not zones or without != ())
    sense, rig = ag.Sense(scene), Rig(scene, without=without)
    rig.invalid = 0.1
    found = {}

    def each(t, _):
        for name, health in sense.health.items():
            for fault in health.faults:
                found.setdefault((name, fault), t)
        for name, since in sense.missing.items():
            found.setdefault(name, since)

    drive(sense, rig, swing(scene, speed), BEGIN, each=each)
    before = dict(found)
    if change is not None:
        change(rig, scene)
    drive(
        sense, rig, swing(scene, speed), seconds, start=BEGIN, each=each,
        tamper=tamper,
    )  # fmt: skip
    return before, {k: t for k, t in found.items() if k not in before}, sense


# Faults in the frames of a zone sensor.
CASES = [
    name
    for name, kind in KINDS.items()
    if not kind.camera and Fault.MOVED not in kind.named
]

# Faults of which a sensor's frames are used, as far as they come.
TRUSTED = ("silent", "four of five frames lost", "120 ms late")


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_named_within_a_second(case):
    kind = KINDS[case]
    injected = kind.make(sensed_bay(), NAME, np.random.default_rng(5))
    before, after, sense = watched(injected.tamper)
    assert before == {}
    assert {name for name, _ in after} == {NAME}
    found = {fault for _, fault in after}
    assert found & kind.named
    health = sense.health[NAME]
    assert health.faults or case == "frame repeated"
    if case not in TRUSTED:
        assert not health.trusted
        # 15 of its frames are of before.
        assert health.intakes[ag.Intake.TAKEN] < 29


@pytest.mark.parametrize(
    ("offset", "millimetres", "degrees"),
    [({"xyz": (0.03, 0.02, 0.01)}, 37.4, 0.0), ({"rpy": (0.1, 0.0, 0.0)}, None, 5.7)],
)
def test_a_camera_that_is_mounted_elsewhere_is_named_with_its_offset(
    offset, millimetres, degrees
):
    def change(rig, scene):
        rig.truth["top"] = mounted(scene.sensors["top"].pose, offset)

    before, after, sense = watched(change=change, zones=False)
    assert before == {}
    assert after["top", Fault.MOVED] < BEGIN + 1.0
    found = sense._stations["top"]._alignment.offset
    turn = np.degrees(np.linalg.norm(found.turn))
    assert turn == pytest.approx(degrees, abs=0.6)
    if millimetres is not None:
        way = np.linalg.norm(found.shift) * 1e3
        assert way == pytest.approx(millimetres, abs=4)
        assert f"{way:.0f} mm" in str(sense.health["top"])


@pytest.mark.parametrize(
    ("case", "fault", "words"),
    [
        ("two swapped", Fault.MOVED, "its distances are those of left_ring/"),
        ("on the other arm", Fault.MOVED, "its distances are those of right_ring/1"),
        ("camera: mirrored", Fault.MOVED, "columns reversed"),
        ("camera: two images behind", Fault.DELAYED, "67 ms"),
    ],
)
def test_a_sensor_in_another_place_or_late_is_named(case, fault, words):
    kind = KINDS[case]
    name = "top" if kind.camera else NAME
    injected = kind.make(sensed_bay(), name, np.random.default_rng(5))

    def change(rig, _):
        rig.truth.update(injected.mounts)

    before, after, sense = watched(
        injected.tamper, change=change, zones=not kind.camera
    )
    assert before == {}
    assert {sensor for sensor, _ in after} <= set(injected.at_fault)
    named = [sensor for sensor, one in after if one is fault]
    assert named
    for sensor in named:
        assert after[sensor, fault] < BEGIN + 1.0
        assert not sense.health[sensor].trusted
        assert sense.health[sensor].misled
        assert words in str(sense.health[sensor])


def test_objects_that_are_not_there_are_named():
    before, after, _ = watched(without=("bench", "tool_holder"), seconds=1.0)
    assert {*before, *after} == {"bench", "tool_holder"}


def test_no_fault_is_found_in_order():
    before, after, sense = watched(seconds=12.0)
    assert before == after == {}
    assert set(sense.intakes) == {ag.Intake.TAKEN}
    assert {str(health) for health in sense.health.values()} == {"in order"}


def test_hits_of_a_sensor_at_fault_count_and_it_frees_nothing():
    scene = sensed_bay(camera=False)
    sense, rig = ag.Sense(scene), Rig(scene)
    reading = rig.read(NAME, scene.home)
    near = np.full((8, 8), 0.2)
    for k in range(200):
        stamp = 0.01 * (k + 1)
        sense.joints(scene.home, stamp)
        if k % 7 == 3:
            # The same frame to the bit from the second one on.
            sense.zones(NAME, near, np.full((8, 8), 5), stamp)
    assert sense.intakes[ag.Intake.HITS_ONLY] == 28
    assert Fault.REPEATED in sense.health[NAME].faults
    assert sense.cells.occupied().any()
    sense.zones(NAME, reading.distance, np.full((8, 8), 255), 2.01)
    assert sense.cells.occupied().any()


def test_noise_in_place_of_frames_is_counted_and_raises_nothing():
    scene = sensed_bay()
    sense, rng = ag.Sense(scene), np.random.default_rng(8)
    sense.joints(scene.home, 0.0)
    sense.joints(scene.home, 0.5)
    values = [
        None, "x", 3, np.nan, [], {}, object(), np.zeros(64), np.full((8, 8), np.inf),
        np.full(64, -1), np.zeros((8, 8, 8)), rng.normal(size=(8, 8)), b"1",
        np.full((120, 160), 1.0), np.zeros((120, 160), dtype=np.uint16),
        np.full(64, 2**63, dtype=np.uint64), [[1j]], np.array(["a"] * 64),
        rng.integers(0, 4000, 64),
    ]  # fmt: skip
    names = ["top", NAME, "nobody", None, 3, ("a",), ["b"]]
    count = 3000
    for k in range(count):
        good = 0.2 + 1e-4 * k
        stamps = [None, "y", np.nan, np.inf, -1e300, 1e300, [], 10**400, good, good]
        name, value, status, stamp = (
            some[rng.integers(len(some))] for some in (names, values, values, stamps)
        )
        if rng.random() < 0.5:
            sense.zones(name, value, status, stamp)
        else:
            sense.depth(name, value, stamp)
        sense.joints(value, stamp)
    assert sum(sense.intakes.values()) == 2 * count + 2
    for intake in (ag.Intake.UNKNOWN_SENSOR, ag.Intake.WRONG_SIZE, ag.Intake.NO_STAMP):
        assert sense.intakes[intake] > 20


@pytest.mark.parametrize(("axis", "faults"), [(0, set()), (2, {Fault.DIRTY})])
def test_zones_that_move_beside_a_surface_are_not_dirty(axis, faults):
    # All zones have the same near distance while the sensor moves across its axis, or
    # along it.
    sensor = sensed_bay(camera=False).sensors[NAME]
    health, view = SensorHealth(sensor), View(sensor, 0.05, 0.025)
    tests, depth = FrameTests(view, health), np.full(64, 0.2)
    for k in range(12):
        origin = 0.2 * k / 15 * np.eye(3)[axis]
        mount = Mount(np.eye(3), origin, 0.0, 0.0)
        tests._test_dirty(depth, np.ones(64, dtype=bool), mount, k / 15)
    assert set(health.faults) == faults
    assert not health.misled


@pytest.mark.parametrize(
    ("distances", "named"), [(1, None), (2, 9), (4, 5), (8, 3), (60, 3)]
)
def test_a_repeated_frame_with_few_distances_needs_more_frames(distances, named):
    sensor = sensed_bay(camera=False).sensors[NAME]
    health, view = SensorHealth(sensor), View(sensor, 0.05, 0.025)
    tests, values = FrameTests(view, health), np.full((8, 8), np.nan)
    values.reshape(-1)[:distances] = 0.3
    found = []
    for k in range(20):
        tests.repeats(values.copy(), k / 15)
        found.append(Fault.REPEATED in health.faults)
    assert (found.index(True) + 1 if any(found) else None) == named
    other = values + 0.01
    assert not tests.repeats(other, 1.5)


@pytest.mark.parametrize(
    ("zones", "step", "faults"),
    [(3, 0.02, {Fault.STUCK}), (2, 0.02, set()), (3, 0.0, set())],
)
def test_zones_that_keep_their_bits_in_motion_are_stuck(zones, step, faults):
    # Nothing is modelled in view.
    sensor = sensed_bay(camera=False).sensors[NAME]
    health, view = SensorHealth(sensor), View(sensor, 0.05, 0.025)
    tests, rng = FrameTests(view, health), np.random.default_rng(1)
    nothing = Prediction(np.tile([np.inf, np.inf, -1.0, 0.0], (64, 1)))
    for k in range(8):
        depth = 0.5 + 0.003 * rng.standard_normal(64)
        depth[:zones] = 0.31
        mount = Mount(np.eye(3), np.array([step * k, 0.0, 0.0]), 0.0, 0.0)
        tests._test_stuck(depth, nothing, mount, k / 15)
    assert set(health.faults) == faults


@pytest.mark.parametrize(
    ("speed", "faults"), [(0.0, {Fault.DIRTY}), (0.5, set()), (1.0, set())]
)
def test_dirty_zones_are_found_while_a_sensor_moves_across_its_axis(speed, faults):
    # A body at 0.1 m goes through the view at a share of the sensor's speed: dirt at
    # none of it, a body at rest at all of it.
    sensor = sensed_bay(camera=False).sensors[NAME]
    health, view = SensorHealth(sensor), View(sensor, 0.05, 0.025)
    tests = FrameTests(view, health)
    x = view.points(np.arange(64), np.full(64, 0.1))[:, 0]
    for k in range(12):
        way = 0.005 * k
        seen = np.abs(x + speed * (way - 0.03)) < 0.018
        depth = np.where(seen, 0.1, np.inf)
        mount = Mount(np.eye(3), np.array([way, 0.0, 0.0]), 0.0, 0.0)
        tests._test_dirty(depth, seen, mount, k / 15)
    assert set(health.faults) == faults


def test_nan_in_a_zone_with_a_status_cannot_be():
    sensor = sensed_bay(camera=False).sensors[NAME]
    view, distance = View(sensor, 0.05, 0.025), np.full((8, 8), 0.3)
    distance[2, 3] = np.nan
    nothing = np.full((8, 8), 255)
    found = frame_of(sensor, view.slopes, distance, nothing)
    assert np.argwhere(found.impossible).tolist() == [[2, 3]]
    assert not frame_of(sensor, view.slopes, distance, None).impossible.any()
