"""Modes, times, buffers and stopping figures of a scene, in Python and in a file."""

import re
from pathlib import Path
from textwrap import indent

import numpy as np
import pytest

from armguard.errors import SceneError
from armguard.geometry import Box, Pose, Sphere
from armguard.robot.stopping.figures import FIGURES as DECLARED
from armguard.robot.stopping.figures import NAME_OF
from armguard.scene import Scene, bay_path, bay_scene, compile_scene, load_scene
from armguard.scene.bay import FOLDER
from armguard.scene.contents import FLOOR, MARGIN_BEYOND_BUFFER, PAPER_BUFFER
from armguard.scene.file_models import StoppingModel
from armguard.scene.schema import Strict
from armguard.scene.yaml_source import SceneFileError
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
        "stopping: {deceleration: 5}  # assumed: measure it",
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
            Box(size=(0.2, 0.2, 0.2)),
            name="held",
            attached_to="arm/link1",
            **own,
        )


FILE = """robots:
  arm:
    urdf: {urdf}
    {rest}
"""

FULL = """stopping:
      velocity: 1.0
      acceleration: {joint1: 8, joint2: 8, joint3: 8, joint4: 8, joint5: 9, joint6: 9,
                     joint7: 9}
      deceleration: 4.0
      most: 9.0
      ramp: 0.01
      settle: 0.002
      settle_time: 0.1
      brake: {delay: 0.05, deceleration: 10.0}
      errors: {position: 0.0002, velocity: 0.02, tracking: 0.03, model: 0.001,
               base: 0.002, base_turn: 0.01}
      delays: {sensing: 0.003, command: 0.005, stale: 0.02}
      tables: {joint1: [[0.5, 0.2, 0.08], [1.0, 0.3, 0.2]]}
mode: speed
cycle: {period: 0.002, late: 0.001}
objects:
  belt: {box: [1, 1, 1], at: {xyz: [5, 0, 0]}, top_speed: 0.4}
  visitor: {sphere: {radius: 1}, at: {xyz: [0, 5, 0]}, top_speed: 1.6, person: true}
"""


def write(tmp_path, rest):
    path = tmp_path / "scene.yaml"
    path.write_text(FILE.format(urdf=FOLDER / "bay_arm.urdf", rest=rest))
    return path


def test_a_file_says_mode_cycle_and_every_figure(tmp_path):
    scene = load_scene(write(tmp_path, FULL))
    assert (scene.mode, scene.period, scene.late) == ("speed", 0.002, 0.001)
    assert scene.robots["arm"].mode == "speed"
    assert scene.objects["belt"].top_speed == 0.4
    assert scene.objects["visitor"].person
    figures = scene.robots["arm"].stopping
    assert figures.acceleration.tolist() == [8, 8, 8, 8, 9, 9, 9]
    assert (figures.deceleration[0], figures.deceleration_most[0]) == (4.0, 9.0)
    assert (figures.ramp, figures.settle_time) == (0.01, 0.1)
    assert (figures.brake_delay, figures.brake_deceleration[0]) == (0.05, 10.0)
    assert (figures.model_error, figures.base_error, figures.base_turn) == (
        0.001,
        0.002,
        0.01,
    )
    assert (figures.sensing, figures.command, figures.stale) == (0.003, 0.005, 0.02)
    assert figures.tables["joint1"].travels == (0.08, 0.2)
    assert figures.tracking_error.tolist() == [0.03] * 7
    assert figures.sources == {}


def test_a_table_is_read_from_beside_the_scene(tmp_path):
    (tmp_path / "stop.csv").write_text(
        "joint,speed_percent,load_percent,time_s,angle_rad\n"
        "joint1,100,50,0.3,0.2\njoint1,100,100,0.4,0.3\n"
    )
    rest = "stopping: {deceleration: 4.0, tables: stop.csv}\n"
    figures = load_scene(write(tmp_path, rest)).robots["arm"].stopping
    assert figures.tables["joint1"].speeds == (1.25,)
    assert figures.tables["joint1"].times == (0.4,)
    rest = "stopping: {deceleration: 4.0, tables: {file: stop.csv, load: 50}}\n"
    figures = load_scene(write(tmp_path, rest)).robots["arm"].stopping
    assert figures.tables["joint1"].times == (0.3,)


