"""Scenes in Python have the keys of scene files, and positional names."""

import dataclasses

import numpy as np
import pytest

from armguard import ModelError, Scene, SceneError, Sphere, UnknownNameError
from armguard.robot.named import ROBOTS
from armguard.robot.stopping import FiguresError, StoppingFigures, stopping_figures
from armguard.scene import load_scene
from armguard.scene.robots import response_settings
from arms import simple_arm

URDF = """<robot name="arm"><link name="base"/>
<link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision>
</link><joint name="joint1" type="revolute"><parent link="base"/><child link="tip"/>
<origin xyz="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1.5"/></joint></robot>
"""

STOPPING = {
    "deceleration": 4.0,
    "most": 9.0,
    "velocity": 1.0,
    "delays": {"sensing": 0.003, "command": 0.008},
    "errors": {"position": 1e-3, "base": 0.002},
    "brake": {"delay": 0.2},
    "sources": {"errors.position": "encoder's data sheet"},
}


def figures_of_file(tmp_path, stopping):
    """Stopping figures that a scene file declares."""
    (tmp_path / "arm.urdf").write_text(URDF)
    path = tmp_path / "scene.yaml"
    path.write_text(f"robots: {{arm: {{urdf: arm.urdf, stopping: {stopping}}}}}\n")
    return load_scene(path).robots["arm"].stopping


def in_python(tmp_path, stopping):
    """The same figures, declared in Python."""
    (tmp_path / "arm.urdf").write_text(URDF)
    robot = Scene().add_robot(tmp_path / "arm.urdf", "arm", stopping=stopping)
    return robot.stopping


def test_figures_have_one_set_of_keys(tmp_path):
    file = figures_of_file(tmp_path, STOPPING)
    python = in_python(tmp_path, STOPPING)
    for field in dataclasses.fields(StoppingFigures):
        ours, theirs = getattr(python, field.name), getattr(file, field.name)
        assert np.array_equal(ours, theirs), field.name
    assert python.position_error.tolist() == [1e-3]
    assert python.deceleration_most.tolist() == [9.0]
    assert python.sources["position_error"] == "encoder's data sheet"


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"errors": {"position": 0.5}}, "'joint1' is 0.5, which looks like degrees"),
        ({"delays": {"sensing": 0.5}}, "stale is 10 ms, less than sensing, 500 ms"),
        ({"delays": {"command": 8.0}}, "command is 8, which looks like milliseconds"),
    ],
)
def test_figures_are_refused_with_the_same_words(tmp_path, wrong, says):
    stopping = {"deceleration": 4.0, **wrong}
    with pytest.raises(FiguresError) as python:
        in_python(tmp_path, stopping)
    with pytest.raises(SceneError) as file:
        figures_of_file(tmp_path, stopping)
    assert says in str(python.value)
    assert str(python.value) in str(file.value)


def test_a_misspelt_key_is_named_with_its_group(tmp_path):
    with pytest.raises(FiguresError, match=r"no figure 'errors\.postion'; did"):
        in_python(tmp_path, {"deceleration": 4.0, "errors": {"postion": 1e-3}})
    twice = {"errors": {"position": 1e-3}, "position_error": 2e-3}
    with pytest.raises(FiguresError, match="position_error is declared twice"):
        in_python(tmp_path, {"deceleration": 4.0, **twice})
    with pytest.raises(FiguresError, match="no figure 'errors'"):
        stopping_figures(simple_arm(), deceleration=4.0, errors={"position": 1e-3})


def test_a_response_may_be_a_mapping_as_in_a_file():
    given = {"kind": "slow", "evade": True}
    settings = response_settings("robot 'a'", given)
    assert (settings.kind, settings.evade) == ("slow", True)
    with pytest.raises(SceneError, match=r"response\.evades: there is no such key"):
        response_settings("robot 'a'", {"evades": True})
    with pytest.raises(SceneError, match=r"response\.kind is 'slw'; it must be"):
        response_settings("robot 'a'", {"kind": "slw"})


def test_names_are_positional():
    scene = Scene()
    scene.add_robot(simple_arm(), "arm", stopping=STOPPING | {"sources": {}})
    scene.add(Sphere(radius=0.1), "ball", graspable={"depth": 0.001})
    faces = [(0, 1, 2)]
    scene.add_mesh(([(0, 0, 0), (1, 0, 0), (0, 1, 0)], faces), "sheet")
    assert list(scene.robots) == ["arm"]
    assert list(scene.objects) == ["ball", "sheet"]
    assert scene.objects["ball"].graspable.depth == 0.001


def test_no_other_robot_is_suggested_for_an_unknown_one():
    for name in ("fr3", "ur5e", "pandas"):
        with pytest.raises(ModelError) as error:
            Scene().add_robot(name, "left")
        assert "did you mean" not in str(error.value)
        assert ", ".join(ROBOTS) in str(error.value)
    scene = Scene()
    scene.add_robot(simple_arm(), "left")
    with pytest.raises(UnknownNameError) as error:
        scene.set_mode("fixed", "lefd")
    assert "did you mean" not in str(error.value)
    assert "known names are 'left'" in str(error.value)


def test_degrees_in_a_urdf_are_refused_at_their_line(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF.replace('xyz="0 0 1"', 'xyz="0 0 1" rpy="0 0 90"'))
    with pytest.raises(
        ModelError, match=r"'arm\.urdf' line 4: <origin> rpy\[2\] .*degrees"
    ):
        Scene().add_robot(path, "arm")
