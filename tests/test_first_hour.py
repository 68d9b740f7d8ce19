"""Nine arms from a URDF to a guarded loop; Pinocchio and Coal judge their meshes."""

import json
import re
from dataclasses import replace
from importlib import import_module
from itertools import combinations
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.robot.named import robots_folder
from armguard.scene.allowed import allowed_pairs

FOLDER = Path(__file__).parents[1] / "examples" / "first_hour"
NAMES = ("kinova", "panda", "so100", "so101", "ur3", "ur5", "ur10", "xarm7", "z1")

# Postures of the motion without the guard.
BLIND = 41

# A pair in a sentence of `check`, and whether it says that they may be apart.
PAIR = re.compile(r"(\S+) and (\S+) by [0-9.]+ mm( \(their shapes reach)?")


@pytest.fixture(scope="module")
def program():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER))
        yield import_module("first_hour")


@pytest.fixture
def example(program, monkeypatch):
    """The program with checks in this process; others would load all kernels again."""

    def check(file):
        printed = CliRunner().invoke(app, ["check", str(file), "--json"]).stdout
        return json.loads(printed)["findings"]

    monkeypatch.setattr(program, "check", check)
    return program


class Meshes:
    """Collision geometry of one robot of a scene, read by Pinocchio for Coal."""

    def __init__(self, scene, name, urdf):
        self.model = pin.buildModelFromUrdf(str(urdf))
        self.geometry = pin.buildGeomFromUrdf(
            self.model,
            str(urdf),
            pin.GeometryType.COLLISION,
            package_dirs=[str(robots_folder().parents[1])],
        )
        self.joints = scene.robots[name].model.joints
        self.prefix = f"{name}/"
        base = scene.robots[name].base
        self.base = pin.SE3(pin.rpy.rpyToMatrix(*base.rpy), np.array(base.xyz))

    def placed(self, q):
        """Link, shape and placement of each mesh in the world at joint positions."""
        values = pin.neutral(self.model)
        for number in range(1, self.model.njoints):
            name, joint = self.model.names[number], self.model.joints[number]
            mimic = self.joints[name].mimic
            value = (
                q[self.prefix + name]
                if mimic is None
                else mimic.multiplier * q[self.prefix + mimic.joint] + mimic.offset
            )
            turn = (np.cos(value), np.sin(value)) if joint.nq == 2 else (value,)
            values[joint.idx_q : joint.idx_q + joint.nq] = turn
        data, placements = self.model.createData(), self.geometry.createData()
        pin.updateGeometryPlacements(
            self.model, data, self.geometry, placements, values
        )
        for part, place in zip(
            self.geometry.geometryObjects, placements.oMg, strict=True
        ):
            world = self.base * place
            at = coal.Transform3s(world.rotation, world.translation)
            link = self.model.frames[part.parentFrame].name
            yield self.prefix + link, part.geometry, at


class World:
    """All bodies of a scene, as Coal sees them.

    Args:
        scene: Two arms and a table.
        urdf: File of the arms.
    """

    def __init__(self, scene, urdf):
        self.names = scene.q_names
        self.robots = [Meshes(scene, name, urdf) for name in scene.robots]
        table = scene.objects["table"]
        at = coal.Transform3s(np.eye(3), np.array(table.pose.xyz))
        size = 2.0 * np.array(table.shapes[0].shape.half_extents)
        self.table = ("table", coal.Box(*size), at)
        self.allowed = {
            frozenset((rule.body_a, rule.body_b)) for rule in allowed_pairs(scene)
        }

    def contacts(self, q):
        """Checked pairs of bodies that touch at joint positions."""
        named = dict(zip(self.names, q, strict=True))
        placed = [part for robot in self.robots for part in robot.placed(named)]
        return {
            frozenset((a, b))
            for (a, *first), (b, *second) in combinations([self.table, *placed], 2)
            if a != b
            and frozenset((a, b)) not in self.allowed
            and coal.collide(
                *first, *second, coal.CollisionRequest(), coal.CollisionResult()
            )
        }


def world_of(example, name, scene):
    return World(scene, robots_folder() / example.ARMS[name].urdf)


