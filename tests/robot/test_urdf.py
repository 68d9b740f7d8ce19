"""URDF and SRDF: what is read, and what is refused, with file and line."""

import math

import numpy as np
import pytest

from armguard.errors import MeshError, ModelError
from armguard.geometry import Box, Capsule, Sphere
from armguard.robot import find_named_robot, load_urdf
from armguard.robot.limits import home_configuration
from armguard.robot.model import Cylinder, JointKind, MeshFile
from armguard.robot.named import ROBOTS

SHAPE = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def joint(name="j", parent="a", child="b", kind="revolute", inner=LIMIT):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{inner}</joint>'
    )


def robot(*parts, links=("a", "b"), shape=SHAPE):
    text = "".join(f'<link name="{n}">{shape}</link>\n' for n in links)
    return f'<robot name="r">\n{text}{"".join(parts)}\n</robot>'


def load(tmp_path, text, **options):
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return load_urdf(path, **options)


REFUSED = {
    "no xml": ("<robot>", "is not XML"),
    "wrong root": ("<model/>", "starts with <model>; it must be <robot>"),
    "dtd": ('<!DOCTYPE r [<!ENTITY x "y">]><robot/>', "has a DTD or entities"),
    "no link": ("<robot/>", "has no <link>"),
    "double link": (robot(links=("a", "a")), "line 3: link 'a' is already on line 2"),
    "double joint": (
        robot(joint(), joint(child="c"), links=("a", "b", "c")),
        "joint 'j' is already on line",
    ),
    "unknown parent": (
        robot(joint(parent="aa")),
        "parent link 'aa', which does not exist; did you mean 'a'",
    ),
    "unknown child": (robot(joint(child="x")), "child link 'x', which does not exist"),
    "two parents": (
        robot(joint(), joint("k", "c", "b"), links=("a", "b", "c")),
        "is the child of joint 'k' and of 'j'; a link has one parent",
    ),
    "loop": (
        robot(joint(), joint("k", "b", "a")),
        "links form a loop: a -> b -> a",
    ),
    "two roots": (robot(), "has 2 links without a parent: 'a', 'b'"),
    "unknown type": (
        robot(joint(kind="revolut")),
        "has type 'revolut'; did you mean 'revolute'",
    ),
    "floating": (robot(joint(kind="floating")), "joint 'j' is floating; write it as"),
    "planar": (robot(joint(kind="planar")), "joint 'j' is planar"),
    "no limit": (robot(joint(inner="")), "is revolute and has no <limit"),
    "limits crossed": (
        robot(joint(inner='<limit lower="1" upper="-1"/>')),
        "lower limit 1.0 above its upper -1.0",
    ),
    "limit nan": (
        robot(joint(inner='<limit lower="nan" upper="1"/>')),
        'lower is "nan"; it must be a finite number',
    ),
    "limit infinite": (
        robot(joint(inner='<limit lower="-inf" upper="1"/>')),
        "it must be a finite number",
    ),
    "speed negative": (
        robot(joint(inner='<limit lower="0" upper="1" velocity="-1"/>')),
        "velocity limit -1.0",
    ),
    "zero axis": (robot(joint(inner='<axis xyz="0 0 0"/>' + LIMIT)), "of length 0"),
    "nan axis": (
        robot(joint(inner='<axis xyz="nan 0 0"/>' + LIMIT)),
        "it must be 3 finite numbers",
    ),
    "short xyz": (
        robot(joint(inner='<origin xyz="0 0"/>' + LIMIT)),
        'xyz is "0 0"; it must be 3 finite numbers',
    ),
    "mimic of nobody": (
        robot(joint(inner='<mimic joint="jj"/>' + LIMIT)),
        "mimics 'jj', which does not exist",
    ),
    "mimic of itself": (
        robot(joint(inner='<mimic joint="j"/>' + LIMIT)),
        "which is a mimic itself",
    ),
    "no collision": (
        robot(joint(), shape=""),
        "no collision geometry on any of its 2",
    ),
    "radius no number": (
        robot(joint(), shape=SHAPE.replace("0.1", "abc")),
        'radius is "abc"; it must be a finite number',
    ),
    "radius negative": (
        robot(joint(), shape=SHAPE.replace("0.1", "-0.1")),
        'radius is "-0.1"; it must be > 0',
    ),
    "radius zero": (robot(joint(), shape=SHAPE.replace("0.1", "0")), "it must be > 0"),
    "unknown shape": (
        robot(joint(), shape="<collision><geometry><cone/></geometry></collision>"),
        "<cone> is no shape of a URDF; there are box, capsule, cylinder, ellipsoid, "
        "mesh, sphere",
    ),
    "two shapes": (
        robot(joint(), shape=SHAPE.replace("</geom", '<sphere radius="1"/></geom')),
        "has 2 shapes in its <geometry>; it must be one",
    ),
    "no name": (robot(joint(name="")), "<joint> has no name"),
    "no child": (
        '<robot><link name="a"/><joint name="j" type="fixed"><parent link="a"/>'
        "</joint></robot>",
        "joint 'j' has no <child>",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_guarded_is_refused_in_words(case, tmp_path):
    text, says = REFUSED[case]
    with pytest.raises(ModelError) as caught:
        load(tmp_path, text)
    assert says in str(caught.value)
    assert "'r.urdf'" in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        load_urdf(tmp_path / "none.urdf")


def test_a_missing_mesh_lists_where_it_was_sought(tmp_path):
    mesh = '<mesh filename="package://p/m.stl"/>'
    mesh = f"<collision><geometry>{mesh}</geometry></collision>"
    with pytest.raises(MeshError) as caught:
        load(tmp_path, robot(joint(), shape=mesh))
    assert "names the mesh 'package://p/m.stl'" in str(caught.value)
    assert str(tmp_path / "p" / "m.stl") in str(caught.value)
    first, *places = str(caught.value).splitlines()
    assert "`packages: {p: FOLDER}`" in first
    assert len(places) == 4
    assert places[-1].strip().startswith("… ")


@pytest.mark.parametrize(
    "name",
    ["file:///maker/arm_description/a/meshes/m.obj", "package://p/old/a/meshes/m.obj"],
)
def test_a_mesh_of_another_machine_is_found_by_its_longest_tail(tmp_path, name):
    right, wrong = (tmp_path / "d" / x for x in ("a/meshes", "meshes"))
    for folder in (right, wrong):
        folder.mkdir(parents=True)
        (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    shape = f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
    text = robot(joint(), shape=shape)
    model = load(tmp_path, text, packages={"p": tmp_path / "d"})
    assert model.links["a"].collisions[0].geometry.path == right / "m.obj"
    with pytest.raises(MeshError, match=r"packages: \{(p|arm_description): FOLDER\}"):
        load(tmp_path, text)


def test_a_name_of_a_mesh_alone_is_no_tail(tmp_path):
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "m.obj").write_text("v 0 0 0\n")
    mesh = '<mesh filename="file:///maker/visual/m.obj"/>'
    text = robot(joint(), shape=f"<collision><geometry>{mesh}</geometry></collision>")
    with pytest.raises(MeshError, match="not found"):
        load(tmp_path, text, packages={"p": tmp_path / "d"})


def test_xacro_is_named_with_the_way_out(tmp_path):
    spaced = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    text = f'<robot name="r" {spaced}><xacro:include filename="a"/></robot>'
    with pytest.raises(ModelError, match=r"is a xacro file; .*mv r.urdf r.urdf.xacro"):
        load(tmp_path, text)
    # What xacro has expanded still declares its namespace.
    expanded = robot(joint()).replace("<robot", f"<robot {spaced}", 1)
    assert load(tmp_path, expanded).root == "a"
    with pytest.raises(ModelError, match=r"<sdf>; it must be <robot> or <mujoco>"):
        load(tmp_path, "<sdf/>")


def test_shapes_axes_and_limits_are_read(tmp_path):
    parts = [
        '<sphere radius="0.1"/>',
        '<box size="0.2 0.4 0.6"/>',
        '<cylinder radius="0.1" length="0.5"/>',
        '<capsule radius="0.1" length="0.5"/>',
    ]
    shape = "".join(f"<collision><geometry>{p}</geometry></collision>" for p in parts)
    model = load(
        tmp_path,
        robot(joint(inner='<axis xyz="0 0 2"/>' + LIMIT), shape=shape),
    )
    found = [e.geometry for e in model.links["a"].collisions]
    assert found == [
        Sphere(radius=0.1),
        Box(size=(0.2, 0.4, 0.6)),
        Cylinder(0.1, 0.5),
        Capsule(start=(0, 0, -0.25), end=(0, 0, 0.25), radius=0.1),
    ]
    assert model.joints["j"].axis.tolist() == [0.0, 0.0, 1.0]
    assert model.joints["j"].kind is JointKind.REVOLUTE


def test_a_cylinder_with_two_caps_is_one_capsule(tmp_path):
    caps = "".join(
        f'<collision><origin xyz="0.3 0 {z}"/><geometry><sphere radius="0.1"/>'
        "</geometry></collision>"
        for z in (0.25, -0.25)
    )
    rod = (
        '<collision><origin xyz="0.3 0 0"/><geometry><cylinder radius="0.1" '
        'length="0.5"/></geometry></collision>'
    )
    model = load(tmp_path, robot(joint(), shape=caps + rod + SHAPE))
    kinds = [type(e.geometry) for e in model.links["a"].collisions]
    assert kinds == [Capsule, Sphere]
    assert model.links["a"].collisions[0].T_link_geometry[0, 3] == 0.3


@pytest.mark.parametrize("way", ["given", "ros", "ament", "xml", "folder", "tail"])
def test_a_package_is_found(way, tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    folder = {
        "given": "elsewhere",
        "ros": "ws/p",
        "ament": "opt/share/p",
        "xml": "odd",
        "folder": "p",
        "tail": "odd",
    }[way]
    mesh = tmp_path / folder / "meshes" / "m.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_text("solid")
    urdf = tmp_path / ("odd" if way in ("xml", "tail") else "robots") / "r.urdf"
    urdf.parent.mkdir(exist_ok=True)
    if way in ("xml", "folder"):
        inner = "odd" if way == "xml" else "p"
        (tmp_path / inner / "package.xml").write_text(
            "<package><name>p</name></package>"
        )
    if way == "ros":
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    if way == "ament":
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "opt"))
    geometry = '<mesh filename="package://p/meshes/m.stl" scale="1 2 1"/>'
    shape = f"<collision><geometry>{geometry}</geometry></collision>"
    urdf.write_text(robot(joint(), shape=shape))
    packages = {"p": tmp_path / "elsewhere"} if way == "given" else None
    found = load_urdf(urdf, packages=packages).links["a"].collisions[0].geometry
    assert found == MeshFile(mesh.resolve(), (1.0, 2.0, 1.0))


def srdf(tmp_path, rows):
    path = tmp_path / "r.srdf"
    path.write_text(f'<robot name="r">{rows}</robot>')
    return load(tmp_path, robot(joint()), srdf=path)


def test_srdf_pairs_and_states_are_read(tmp_path):
    model = srdf(
        tmp_path,
        '<disable_collisions link1="a" link2="b" reason="Never"/>'
        '<group_state name="home"><joint name="j" value="0.5"/></group_state>',
    )
    (pair,) = model.disabled_pairs
    assert (pair.link_a, pair.link_b, pair.reason) == ("a", "b", "r.srdf: Never")
    assert home_configuration(model) == {"j": 0.5}


def test_srdf_rows_about_strangers_are_noted(tmp_path):
    model = srdf(tmp_path, '<disable_collisions link1="a" link2="gripper_camera"/>')
    assert model.disabled_pairs == ()
    assert "'gripper_camera'" in model.notes[-1]


def test_a_misspelt_link_in_an_srdf_is_an_error(tmp_path):
    path = tmp_path / "r.srdf"
    path.write_text(
        '<robot name="r">\n<disable_collisions link1="forarm_link" link2="b"/></robot>'
    )
    text = robot(joint(parent="forearm_link"), links=("forearm_link", "b"))
    with pytest.raises(ModelError, match=r"line 2: .*did you mean 'forearm_link'"):
        load(tmp_path, text, srdf=path)


def test_home_is_chosen_then_srdf_then_nearest_to_zero(tmp_path):
    text = robot(joint(inner='<limit lower="0.2" upper="1"/>'))
    model = load(tmp_path, text)
    assert home_configuration(model) == {"j": 0.2}
    assert home_configuration(model, {"j": 0.7}) == {"j": 0.7}
    with pytest.raises(ModelError, match="does not move; did you mean 'j'"):
        home_configuration(model, {"jj": 0.0})
    with pytest.raises(ModelError, match=r"at 45, which looks like degrees"):
        home_configuration(model, {"j": 45.0})


def test_a_continuous_joint_has_no_limits(tmp_path):
    model = load(tmp_path, robot(joint(kind="continuous", inner="")))
    assert model.joints["j"].lower == -math.inf


def test_visible_links_without_collision_are_noted(tmp_path):
    text = robot(joint(), joint("k", "b", "c"), links=("a", "b"))
    text = text.replace("<joint", '<link name="c"><visual/></link><joint', 1)
    assert "link 'c' has visual but no collision" in load(tmp_path, text).notes[0]


@pytest.mark.parametrize("name", ROBOTS)
def test_named_robots_load(name):
    named = find_named_robot(name)
    model = load_urdf(named.urdf, srdf=named.srdf)
    home = home_configuration(model, named.home)
    assert set(home) == set(model.q_names)
    assert np.isfinite(list(home.values())).all()


def test_an_unknown_robot_gets_the_known_names_and_no_other_robot():
    with pytest.raises(ModelError, match="named robots: baxter, g1, kinova, panda"):
        find_named_robot("pnda")


def test_without_the_package_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr("armguard.robot.named.PACKAGE", "no-such-package")
    with pytest.raises(ModelError, match=r"pip install 'armguard\[robots\]'"):
        find_named_robot("panda")
