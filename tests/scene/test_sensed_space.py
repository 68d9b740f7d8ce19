"""Sensed space in scene files: what it holds, and errors with line and remedy."""

import pytest

from armguard.errors import SceneError
from armguard.geometry import Pose
from armguard.scene import Scene, load_scene
from armguard.scene.archive import archive_of, scene_of
from armguard.scene.region import reached_points
from armguard.scene.sensing import SceneZone
from armguard.scene.yaml_source import SceneFileError

FILE = """
robots: {arm: {urdf: panda}}
sensing:
  region: {centre: [0, 0, 0.5]}
  cell: 0.01
  unknown: moving
  intruder: {speed: 1.6, size: 0.05}
  zones:
    wall: {box: [0.4, 2, 2], at: {xyz: [-0.8, 0, 1]}, unknown: free, reason: brick}
"""


def loaded(tmp_path, text=FILE):
    path = tmp_path / "cell.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def test_a_file_declares_sensed_space(tmp_path):
    sensing = loaded(tmp_path).sensing
    assert (sensing.region.size, sensing.unknown, sensing.edge) == (256, "moving", 2.56)
    assert (sensing.intruder.speed, sensing.intruder.size) == (1.6, 0.05)
    zone = sensing.zones["wall"]
    assert (zone.box, zone.unknown, zone.reason) == ((0.4, 2.0, 2.0), "free", "brick")
    assert zone.pose == Pose(xyz=(-0.8, 0, 1))


def test_a_scene_without_it_has_none(tmp_path):
    assert loaded(tmp_path, "robots: {arm: {urdf: panda}}").sensing is None


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "  unknown: moving\n",
            "",
            "cell.yaml:3: sensing.unknown: is missing; state how",
        ),
        ("unknown: moving", "unknown: free", "unknown is free; give the reason"),
        (
            "moving",
            "slow",
            "cell.yaml:6: sensing.unknown: is 'slow'; it must be 'free'",
        ),
        (", reason: brick", "", "sensing.zones.wall: unknown is free; give the reason"),
        ("reason: brick", "reason: ' '", "sensing.zones.wall: unknown is free; give"),
        ("unknown: free, ", "", "sensing.zones.wall.unknown: is missing"),
        ("  intruder: {speed: 1.6, size: 0.05}\n", "", "sensing.intruder: is missing"),
        ("1.6", "-1", "sensing.intruder.speed: is -1; it must be >= 0"),
        ("1.6", "1600", "sensing.intruder.speed: is 1600 m/s, which looks like milli"),
        ("0.05}", "0}", "sensing.intruder.size: is 0; it must be > 0"),
        ("cell: 0.01", "cell: 10", "sensing.cell: is 10; it must be <= 0.2"),
        ("0.5]}", "0.5], size: 100}", "sensing.region.size: is 100; it must be 64,"),
        ("[0, 0, 0.5]", "[0, 0]", "sensing.region.centre: expected 3 numbers, got 2"),
        ("[0.4, 2, 2]", "[0.4, 0, 2]", "sensing.zones.wall.box[1]: is 0; it must be >"),
        ("cell: 0.01", "cells: 0.01", "sensing.cells: there is no such key; did you"),
        ("0.5]}", "0.5], size: 64}", "cell.yaml:4: sensing.region: the region is a cu"),
        ("[0, 0, 0.5]", "[0.6, 0, 0.5]", "robot 'arm' reaches (-"),
    ],
)
def test_a_mistake_is_named_with_its_key(tmp_path, old, new, says):
    assert FILE.count(old) >= 1
    with pytest.raises(SceneFileError) as caught:
        loaded(tmp_path, FILE.replace(old, new, 1))
    assert says in str(caught.value)


def scripted(**changes):
    scene = Scene()
    scene.add_robot("panda", "arm")
    settings = {
        "region": {"centre": (0, 0, 0.5)},
        "unknown": "still",
        "intruder": {"speed": 0.25, "size": 0.05},
        **changes,
    }
    scene.set_sensing(**settings)
    return scene


def test_scripts_declare_the_same():
    zone = SceneZone(box=(1, 1, 1), unknown="moving")
    assert scripted(zones={"door": zone}).sensing.zones["door"].unknown == "moving"
    with pytest.raises(SceneError, match="sensing: unknown is missing"):
        Scene().set_sensing(region={"centre": (0, 0, 0)}, intruder={})
    with pytest.raises(SceneError, match="give the reason"):
        scripted(unknown="free")
    with pytest.raises(SceneError, match=r"zone 'door'.*give the reason"):
        scripted(zones={"door": SceneZone(box=(1, 1, 1), unknown="free")})
    with pytest.raises(SceneError, match="outside it: move the centre"):
        scripted(region={"centre": (0, 0, 0.5), "size": 128}).validate()


def test_an_arm_reaches_what_its_joints_permit():
    scene = Scene()
    robot = scene.add_robot("panda", "arm", base=Pose(xyz=(1.0, 0, 0)))
    low, high = reached_points(robot).min(axis=0), reached_points(robot).max(axis=0)
    # The arm reaches 0.855 m from its shoulder, 0.333 m above its base.
    assert 1.8 < high[0] < 2.2
    assert 1.0 < high[2] < 1.5
    assert low[2] > -0.9


def test_verdicts_depend_on_it_so_an_archive_has_it(tmp_path):
    scene = loaded(tmp_path)
    assert scene_of(archive_of(scene)).sensing == scene.sensing
    plain = loaded(tmp_path, "robots: {arm: {urdf: panda}}")
    assert scene_of(archive_of(plain)).sensing is None