def named_contacts(findings):
    """Overlaps at home that `check` reports: pair, and whether it is in doubt."""
    for row in findings:
        if row["topic"] == "home" and row["status"] == "FAIL":
            robot = row["keys"][1]
            for a, b, doubt in PAIR.findall(row["sentence"]):
                pair = [
                    x if "/" in x or x == "table" else f"{robot}/{x}" for x in (a, b)
                ]
                yield frozenset(pair), bool(doubt)


def home_of(scene):
    """Joint positions at home, in the order of the scene."""
    homes = {
        f"{name}/{joint}": position
        for name, robot in scene.robots.items()
        for joint, position in robot.home.items()
    }
    return [homes[name] for name in scene.q_names]


def test_the_example_has_nine_arms(example):
    assert set(example.ARMS) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_an_arm_is_guarded_within_eight_lines(name, example, tmp_path):
    hour = example.first_hour(name, tmp_path)
    assert hour.lines <= 8
    assert len(set(hour.pasted)) <= 1
    assert example.failures(hour.last) == []
    scene = ag.load_scene(hour.file)
    world = world_of(example, name, scene)

    # Each overlap that the first check reports as certain is one of the meshes.
    hour.file.write_text(example.scene_text(example.ARMS[name]))
    touching = world.contacts(home_of(ag.load_scene(hour.file)))
    reported = dict(named_contacts(hour.first))
    assert bool(reported) == bool(hour.pasted)
    assert {pair for pair, doubt in reported.items() if not doubt} <= touching

    # The same motion without the guard leads to a contact.
    arm = example.ARMS[name]
    k = scene.q_names.index(f"left/{arm.joint}")
    blind = np.repeat(hour.path[:1], BLIND, axis=0)
    blind[:, k] += np.linspace(0.0, arm.speed * example.SECONDS, BLIND)
    most = scene.robots["left"].model.joints[arm.joint].upper
    blind[:, k] = np.minimum(blind[:, k], most)
    assert any(map(world.contacts, blind))

    # With the guard the arm moves, and no mesh touches another in any cycle.
    assert np.ptp(hour.path[:, k]) > 0.1
    assert not any(map(world.contacts, hour.path))


def test_an_overlap_of_shapes_alone_is_reported_as_doubtful(example, tmp_path):
    """In a state of Kinova's SRDF the hulls of two links overlap, not the meshes."""
    arm = replace(example.ARMS["kinova"], srdf="kinova_description/srdf/kinova.srdf")
    (tmp_path / example.PACKAGE).symlink_to(robots_folder().parent)
    file = tmp_path / "scene.yaml"
    file.write_text(example.scene_text(arm))
    scene = ag.load_scene(file)
    reported = dict(named_contacts(example.check(file)))
    assert reported == {
        frozenset(f"{robot}/j2s6s200_link_{n}" for n in (2, 4)): True
        for robot in scene.robots
    }
    assert world_of(example, "kinova", scene).contacts(home_of(scene)) == set()


ARM = """<robot name="{name}"><link name="base"/><link name="upper"><collision>
<origin xyz="0 0 0.3"/><geometry><cylinder radius="0.05" length="0.5"/></geometry>
</collision></link><joint name="shoulder" type="revolute"><parent link="base"/>
<child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1.5" upper="1.5" velocity="{speed}" effort="50"/></joint></robot>"""


def test_each_robot_without_stopping_figures_gets_its_line(program, tmp_path):
    (tmp_path / "a.urdf").write_text(ARM.format(name="a", speed=2))
    (tmp_path / "b.urdf").write_text(ARM.format(name="b", speed=3))
    file = tmp_path / "scene.yaml"
    file.write_text(
        "robots:\n"
        "  left: {urdf: a.urdf}\n"
        "  right: {urdf: a.urdf, base: {xyz: [1, 0, 0]}}\n"
        "  third: {urdf: b.urdf, base: {xyz: [2, 0, 0]}}\n"
    )
    found = {row["keys"][1]: row for row in program.failures(program.check(file))}
    assert {name: row["paste"] for name, row in found.items()} == {
        "left": "stopping: {deceleration: 2}",
        "right": "stopping: {deceleration: 2}",
        "third": "stopping: {deceleration: 3}",
    }
    assert "no stopping figures" in found["third"]["sentence"]
    program.paste(file, list(found.values()))
    assert program.failures(program.check(file)) == []