WRONG = {
    "no figures": ("", ":2: robots.arm: robot 'arm' is in mode 'path' and has no"),
    "mode": ("mode: slow", ":4: robots.arm.mode: is 'slow'; it must be 'fixed', "),
    "cycle": (
        "mode: fixed\ncycle: {period: 0}",
        ":5: cycle.period: is 0; it must be > 0",
    ),
    "late": (
        "mode: fixed\ncycle: {late: .inf}",
        ":5: cycle.late: is inf; it must be finite",
    ),
    "unknown": (
        "stopping: {decelaration: 4}",
        "stopping.decelaration: there is no such key; did you mean 'deceleration'",
    ),
    "unknown inside": (
        "stopping:\n      deceleration: 4\n      brake: {dely: 1}",
        ":6: robots.arm.stopping.brake.dely: there is no such key; did you mean",
    ),
    "missing": (
        "stopping: {velocity: 1}",
        "stopping.deceleration: deceleration is missing: the least",
    ),
    "zero": ("stopping: {deceleration: 0}", "deceleration: is 0; it must be > 0"),
    "nan": (
        "stopping: {deceleration: .nan}",
        "deceleration: is nan; it must be finite",
    ),
    "text": ("stopping: {deceleration: hard}", "expected a number, got 'hard'"),
    "latency": (
        "stopping: {deceleration: 4, delays: {sensing: -0.002}}",
        "stopping.delays.sensing: is -0.002; it must be >= 0",
    ),
    "degrees": (
        "stopping:\n      deceleration: 4\n      velocity: 90",
        ":6: robots.arm.stopping.velocity: velocity of joint 'joint1' is 90, which "
        "looks like degrees; give radians",
    ),
    "a joint": (
        "stopping:\n      deceleration:\n        joint1: 4\n        jont2: 4",
        ":7: robots.arm.stopping.deceleration.jont2: deceleration is given for 'jont2'",
    ),
    "most": (
        "stopping: {deceleration: 4, most: 2}",
        "robots.arm.stopping.most: deceleration_most of joint 'joint1' is 2, below",
    ),
    "stale": (
        "stopping: {deceleration: 4, delays: {sensing: 0.02}}",
        "stopping.delays.stale: stale is 10 ms, less than sensing, 20 ms",
    ),
    "no table": (
        "stopping: {deceleration: 4, tables: stop.csv}",
        "stopping.tables: stop.csv: cannot be read: No such file",
    ),
    "table rows": (
        "stopping: {deceleration: 4, tables: {joint1: [[1, 0.3]]}}",
        "stopping.tables.joint1[0]: expected 3 numbers, got 2",
    ),
    "table of nobody": (
        "stopping: {deceleration: 4, tables: {joint8: [[1, 0.3, 0.2]]}}",
        "stopping.tables.joint8: there is a stopping table for 'joint8', no joint",
    ),
    "object speed": (
        "mode: fixed\nobjects: {b: {box: [1, 1, 1], top_speed: -1}}",
        "objects.b.top_speed: is -1; it must be >= 0",
    ),
    "attached": (
        "mode: fixed\nobjects: {b: {box: [1, 1, 1], attached_to: arm/link7, "
        "person: true}}",
        "objects.b: object 'b' rides on 'arm/link7' and has a top_speed or is a person",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_line_and_key(case, tmp_path):
    rest, says = WRONG[case]
    with pytest.raises(SceneFileError) as caught:
        load_scene(write(tmp_path, rest + "\n"))
    assert says in str(caught.value)


def test_the_bay_goes_from_fixed_to_path_with_one_line(tmp_path):
    text = bay_path().read_text()
    assert text.count("\nmode: fixed\n") == 1
    text = text.replace("\nmode: fixed\n", "\nmode: path\n")
    path = tmp_path / "bay.yaml"
    path.write_text(text.replace("bay_arm.urdf", str(FOLDER / "bay_arm.urdf")))
    assert {robot.mode for robot in load_scene(path).robots.values()} == {"path"}
    fixed = bay_scene()
    assert {robot.mode for robot in fixed.robots.values()} == {"fixed"}
    assert fixed.largest_buffer == PAPER_BUFFER


def test_a_named_robot_brings_its_figures_and_one_may_be_replaced(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("robots:\n  p: {urdf: panda, stopping: {errors: {base: 0.003}}}\n")
    figures = load_scene(path).robots["p"].stopping
    assert figures.base_error == 0.003
    assert figures.deceleration[0] == 7.5
    assert figures.sources["acceleration"].startswith("Franka")
    assert "base_error" not in figures.sources


PAGE = (Path(__file__).parents[2] / "docs" / "stopping.md").read_text(encoding="utf-8")


def keys_of(model, before=""):
    """Keys of a mapping of the file, those inside it with dots."""
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, Strict):
            yield from keys_of(inner, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def test_the_page_has_every_key_and_the_defaults_there_are():
    rows = dict(re.findall(r"^\| `([a-z_.]+)` \|.*\| ([^|]+) \|$", PAGE, re.MULTILINE))
    assert set(keys_of(StoppingModel)) == set(rows)
    for key, stated in rows.items():
        if re.fullmatch(r"[\d.]+", stated):
            assert float(stated) == DECLARED[NAME_OF[key]].default, key


def test_the_example_of_the_page_is_read(tmp_path):
    (text,) = re.findall(r"```\n(joint,.*?)```", PAGE, re.DOTALL)
    (tmp_path / "stop.csv").write_text(text)
    (entry,) = re.findall(r"```yaml\nstopping:\n(.*?)```", PAGE, re.DOTALL)
    rest = "stopping:\n" + indent(entry, "    ") + "      deceleration: 5.0\n"
    figures = load_scene(write(tmp_path, rest)).robots["arm"].stopping
    assert figures.tables["joint1"].speeds == pytest.approx((0.66, 1.32, 2.0))
    assert figures.tables["joint1"].times == pytest.approx((0.23, 0.29, 0.35))


def test_how_old_states_may_be_is_set_for_all_robots():
    scene = bay_scene("path")
    scene.set_stale(0.1)
    assert [robot.stopping.stale for robot in scene.robots.values()] == [0.1, 0.1]
    for wrong, words in {
        0.0: "finite and > 0",
        np.nan: "finite",
        1e-4: "to measure",
    }.items():
        with pytest.raises(SceneError, match=words):
            scene.set_stale(wrong)
    assert [robot.stopping.stale for robot in scene.robots.values()] == [0.1, 0.1]


MESHED = """<robot name="r">
<link name="a"><collision><geometry><mesh filename="m.obj"/></geometry></collision>
</link>
<link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="1" effort="1" velocity="37"/></joint></robot>"""


CHEAP = {
    "figures": (("", ""), "", "robots 'left', 'right' are in mode 'path' and have no"),
    "home": (
        (", mode: fixed, home: {j: 2}", ", mode: fixed"),
        "",
        "home puts joint 'j' at 2",
    ),
    "gripper": (
        (", mode: fixed, gripper: {link: b, fingers: [x]}", ", mode: fixed"),
        "",
        "has no link 'x' for its gripper",
    ),
    "allow": (
        (", mode: fixed", ", mode: fixed"),
        "allow: [{a: left/x, b: right/a, reason: why}]\n"
        "objects: {o: {mesh: {file: m.obj}}}",
        "no body is named 'left/x'",
    ),
    "mesh": ((", mode: fixed", ", mode: fixed"), "", "m.obj' has no triangle"),
}


@pytest.mark.parametrize("case", CHEAP)
def test_what_needs_no_mesh_is_checked_before_one_is_read(tmp_path, case):
    """The mesh cannot be read: only a scene without another mistake gets that far."""
    (left, right), rest, says = CHEAP[case]
    (tmp_path / "r.urdf").write_text(MESHED)
    (tmp_path / "m.obj").write_text("no mesh")
    path = tmp_path / "scene.yaml"
    robots = f"{{left: {{urdf: r.urdf{left}}}, right: {{urdf: r.urdf{right}}}}}"
    path.write_text(f"robots: {robots}\n{rest}\n")
    with pytest.raises(SceneFileError) as caught:
        load_scene(path)
    assert says in str(caught.value)
    assert ("m.obj" in str(caught.value)) == (case == "mesh")
    assert str(caught.value).count("no stopping figures") == (case == "figures")


def test_a_high_speed_limit_of_the_urdf_is_a_note_with_its_line(tmp_path):
    (tmp_path / "r.urdf").write_text(
        MESHED.replace('<mesh filename="m.obj"/>', '<sphere radius="0.1"/>')
    )
    scene = Scene()
    robot = scene.add_robot(
        tmp_path / "r.urdf", name="arm", stopping={"deceleration": 4.0}
    )
    assert robot.stopping.velocity.tolist() == [37.0]
    (note,) = scene.notes
    assert "'r.urdf' line 4: joint 'j' has the speed limit 37" in note
    assert "`stopping: {velocity: 5}`" in note
    scene.add_robot(
        tmp_path / "r.urdf", name="b", stopping={"deceleration": 4.0, "velocity": 5.0}
    )
    assert len(scene.notes) == 1
