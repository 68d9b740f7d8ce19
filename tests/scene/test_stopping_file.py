"""Modes, times, buffers and stopping figures of a scene, in Python and in a file."""

import pytest

from armguard.errors import SceneError
from armguard.geometry import Box, Pose, Sphere
from armguard.scene import Scene, compile_scene
from armguard.scene.scene import FLOOR, MARGIN_BEYOND_BUFFER, PAPER_BUFFER
from arms import simple_arm

FIGURES = {"velocity": 1.0, "deceleration": 4.0}


def far_ball(scene, name="ball", **settings):
    return scene.add(
        Sphere(radius=0.1), name=name, pose=Pose(xyz=(3, 0, 0)), **settings
    )


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"mode": "paht"}, "mode is 'paht'; it must be one of fixed, speed, path"),
        ({"period": 0.0}, "period is 0 s; it must be > 0"),
        ({"period": -1.0}, "period is -1.0 s; it must be finite and >= 0"),
        ({"late": float("nan")}, "late is nan s; it must be finite and >= 0"),
        ({"late": float("inf")}, "late is inf s; it must be finite and >= 0"),
    ],
)
def test_a_mode_or_a_time_that_is_none_is_refused(settings, says):
    with pytest.raises(SceneError) as caught:
        Scene(**settings)
    assert str(caught.value) == says


def test_a_robot_takes_the_mode_of_its_scene_or_its_own():
    scene = Scene()
    scene.add_robot(simple_arm(), name="a", stopping=FIGURES)
    scene.add_robot(simple_arm(), name="b", mode="fixed")
    assert (scene.mode, scene.period, scene.late) == ("path", 0.001, 0.0)
    assert [robot.mode for robot in scene.robots.values()] == ["path", "fixed"]
    assert scene.robots["a"].stopping.deceleration.tolist() == [4.0] * 3
    assert scene.robots["b"].stopping is None
    scene.validate()
    with pytest.raises(SceneError, match="robot 'c': mode is 'x'"):
        scene.add_robot(simple_arm(), name="c", mode="x")


@pytest.mark.parametrize("mode", ["speed", "path"])
def test_without_figures_a_robot_is_only_guarded_in_fixed(mode):
    scene = Scene(mode=mode)
    scene.add_robot(simple_arm(), name="arm")
    with pytest.raises(SceneError) as caught:
        compile_scene(scene)
    for words in (
        f"robot 'arm' is in mode '{mode}'",
        "stopping: {deceleration: ...}",
        "`mode: fixed`",
    ):
        assert words in str(caught.value)


def test_the_buffer_is_the_papers_in_fixed_and_a_floor_where_figures_make_it():
    fixed = Scene(mode="fixed")
    fixed.add_robot(simple_arm(), name="arm")
    far_ball(fixed)
    assert fixed.buffer_of("arm/link1") == fixed.buffer_of("ball") == PAPER_BUFFER
    assert fixed.margin == PAPER_BUFFER + MARGIN_BEYOND_BUFFER

    path = Scene()
    path.add_robot(simple_arm(), name="arm", stopping=FIGURES)
    far_ball(path)
    assert path.buffer_of("arm/link1") == path.buffer_of("ball") == FLOOR
    assert path.largest_buffer == FLOOR

    given = Scene(buffer=0.02)
    given.add_robot(simple_arm(), name="arm", stopping=FIGURES)
    given.add_robot(simple_arm(), name="own", stopping=FIGURES, buffer=0.01)
    far_ball(given, buffer=0.04)
    assert given.buffer_of("arm/link1") == 0.02
    assert given.buffer_of("own/link1") == 0.01
    assert given.buffer_of("ball") == given.largest_buffer == 0.04


def test_beside_a_moving_floor_a_fixed_robot_keeps_the_papers_buffer():
    scene = Scene()
    scene.add_robot(simple_arm(), name="path", stopping=FIGURES)
    scene.add_robot(simple_arm(), name="fixed", mode="fixed", base=Pose(xyz=(0, 5, 0)))
    far_ball(scene)
    scene.add(Sphere(radius=0.01), name="held", attached_to="fixed/link3")
    assert scene.buffer_of("ball") == FLOOR
    assert scene.buffer_of("held") == scene.buffer_of("fixed/link1") == PAPER_BUFFER
    tables = compile_scene(scene)
    buffers = {
        (tables.body_names[i], tables.body_names[j]): tables.buffers[
            tables.groups[i], tables.groups[j]
        ]
        for i in range(len(tables.kinds))
        for j in range(len(tables.kinds))
    }
    assert buffers["path/link1", "ball"] == FLOOR
    assert buffers["fixed/link1", "ball"] == PAPER_BUFFER
    assert buffers["fixed/link1", "path/link1"] == PAPER_BUFFER


def test_an_object_may_have_a_speed_and_be_a_person():
    scene = Scene()
    assert far_ball(scene).top_speed == 0.0
    person = far_ball(scene, "visitor", top_speed=1.6, person=True)
    assert (person.top_speed, person.person) == (1.6, True)
    mesh = ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    sheet = scene.add_mesh(mesh, name="sheet", top_speed=0.5)
    assert sheet.top_speed == 0.5


@pytest.mark.parametrize("speed", [-1.0, float("nan"), float("inf")])
def test_a_speed_that_is_none_is_refused(speed):
    with pytest.raises(SceneError, match=r"top_speed is .* m/s; it must be finite"):
        far_ball(Scene(), top_speed=speed)


@pytest.mark.parametrize("own", [{"top_speed": 1.0}, {"person": True}])
def test_what_rides_on_a_link_has_no_speed_of_its_own(own):
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(), name="arm")
    with pytest.raises(SceneError, match="it moves as its link does"):
        scene.add(
            Box(half_extents=(0.1, 0.1, 0.1)),
            name="held",
            attached_to="arm/link1",
            **own,
        )
