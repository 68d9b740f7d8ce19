"""What an object prints: one short line, names for numbers, tables in notebooks."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest

import armguard as ag
from approach import FIGURES
from armguard.respond.command import Blocked
from armguard.robot.stopping import StoppingFigures
from arms import simple_arm


@pytest.fixture(scope="module")
def scene():
    made = ag.Scene(period=0.002)
    for name, x in (("left", 0.0), ("<right>", 1.0)):
        base = ag.Pose(xyz=(x, 0, 0))
        made.add_robot(simple_arm(1), name, base=base, stopping=FIGURES)
    for k in range(12):
        made.add(ag.Sphere(radius=0.1), f"ball{k}", pose=ag.Pose(xyz=(0.5, k - 3.5, 1)))
    return made


@pytest.fixture(scope="module")
def command(scene):
    guard = ag.Guard(scene, self_test=False)
    still = np.zeros(2)
    return guard.filter(guard.home, still, 0.0, velocity=still)


def test_numbers_print_as_their_names():
    for kind in (ag.Level, ag.Reason, ag.Action, Blocked):
        for member in kind:
            assert str(member) == f"{member}" == member.name
            assert f"{member:>20}".strip() == member.name
            assert json.dumps(member) == str(int(member))
    assert repr(ag.Level.STOP) == "<Level.STOP: 30>"


def test_every_repr_is_one_short_line(scene, command):
    guard = ag.Guard(scene, self_test=False)
    robot, item = scene.robots["left"], scene.objects["ball0"]
    rng = np.random.default_rng(0)
    shapes = [kind.example(rng, 0.123) for kind in ag.SHAPES.values()]
    objects = [scene, robot, robot.model, robot.stopping, item, guard, command]
    objects += [command.verdict, ag.Pose(xyz=(0.1, 0.2, 1 / 3)), *shapes]
    for one in objects:
        shown = repr(one)
        assert len(shown) <= 250, shown
        assert "\n" not in shown
        assert " object at 0x" not in shown
        assert type(one).__name__.strip("<>") in shown


def test_a_repr_names_what_is_in_it(scene, command):
    assert repr(scene).startswith("<Scene period 2 ms; robots: left, <right>; objects:")
    assert repr(scene).endswith("ball7 and 4 more>")
    assert repr(ag.Scene()) == "<Scene period 1 ms; robots: none; objects: none>"
    assert repr(scene.robots["left"]) == (
        "<SceneRobot left: arm, 1 joints, mode path, base Pose(xyz=(0, 0, 0), "
        "rpy=(0, 0, 0))>"
    )
    mesh = ag.Scene().add_mesh(([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), "m")
    assert repr(mesh).startswith("<SceneObject m: 1 Triangle at Pose(")
    assert isinstance(scene.robots["left"].stopping, StoppingFigures)
    assert "joint1 2 4" in repr(scene.robots["left"].stopping)
    assert repr(command).startswith("<Command CLEAR FOLLOW: ")
    assert (
        repr(ag.Pose(rpy=(0, 0, np.pi / 2)))
        == "Pose(xyz=(0, 0, 0), rpy=(0, 0, 1.5708))"
    )


def rows_of(html):
    """Rows of all tables of a piece of HTML, and their captions."""
    root = ElementTree.fromstring(f"<div>{html}</div>")
    captions = [caption.text for caption in root.iter("caption")]
    return [[cell.text for cell in row] for row in root.iter("tr")], captions


def test_notebooks_show_tables_whose_text_is_escaped(scene, command):
    rows, captions = rows_of(scene._repr_html_())
    assert captions[0] == "Scene, period 2 ms"
    assert ["robot", "model", "joints", "mode", "base"] in rows
    assert [row[:4] for row in rows if row[0] == "<right>"] == [
        ["<right>", "arm", "1", "path"]
    ]
    assert sum(row[1] == "1 Sphere" for row in rows) == 12
    rows, captions = rows_of(command._repr_html_())
    assert captions == [f"FOLLOW: {command.why}"]
    assert rows[1] == ["left", "FOLLOW", "follows its operator", "100 %"]
    assert rows[2][0] == "<right>"


def test_the_table_of_a_verdict_has_the_nearest_pair():
    scene = ag.Scene()
    scene.add_robot(simple_arm(1), "arm", stopping=FIGURES)
    scene.add(ag.Sphere(radius=0.1), "ball", pose=ag.Pose(xyz=(0.4, 0.16, 0.2)))
    verdict = ag.Guard(scene, self_test=False).judge_at_rest([0.0])
    pair = verdict.nearest
    rows, captions = rows_of(verdict._repr_html_())
    assert captions[0] == f"{verdict.level}: {verdict.why}"
    assert rows[1][0] == "arm"
    assert rows[-2] == ["nearest pair", "distance", "required", "headroom"]
    assert rows[-1] == [
        "arm/link1 to ball",
        f"{pair.distance * 1e3:.1f} mm",
        f"{pair.needed * 1e3:.1f} mm",
        f"{pair.headroom * 1e3:.1f} mm",
    ]
