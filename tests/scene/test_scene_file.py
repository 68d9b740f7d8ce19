"""Scene files: what they hold, and how every error reads."""

import pytest

from armguard.errors import SceneError, UnknownNameError
from armguard.geometry import Box, Capsule, Pose, Sphere
from armguard.guard import Level
from armguard.respond import Guard
from armguard.scene import Scene, load_scene
from armguard.scene.allowed import allowed_pairs
from armguard.scene.bay import FOLDER
from armguard.scene.settings import ResponseSettings
from armguard.scene.yaml_source import SceneFileError

TWO_PANDAS = """robots:
  left:  {urdf: panda, base: {xyz: [0, 0.4, 0]}}
  right: {urdf: panda, base: {xyz: [0, -0.4, 0]}}
objects:
  table: {box: [1.2, 2.0, 0.05], at: {xyz: [0.5, 0, -0.13]}}
  cup: {cylinder: {radius: 0.04, length: 0.1}, at: {xyz: [0.6, 0.1, 0]}}
buffers:
  - {a: left, b: right, buffer: 0.061}
"""

ARM = f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, mode: fixed}}\n"


def write(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return path


def test_two_arms_take_fewer_than_twelve_lines(tmp_path):
    assert len(TWO_PANDAS.splitlines()) <= 12
    scene = load_scene(write(tmp_path, TWO_PANDAS))
    guard = Guard(scene)
    assert len(guard.q_names) == 16
    assert guard.q_names[0] == "left/panda_joint1"
    assert guard.home_verdict.level is Level.CLEAR
    assert guard.tables.buffers.max() == 0.061


def test_every_shape_and_pose_is_read(tmp_path):
    text = (
        ARM
        + """objects:
  ball: {sphere: {radius: 0.1, rounding: 0.01}, at: {xyz: [2, 0, 0]}}
  rod: {capsule: {from: [0, 0, 0], to: [0, 0, 1], radius: 0.1}, at: {xyz: [2, 1, 0]}}
  stick: {capsule: {length: 0.4, radius: 0.1}, at: {xyz: [2, 2, 0]}}
  block: {box: {size: [0.2, 0.4, 0.6], rounding: 0.02}, at: {xyz: [3, 0, 0]}}
  turned: {box: [1, 1, 1], at: {xyz: [3, 3, 0], quat_xyzw: [0, 0, 1, 0]}}
  same: {box: [1, 1, 1], at: {xyz: [-3, 3, 0], quat_wxyz: [0, 0, 0, 1]}}
  pair:
    at: {xyz: [0, 3, 0]}
    union: [{box: [1, 1, 1]}, {sphere: {radius: 1}, at: {xyz: [0, 0, 1]}}]
  tool: {sphere: {radius: 0.01}, at: {xyz: [0, 0, 0.3]}, attached_to: arm/link7}
buffer: 0.02
margin: 0.04
allow: [{a: arm/link6, b: tool, reason: held}]
index: {kind: brute_force, leaf_capacity: 3, cube: {centre: [0, 0, 0], edge: 9}}
"""
    )
    scene = load_scene(write(tmp_path, text))
    shapes = {name: item.shapes[0].shape for name, item in scene.objects.items()}
    assert shapes["ball"] == Sphere(radius=0.1, rounding=0.01)
    assert shapes["rod"] == Capsule(start=(0, 0, 0), end=(0, 0, 1), radius=0.1)
    assert shapes["stick"].end == (0, 0, 0.2)
    assert shapes["block"] == Box(size=(0.2, 0.4, 0.6), rounding=0.02)
    turned, same = (scene.objects[n].pose.rpy for n in ("turned", "same"))
    assert turned == pytest.approx(same)
    assert len(scene.objects["pair"].shapes) == 2
    assert scene.objects["tool"].attached_to == "arm/link7"
    assert (scene.buffer, scene.margin) == (0.02, 0.04)
    assert scene.index.kind == "brute_force"
    assert scene.allowances[0].reason == "held"


def test_responses_are_read_by_name_or_with_settings(tmp_path):
    robots = "\n".join(
        f"  {name}: {{urdf: {FOLDER / 'bay_arm.urdf'}, stopping: {{deceleration: 4}}, "
        f"base: {{xyz: [{x}, 0, 0]}}{response}}}"
        for name, x, response in (
            ("one", 0, ""),
            ("two", 5, ", response: slow"),
            ("three", 10, ", response: {kind: stop, sharing: priority, priority: 2}"),
            ("four", 15, ", response: {kind: field, influence: 0.2, patience: 1}"),
        )
    )
    scene = load_scene(write(tmp_path, f"robots:\n{robots}\n"))
    found = [robot.response for robot in scene.robots.values()]
    assert found[0] == ResponseSettings()
    assert found[1] == ResponseSettings(kind="slow")
    assert found[2] == ResponseSettings(kind="stop", sharing="priority", priority=2.0)
    assert found[3] == ResponseSettings(kind="field", influence=0.2, patience=1.0)


WRONG = {
    "not a mapping": ("- 1\n", ":1: must be a mapping"),
    "no robots": ("objects: {}\n", ":1: robots: is missing"),
    "empty robots": ("robots: {}\n", ":1: robots: needs at least 1"),
    "no yaml": ("robots: [\n", "is not YAML"),
    "twice": ("robots: {}\nrobots: {}\n", ":2: the key 'robots' is there twice"),
    "unknown key": (
        ARM + "objets: {}\n",
        ":3: objets: there is no such key; did you mean 'objects'",
    ),
    "unknown inner key": (
        "robots:\n  arm: {urdf: panda,\n    bose: {}}\n",
        ":3: robots.arm.bose: there is no such key; did you mean 'base'",
    ),
    "two numbers": (
        "robots:\n  arm:\n    urdf: panda\n    base:\n      rpy: [0, 1]\n",
        ":5: robots.arm.base.rpy: expected 3 numbers, got 2",
    ),
    "text for a number": (
        "robots:\n  arm:\n    urdf: panda\n    base: {xyz: [0, a, 1]}\n",
        ":4: robots.arm.base.xyz[1]: expected a number, got 'a'",
    ),
    "not finite": (
        ARM + "objects:\n  b: {sphere: {radius: .nan}}\n",
        ":4: objects.b.sphere.radius: is nan; it must be finite",
    ),
    "negative": (
        ARM + "objects:\n  b: {sphere: {radius: -1}}\n",
        ":4: objects.b.sphere.radius: is -1; it must be > 0",
    ),
    "zero box": (
        ARM + "objects:\n  b: {box: {size: [1, 0, 1]}}\n",
        "objects.b.box.size[1]: is 0; it must be > 0",
    ),
    "two shapes": (
        ARM + "objects:\n  b: {sphere: {radius: 1}, box: [1, 1, 1]}\n",
        ":4: objects.b: has sphere and box; give exactly one of",
    ),
    "no shape": (ARM + "objects:\n  b: {at: {}}\n", ":4: objects.b: has no shape"),
    "two orientations": (
        ARM + "objects:\n  b: {box: [1, 1, 1], at: {rpy: [0, 0, 0], "
        "quat_wxyz: [1, 0, 0, 0]}}\n",
        ":4: objects.b.at: rpy and quat_wxyz are given; give one orientation",
    ),
    "unlabelled quaternion": (
        ARM + "objects:\n  b: {box: [1, 1, 1], at: {quat: [1, 0, 0, 0]}}\n",
        "objects.b.at.quat: there is no such key; did you mean 'quat_",
    ),
    "quaternion not unit": (
        ARM + "objects:\n  b: {box: [1, 1, 1], at: {quat_wxyz: [1, 1, 0, 0]}}\n",
        "quat_wxyz has norm 1.414; it must be 1",
    ),
    "degrees": (
        "robots:\n  arm: {urdf: panda, base: {rpy: [0, 0, 90]}}\n",
        "looks like degrees; give radians",
    ),
    "unknown robot": (
        "robots:\n  arm: {urdf: pandda}\n",
        ":2: robots.arm: no robot is named 'pandda', and there is no such file; "
        "give a URDF, or one of the named robots: baxter, g1, kinova, panda",
    ),
    "unknown link in allow": (
        ARM + "allow:\n  - {a: arm/link1, b: arm/lnk3, reason: no}\n",
        ":4: allow[0]: no body is named 'arm/lnk3'; did you mean",
    ),
    "robot in allow": (
        ARM + "allow:\n  - {a: arm, b: arm/link3, reason: no}\n",
        "'arm' is a robot; name one of its links, such as 'arm/base'",
    ),
    "allow without reason": (
        ARM + "allow:\n  - {a: arm/link1, b: arm/link3}\n",
        ":4: allow[0].reason: is missing",
    ),
    "attached to nobody": (
        ARM + "objects:\n  b: {box: [1, 1, 1], attached_to: arm/link9}\n",
        ":4: objects.b: no link is named 'arm/link9'; did you mean",
    ),
    "name taken": (
        ARM + "objects:\n  arm: {box: [1, 1, 1]}\n",
        ":4: objects.arm: the name 'arm' is taken",
    ),
    "buffer above margin": (
        ARM + "buffer: 0.1\nmargin: 0.05\n",
        ":4: margin: a buffer of 100.0 mm is larger than the margin of 50.0 mm",
    ),
    "wrong index": (
        ARM + "index: {kind: bvh}\n",
        ":3: index.kind: is 'bvh'; it must be 'auto', 'octree', 'joint_table' or "
        "'brute_force'",
    ),
    "unknown response": (
        "robots:\n  arm: {urdf: panda, response: deflct}\n",
        ":2: robots.arm.response: is 'deflct'; it must be",
    ),
    "unknown sharing": (
        "robots:\n  arm:\n    urdf: panda\n    response: {sharing: fair}\n",
        ":4: robots.arm.response.sharing: is 'fair'; it must be",
    ),
    "share of speed above 1": (
        "robots:\n  arm:\n    urdf: panda\n    response: {resume_speed: 10}\n",
        "resume_speed is 10.0; it must be in (0, 1]",
    ),
    "home outside": (
        f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, home: {{joint2: 9}}}}\n",
        ":2: robots.arm: home puts joint 'joint2' at 9; its limits are",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_line_and_key(case, tmp_path):
    text, says = WRONG[case]
    with pytest.raises(SceneFileError) as caught:
        load_scene(write(tmp_path, text))
    assert str(caught.value).startswith("scene.yaml")
    assert says in str(caught.value)


def test_all_problems_are_reported_at_once(tmp_path):
    text = ARM + "objects:\n  a: {sphere: {radius: -1}}\n  b: {box: [1, 2]}\nfoo: 1\n"
    with pytest.raises(SceneFileError) as caught:
        load_scene(write(tmp_path, text))
    assert [p.line for p in caught.value.problems][:1] == [4]
    assert {"objects.a.sphere.radius", "foo"} <= {p.path for p in caught.value.problems}


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(SceneFileError, match="cannot be read: No such file"):
        load_scene(tmp_path / "scene.yaml")


def bay_robot(scene, name="arm"):
    return scene.add_robot(FOLDER / "bay_arm.urdf", name=name)


def test_names_are_checked_where_they_enter():
    scene = Scene(mode="fixed")
    bay_robot(scene)
    for name in ("", "a/b", " a"):
        with pytest.raises(SceneError, match="is no name"):
            scene.add(Sphere(radius=1), name=name)
    with pytest.raises(SceneError, match="'arm' is taken"):
        bay_robot(scene)
    with pytest.raises(UnknownNameError, match="did you mean 'arm/link3'"):
        scene.allow("arm/lnk3", "arm/link5", reason="x")
    with pytest.raises(SceneError, match="without a reason"):
        scene.allow("arm/link3", "arm/link5", reason=" ")
    with pytest.raises(UnknownNameError, match="no object is named 'x'"):
        scene.remove("x")
    with pytest.raises(SceneError, match="it must be finite and >= 0"):
        scene.set_buffer("arm", "arm/link3", -1.0)


def test_removing_an_object_removes_its_rules():
    scene = Scene(mode="fixed")
    bay_robot(scene)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(2, 0, 0)))
    scene.allow("ball", "arm/link7", reason="soft")
    scene.set_buffer("ball", "arm", 0.01)
    scene.remove("ball")
    assert scene.allowances == []
    assert scene.pair_buffers == {}


