"""Mistakes in a scene file: none passes silently, each names place and remedy."""

import pytest

from armguard import Pose, Scene, Sphere
from armguard.scene import load_scene
from armguard.scene.compile import compile_scene
from armguard.scene.yaml_source import SceneFileError

ARM = """<robot name="r"><link name="a"><collision><geometry><sphere radius="0.1"/>
</geometry></collision></link><link name="b"><collision><origin xyz="0 0 0.4"/>
<geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""

# What is added to the robot, what to the file, and the message's parts.
MISTAKES = {
    "degrees in base": (
        "base: {rpy: [0, 0, 90]}",
        "",
        ("robots.arm.base", "90", "degrees; give radians"),
    ),
    "few degrees in base": (
        "base: {rpy: [0, 0, 10]}",
        "",
        (":2: robots.arm.base.rpy[2]", "is 10 rad", "degrees; give radians: 0.1745"),
    ),
    "degrees in home": (
        "home: {j: 45}",
        "",
        ("robots.arm: home puts joint 'j' at 45", "degrees", "limits are [-1, 1]"),
    ),
    "unknown joint in home": ("home: {jj: 0}", "", ("'jj'", "did you mean 'j'?")),
    "flag in home": ("home: {j: true}", "", (":2: robots.arm.home.j", "got true")),
    "list in home": ("home: [0]", "", ("robots.arm.home", "a mapping, got [0]")),
    "misspelt key": ("urfd: x", "", ("robots.arm.urfd", "did you mean 'urdf'")),
    "quaternion without order": (
        "base: {quat: [1, 0, 0, 0]}",
        "",
        ("robots.arm.base.quat", "did you mean 'quat_xyzw', 'quat_wxyz'?"),
    ),
    "quaternion not unit": (
        "base: {quat_wxyz: [0.5, 0, 0, 0]}",
        "",
        ("robots.arm.base", "quat_wxyz has norm 0.5; it must be 1"),
    ),
    "base as a list": (
        "base: [0, 0, 0]",
        "",
        ("robots.arm.base", "got [0, 0, 0]; its keys are xyz, rpy, quat_wxyz"),
    ),
    "decimal comma": (
        "base: {xyz: ['0,5', 0, 0]}",
        "",
        ("xyz[0]", "number, got '0,5'"),
    ),
    "wrong frame": (
        "home: {j: 0}",
        "objects: {t: {box: [1, 1, 1], attached_to: arm/bb}}",
        (":3: objects.t", "'arm/bb'", "did you mean 'arm/b'"),
    ),
    "milliseconds": (
        "home: {j: 0}",
        "cycle: {period: 20}",
        (":3: cycle.period: is 20 s", "20 ms are 0.02, at 20 Hz it is 0.05"),
    ),
    "milliseconds late": (
        "home: {j: 0}",
        "cycle: {late: 5}",
        (":3: cycle.late: is 5 s", "5 ms are 0.005"),
    ),
    "rate as a key": (
        "home: {j: 0}",
        "cycle: {rate: 50}",
        (":3: cycle.rate: there is no such key",),
    ),
    "millimetres of buffer": (
        "home: {j: 0}",
        "buffer: 30",
        (":3: buffer: is 30 m", "millimetres; give metres: 0.03"),
    ),
    "millimetres of margin": (
        "home: {j: 0}",
        "margin: 500",
        ("margin: is 500 m", "0.5"),
    ),
    "millimetres of a fit": (
        "fit_target: 30",
        "",
        (":2: robots.arm.fit_target: is 30 m", "metres: 0.03"),
    ),
    "millimetres of a gripper": (
        "gripper: {link: b, fingers: [b], swap: 50}",
        "",
        ("robots.arm.gripper.swap: is 50 m", "metres: 0.05"),
    ),
    "millimetres a second": (
        "home: {j: 0}",
        "objects: {t: {box: [1, 1, 1], at: {xyz: [5, 0, 0]}, top_speed: 1600}}",
        (":3: objects.t.top_speed: is 1600 m/s", "metres: 1.6"),
    ),
    "empty objects": (
        "home: {j: 0}",
        "objects:",
        (":3: objects: is empty; delete the key, or give a mapping",),
    ),
    "tab": ("home: {j: 0}", "\tbuffer: 0", (":3:", "is not YAML", "'\\t'")),
    "open brace": ("home: {j: 0", "", ("is not YAML",)),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_refused_with_place_value_and_remedy(case, tmp_path):
    (tmp_path / "r.urdf").write_text(ARM)
    robot, rest, says = MISTAKES[case]
    path = tmp_path / "scene.yaml"
    text = f"robots:\n  arm: {{urdf: r.urdf, stopping: {{deceleration: 5}}, {robot}}}\n"
    path.write_text(f"{text}{rest}\n")
    with pytest.raises(SceneFileError) as caught:
        load_scene(path)
    assert str(caught.value).startswith("scene.yaml:")
    for part in says:
        assert part in str(caught.value)


@pytest.mark.parametrize("name", ["fr3", "ur5e", "pnda"])
def test_an_unknown_robot_is_answered_by_the_list_of_names(name, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(f"robots:\n  arm: {{urdf: {name}}}\n")
    with pytest.raises(SceneFileError) as caught:
        load_scene(path)
    said = str(caught.value)
    assert "did you mean" not in said
    assert "one of the named robots: baxter, g1, kinova, panda, " in said


def test_at_most_ten_objects_in_millimetres_are_named_and_all_are_counted(
    tmp_path, caplog
):
    (tmp_path / "arm.urdf").write_text(ARM)
    scene = Scene()
    scene.add_robot(tmp_path / "arm.urdf", "arm", mode="fixed")
    for k in range(12):
        scene.add(Sphere(radius=0.1), f"ball{k}", pose=Pose(xyz=(50, 0, k)))
    compile_scene(scene)
    *named, counted = caplog.messages
    assert [words.split()[1] for words in named] == [f"'ball{k}':" for k in range(10)]
    assert counted == "12 objects look like millimetres; 10 of them are named above"


def test_a_scene_file_writes_each_line_of_the_log_once(tmp_path, caplog):
    (tmp_path / "arm.urdf").write_text(ARM)
    path = tmp_path / "scene.yaml"
    base = "base: {xyz: [0, 400, 0]}"
    path.write_text(f"robots: {{a: {{urdf: arm.urdf, mode: fixed, {base}}}}}\n")
    for _ in range(2):
        caplog.clear()
        load_scene(path)
        (line,) = caplog.messages
        assert line.startswith("robot 'a': base: 400 m look like millimetres")


def test_a_robot_in_place_of_a_scene_is_answered_by_how_to_write_one(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    with pytest.raises(SceneFileError, match=f"robot: armguard init {path}"):
        load_scene(path)
