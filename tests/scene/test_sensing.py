"""Sensors and the reflex in scene files: what they hold, and errors with their line."""

import numpy as np
import pytest

from armguard.errors import SceneError, UnknownNameError
from armguard.scene import Scene, load_scene
from armguard.scene.archive import archive_of, scene_of
from armguard.scene.sensing import ReflexSettings
from armguard.scene.yaml_source import SceneFileError

FILE = """
mode: fixed
robots: {arm: {urdf: panda}}
sensors:
  ring: {on: arm/panda_link5, zones: [4, 4], at: {xyz: [0, 0.08, 0], rpy: [0, 0, 1]}}
reflex: {sensors: [ring], distance: 0.1}
"""


def loaded(tmp_path, text=FILE):
    path = tmp_path / "cell.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def test_a_file_declares_sensors_and_a_reflex(tmp_path):
    scene = loaded(tmp_path)
    ring = scene.sensors["ring"]
    assert (ring.on, ring.zones, ring.range) == ("arm/panda_link5", (4, 4), (0.02, 0.4))
    assert np.allclose(ring.pose.matrix()[:3, 3], [0.0, 0.08, 0.0])
    assert scene.reflex == ReflexSettings(sensors=("ring",), distance=0.1)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("link5", "link9", "cell.yaml:5: sensors.ring: no link is named"),
        ("arm/panda_link5", "arm", "'arm' is a robot; name one of its links"),
        ("[4, 4]", "[4]", "sensors.ring.zones: expected 2 numbers, got 1"),
        ("[4, 4]", "[0, 4]", "sensors.ring.zones[0]: is 0; it must be >= 1"),
        ("zones:", "view: [45, 45], zones:", "sensors.ring.view[0]: is 45 rad"),
        ("zones:", "range: [0.4, 0.02], zones:", "range is 0.4 to 0.02 m; it must"),
        ("zones:", "kind: sonar, zones:", "sensors.ring.kind: is 'sonar'; it must be"),
        ("[ring]", "[rung]", "cell.yaml:6: reflex: no sensor is named 'rung'; did you"),
        ("[ring]", "[ring, ring]", "reflex.sensors: names something twice"),
        ("0.1}", "0.5}", "distance is 0.5 m; sensor 'ring' measures from 0.02 to 0.4"),
        ("0.1}", "0.02}", "distance is 0.02 m; sensor 'ring' measures from 0.02"),
        ("0.1}", "0.1, file: ../x.json}", "reflex.file: is '../x.json'; it must be a"),
        ("0.1}", "0.1, votes: 2}", "reflex.votes: there is no such key; did you"),
    ],
)
def test_a_mistake_is_named_with_its_key(tmp_path, old, new, says):
    assert FILE.count(old) == 1
    with pytest.raises(SceneFileError) as caught:
        loaded(tmp_path, FILE.replace(old, new))
    assert says in str(caught.value)


def test_scripts_declare_the_same(tmp_path):
    scene = Scene(mode="fixed")
    scene.add_robot("panda", "arm")
    scene.add_sensor("ring", on="arm/panda_link5")
    with pytest.raises(SceneError, match="the name 'ring' is taken"):
        scene.add_sensor("ring", on="arm/panda_link5")
    with pytest.raises(SceneError, match="sensor 'b': period is -1 s; it must be > 0"):
        scene.add_sensor("b", on="arm/panda_link5", period=-1)
    with pytest.raises(UnknownNameError, match="no sensor is named 'b'"):
        scene.set_reflex(sensors=("b",))
    scene.set_reflex(sensors=("ring",), vote=2)
    assert scene.reflex.vote == 2


def test_no_verdict_depends_on_them_so_an_archive_has_none(tmp_path):
    scene = loaded(tmp_path)
    assert not scene_of(archive_of(scene)).sensors
