"""Sensors in scene files: kinds, places, rings, and errors with their line."""

import numpy as np
import pytest

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.scene import Scene, load_scene
from armguard.scene.yaml_source import SceneFileError

FILE = """
mode: fixed
robots: {arm: {urdf: panda}}
sensors:
  ring: {kind: vl53l8cx, on: arm/panda_link5, ring: {count: 4, radius: 0.08}}
  top: {kind: depth, size: [320, 240], focal: 300, at: {xyz: [0.4, 0, 1.5]}}
"""


def loaded(tmp_path, text=FILE):
    path = tmp_path / "cell.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def test_kinds_have_figures_of_what_is_not_set(tmp_path):
    sensors = loaded(tmp_path).sensors
    assert list(sensors) == ["ring/0", "ring/1", "ring/2", "ring/3", "top"]
    ring, top = sensors["ring/0"], sensors["top"]
    assert (ring.zones, ring.range, ring.period) == ((8, 8), (0.02, 4.0), 1 / 15)
    assert ring.view == pytest.approx((np.pi / 4, np.pi / 4))
    # A zone is 5.6° wide on average: eight of them are 45°.
    assert ring.focal[0] == pytest.approx(4 / np.tan(np.pi / 8))
    assert (top.zones, top.focal, top.middle) == (
        (320, 240),
        (300, 300),
        (159.5, 119.5),
    )
    assert top.on is None
    assert top.pose.xyz == (0.4, 0, 1.5)


def test_sensors_of_a_ring_look_outwards_from_its_axis():
    scene = Scene(mode="fixed")
    scene.add_robot("panda", "arm")
    pose = Pose(xyz=(0.1, 0.2, 0.3), rpy=(0.4, 0.5, 0.6))
    made = scene.add_sensor(
        "ring", on="arm/panda_link5", pose=pose,
        ring={"count": 5, "radius": 0.07, "height": -0.02},
    )  # fmt: skip
    T = pose.matrix()
    frames = [np.linalg.inv(T) @ one.pose.matrix() for one in made]
    for k, frame in enumerate(frames):
        angle = 2 * np.pi * k / 5
        out = np.array([np.cos(angle), np.sin(angle), 0])
        assert frame[:3, 3] == pytest.approx(0.07 * out + [0, 0, -0.02])
        assert frame[:3, 2] == pytest.approx(out)
        assert frame[:3, 1] == pytest.approx([0, 0, 1])
        assert np.linalg.det(frame[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("link5", "link9", "cell.yaml:5: sensors.ring: no link is named"),
        ("arm/panda_link5", "arm", "'arm' is a robot; name one of its links"),
        ("count: 4", "count: 0", "sensors.ring.ring.count: is 0; it must be >= 1"),
        ("count: 4, ", "", "cell.yaml:5: sensors.ring.ring.count: is missing"),
        (", focal: 300", "", "cell.yaml:6: sensors.top: focal is missing; give that"),
        ("focal", "zones: [8, 8], focal", "kind depth has no `zones`; it has size"),
        ("on:", "focal: 3, on:", "kind vl53l8cx has no `focal`; it has zones, view"),
        ("vl53l8cx", "vl53", "sensors.ring.kind: is 'vl53'; it must be 'tof'"),
        ("  top:", "  arm:", "cell.yaml:6: sensors.arm: the name 'arm' is taken"),
        ("  top:", "  ring:", "cell.yaml:6"),
        ("  top:", "reflex: {sensors: [top]}\n  top:", "reflex"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, old, new, says):
    assert FILE.count(old) == 1
    text = FILE.replace(old, new)
    if new.startswith("reflex"):
        text = FILE + "reflex: {sensors: [top]}\n"
        says = "cell.yaml:7: reflex: the reflex takes zones of sensors on links"
    with pytest.raises(SceneFileError) as caught:
        loaded(tmp_path, text)
    assert says in str(caught.value)


def test_a_ring_is_all_of_its_sensors_for_the_reflex(tmp_path):
    scene = loaded(tmp_path, FILE + "reflex: {sensors: [ring, ring/1]}\n")
    assert scene.reflex.sensors == ("ring/0", "ring/1", "ring/2", "ring/3")


def test_a_sensor_of_wrong_figures_is_refused():
    scene = Scene(mode="fixed")
    scene.add_robot("panda", "arm")
    with pytest.raises(SceneError, match="fill is 2; it must be <= 1"):
        scene.add_sensor("eye", fill=2)
    with pytest.raises(SceneError, match=r"noise\.expected 3 numbers, got 1"):
        scene.add_sensor("eye", noise=[0.1])