def test_rules_name_their_source():
    scene = Scene(mode="fixed")
    scene.add_robot("panda", name="p")
    rules = {frozenset((r.body_a, r.body_b)): r.source for r in allowed_pairs(scene)}
    assert rules[frozenset(("p/panda_link1", "p/panda_link2"))] in ("adjacent", "srdf")
    assert rules[frozenset(("p/panda_link7", "p/panda_hand"))] in ("rigid", "srdf")
    assert "srdf" in rules.values()
    assert frozenset(("p/panda_link0", "p/panda_hand")) not in rules


def test_two_robots_are_always_checked_against_each_other(tmp_path):
    scene = load_scene(write(tmp_path, TWO_PANDAS))
    tables = Guard(scene).tables
    for i in range(tables.moving_count):
        for j in range(tables.moving_count):
            a, b = tables.body_names[i], tables.body_names[j]
            if a.split("/")[0] != b.split("/")[0]:
                assert tables.checked[tables.groups[i], tables.groups[j]]


def test_the_cube_grows_to_hold_objects_outside(tmp_path):
    text = ARM + (
        "objects: {far: {box: [1, 1, 1], at: {xyz: [9, 0, 0]}}}\n"
        "index: {cube: {centre: [0, 0, 1], edge: 3}}\n"
    )
    guard = Guard(load_scene(write(tmp_path, text)))
    assert guard.index.high[0] >= 9.5
    guard.index.check()


def test_many_like_fixtures_share_a_rule_group():
    scene = Scene(mode="fixed")
    bay_robot(scene)
    for k in range(50):
        scene.add(Sphere(radius=0.1), name=f"s{k}", pose=Pose(xyz=(3, 0.3 * k, 0)))
    assert Guard(scene).tables.checked.shape[0] == 8
