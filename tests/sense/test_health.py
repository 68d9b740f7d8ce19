"""Faults of sensors are named within a second of motion, and healthy ones are not."""

import numpy as np
import pytest

import armguard as ag
from armguard.sense import Fault
from armguard.sense.health import FrameTests, SensorHealth
from armguard.sense.prediction import Mount
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
