"""`armguard check` of sensors: the table of speeds by range and age, and the cost."""

from dataclasses import replace

import numpy as np
import pytest

from armguard.cli import sensors
from armguard.cli.coverage import (
    coverage_findings,
    coverage_table,
    scene_coverage,
)
from armguard.cli.sensors import allowed_speed, sensor_findings, smallest_body
from armguard.scene import Scene, load_scene
from armguard.scene.sensing import IntruderSettings
from armguard.scene.two_pandas import sensed_table_path
from armguard.sense.coverage import Coverage, Patch
from armguard.sense.view import View
from armguard.simulation.sensed import sensed_bay

FAST = IntruderSettings(speed=1.6, size=0.05)


@pytest.mark.parametrize("reach", [0.15, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("speed", [0.0, 0.25, 1.6])
def test_an_arm_of_the_allowed_speed_rests_before_what_comes(reach, speed):
    age, hard, step = 0.092, 1.22, 1e-5
    v = allowed_speed(reach, age, hard, speed)
    t, gap, now = 0.0, reach, v
    while now > 0.0 and gap > 0.0:
        now = v if t < age else v - hard * (t - age)
        gap -= (max(now, 0.0) + speed) * step
        t += step
    if v > 0.0:
        assert gap == pytest.approx(0.03, abs=1e-3)
    else:
        assert reach - speed * age < 0.03


def test_a_time_of_flight_skin_alone_is_slow_where_people_may_come():
    # Declared figures of the paper's arm: 1.22 m/s².
    found = [allowed_speed(0.4, 0.092, 1.22, w) for w in (0.0, 0.25, 1.6)]
    assert found == pytest.approx([0.84, 0.63, 0.15], abs=0.005)


def test_findings_name_rate_cost_and_speed_of_each_sensor():
    first, *others = sensor_findings(sensed_bay(unknown="moving"))
    assert "9 sensors, 512 zones, 150 frames/s take" in first.sentence
    share = float(first.sentence.split("take ")[1].split("%")[0])
    assert 0 < share < 300
    assert len(others) == 9
    skin, camera = others[0], others[-1]
    assert "50 mm up to 0.43 m" in skin.sentence
    assert "0.26 m/s if what it sees moves at 1.6 m/s" in skin.sentence
    assert "1.94 m/s if what it sees moves at 1.6 m/s" in camera.sentence
    assert [one.status for one in (skin, camera)] == ["PASS", "PASS"]
    slow = sensed_bay(unknown="moving")
    slow.sensing = replace(slow.sensing, intruder=replace(FAST, size=0.02))
    assert list(sensor_findings(slow))[1].status == "WARN"
    scene = sensed_bay()
    scene.sensing = None
    assert list(sensor_findings(scene)) == []
    assert np.isfinite(share)


def test_findings_of_sparse_sensors_and_of_signals():
    scene = sensed_bay(zones=False, camera=False)
    for kind in ("points", "range", "infrared", "capacitive"):
        scene.add_sensor(kind, kind=kind, on="left/link5")
    first, *others = sensor_findings(scene)
    assert "4 sensors, 0 zones, 180 frames/s take" in first.sentence
    points, beam, light, pad = (one.sentence for one in others)
    # The cells of 25 mm are less than the way between rays of 0.01 rad at 2.5 m.
    assert "50 mm up to 2.50 m" in points
    assert "50 mm up to 0.30 m" in beam
    assert "50 mm up to 0.22 m" in light
    assert "capacitive frees no space: it only takes knowledge away" in pad
    (dark,) = scene.add_sensor("dark", kind="infrared", reflectance=(0.001, 0.9))
    assert (
        f"up to {View(dark, 0.05).reach:.2f} m"
        in list(sensor_findings(scene))[-1].sentence
    )
    assert View(dark, 0.05).reach == pytest.approx(
        np.sqrt(0.02 * 0.25 * 0.001 * np.cos(0.5) / 0.0003) - 0.01
    )


@pytest.mark.parametrize(("share", "status"), [(0.8, "PASS"), (0.81, "WARN")])
def test_sensors_that_take_too_much_of_a_core_are_a_warning(share, status, monkeypatch):
    monkeypatch.setattr(sensors, "measured_share", lambda scene: share)
    first = next(sensor_findings(sensed_bay()))
    assert first.status == status
    assert f"take {share:.0%} of a core" in first.sentence
    assert bool(first.remedy) == (status == "WARN")


def test_the_smallest_body_fills_a_quarter_of_four_zones():
    scene = sensed_bay(camera=False)
    one = next(iter(scene.sensors.values()))
    for distance in (0.1, 0.2):
        # A quarter of its disc covers the share `fill` of one of four zones.
        zone = 2.0 * distance * np.tan(one.view[0] / 2.0) / 8.0
        needed = np.sqrt(16.0 * one.fill * zone**2 / np.pi)
        assert smallest_body(one, distance) == pytest.approx(needed, abs=1e-3)
    assert smallest_body(one, 50.0) == np.inf
    skin = list(sensor_findings(scene))[1]
    assert "50 mm up to 0.43 m, 12 mm at 0.1 m, 23 mm at 0.2 m" in skin.sentence


def patch(link, size, body, facing=(0.1, -0.9, 0.2)):
    """A patch at the origin of its link."""
    return Patch(link, size, body, np.zeros(3), np.array(facing), np.zeros((1, 3)))


def test_findings_name_the_blind_patches_of_each_link():
    patches = (
        patch("left/link3", 0.084, 0.061), patch("left/link5", 0.03, np.inf),
        patch("left/link3", 0.022, 0.02),
    )  # fmt: skip
    seen = {"left/link3": 0.8, "left/link4": 1.0, "left/link5": 0.9}
    found = Coverage(0.12, seen, patches)
    lines = [(one.status, one.sentence) for one in coverage_findings(Scene(), found)]
    assert lines == [
        ("WARN", "2 of 3 links have patches of more than 20 mm that no sensor sees, "
         "120 mm before their surface, with all arms at home"),
        ("WARN", "left/link3: 84 mm on its -y side seen by no sensor (1 smaller one "
         "beside); a body of 61 mm can hide"),
        ("PASS", "left/link4: no patch is unseen"),
        ("WARN", "left/link5: 30 mm on its -y side seen by no sensor; a body of any "
         "size can hide"),
    ]  # fmt: skip
    assert [row["hides_mm"] for row in coverage_table(found)] == [61.0, None, 20.0]
    covered = Coverage(0.12, {"left/link4": 1.0}, ())
    whole = list(coverage_findings(Scene(), covered))
    assert whole[0].status == "PASS" and whole[0].sentence.startswith("none of 1 links")
    assert list(coverage_findings(Scene(), None)) == [] and coverage_table(None) == []


def test_a_check_without_scipy_names_it_in_place_of_blind_patches(monkeypatch):
    scene = load_scene(sensed_table_path())
    monkeypatch.setattr("armguard.cli.coverage.find_spec", lambda name: None)
    (one,) = coverage_findings(scene, scene_coverage(scene))
    assert one.status == "WARN" and "SciPy is missing" in one.sentence
    assert one.remedy == "pip install 'armguard[meshes]'"
