"""What a scene says about grippers and what they may grip."""

import numpy as np
import pytest

from armguard.errors import SceneError, UnknownNameError
from armguard.geometry import Box, HalfSpace, Pose, Sphere, Triangle
from armguard.scene import Grasp, Gripper, Scene, compile_scene, load_scene
from grippers import BLOCK, CLOSED, FIGURES, FINGER, HAND, gantry, pick_scene

PANDA = """
robots:
  arm:
    urdf: panda
    gripper: {link: panda_hand, fingers: [panda_leftfinger, panda_rightfinger]}
objects:
  table: {box: [1.2, 2.0, 0.05], at: {xyz: [0.5, 0, -0.13]}}
  cup:
    cylinder: {radius: 0.03, height: 0.1}
    at: {xyz: [0.5, 0.3, 0.05]}
    graspable: {depth: 0.001, creep: 0.01}
    rests_on: table
  nut: {box: [0.02, 0.02, 0.02], at: {xyz: [0.5, -0.3, 0.05]}, graspable: true}
"""


def written(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return path


def test_a_file_says_what_may_be_gripped_and_by_what(tmp_path):
    scene = load_scene(written(tmp_path, PANDA))
    assert scene.robots["arm"].gripper == Gripper(
        link="panda_hand", fingers=("panda_leftfinger", "panda_rightfinger")
    )
    assert scene.objects["cup"].graspable == Grasp(depth=0.001, creep=0.01)
    assert scene.objects["cup"].rests_on == ("table",)
    assert scene.objects["nut"].graspable == Grasp()
    assert scene.objects["table"].graspable is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("panda_hand,", "panda_hnad,", "did you mean 'panda_hand'"),
        ("[panda_leftfinger", "[panda_link2", "does not ride on"),
        ("fingers: [panda_leftfinger, panda_rightfinger]", "fingers: []", "at least 1"),
        ("link: panda_hand", "link: panda_link0", "part of its base"),
        ("depth: 0.001", "deep: 0.001", "there is no such key"),
        ("depth: 0.001", "depth: -0.001", "must be >= 0"),
        ("creep: 0.01", "creep: 0.5", "must not exceed intent_speed"),
        ("creep: 0.01", "creep: .nan", "finite"),
        ("rests_on: table", "rests_on: tabel", "did you mean 'table'"),
        ("graspable: true", "graspable: true, top_speed: 1", "has a top_speed"),
        ("graspable: true", "rests_on: table", "not graspable"),
    ],
)
def test_what_cannot_be_is_refused_in_words(tmp_path, old, new, words):
    assert old in PANDA
    with pytest.raises(SceneError) as error:
        load_scene(written(tmp_path, PANDA.replace(old, new)))
    assert words in str(error.value)


@pytest.mark.parametrize(
    "shape", [HalfSpace(), Triangle(a=(0, 0, 0), b=(1, 0, 0), c=(0, 1, 0))]
)
def test_what_no_gripper_carries_is_not_graspable(shape):
    with pytest.raises(SceneError, match="no gripper carries"):
        Scene().add(shape, name="thing", graspable=True)


def test_what_is_attached_is_not_graspable():
    scene = Scene()
    scene.add_robot(gantry(), name="arm", stopping=FIGURES)
    with pytest.raises(SceneError, match="leave one of them out"):
        scene.add(
            Sphere(radius=0.1), name="tool", attached_to="arm/hand", graspable=True
        )
    with pytest.raises(UnknownNameError, match="no link 'grip'"):
        scene.add_robot(
            gantry(), name="two", stopping=FIGURES,
            gripper=Gripper(link="hand", fingers=("grip",)),
        )  # fmt: skip


def test_the_coarse_box_holds_hand_and_fingers_wherever_they_are():
    tables = compile_scene(pick_scene())
    first, end = tables.holds.places["arm/hand (coarse)"]
    assert end == first + 1
    row = tables.local_rows[first]
    low, high = row[1:4] - row[4:7], row[1:4] + row[4:7]
    reach = CLOSED + 0.05 + FINGER[1]
    assert low == pytest.approx([-HAND[0], -max(HAND[1], reach), -0.09])
    assert high == pytest.approx([HAND[0], max(HAND[1], reach), HAND[2]])


def test_what_is_free_is_checked_against_robots_and_nothing_else():
    tables = compile_scene(pick_scene(blocks={"one": (0, 0), "two": (0.1, 0)}))
    holds = tables.holds
    group = holds.group_of
    assert not tables.checked[group["one"], group["table"]]
    assert not tables.checked[group["one"], group["two"]]
    assert tables.checked[group["one"], group["arm/left"]]
    held = holds.checked(["one"])
    assert held[group["one"], group["table"]]
    assert held[group["two"], group["one"]]
    assert not held[group["two"], group["table"]]
    assert np.array_equal(held, held.T)
    first, _ = holds.places["one"]
    assert tables.robot_of_primitive[first] == -1
    assert tables.local_rows[first][4:7] == pytest.approx(BLOCK)


def test_a_scene_without_grippers_is_compiled_as_ever():
    scene = Scene()
    scene.add_robot(gantry(), name="arm", stopping=FIGURES)
    scene.add(Box(size=(0.04, 0.04, 0.06)), name="box", pose=Pose(xyz=(0.5, 0.5, 0.5)))
    tables = compile_scene(scene)
    assert not tables.holds.grippers
    assert not tables.holds.objects
    assert (tables.robot_of_primitive >= 0).all()
    assert np.array_equal(tables.checked, tables.holds.rules)
