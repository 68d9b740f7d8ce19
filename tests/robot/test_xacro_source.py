"""Xacro files are expanded in a child process; every refusal has its remedy."""

from itertools import pairwise

import pytest

from armguard.errors import ArmguardError, ModelError
from armguard.robot import child, load_urdf
from armguard.robot.known_arms import known_arms, known_data
from armguard.robot.xacro_source import expand_xacro
from armguard.robot.xml_source import MOST_XML_BYTES
from armguard.scene import load_scene

ARM = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="name" default="a"/>
  <xacro:property name="half" value="${0.5 * $(arg size)}"/>
  <xacro:include filename="$(find parts)/part.xacro"/>
  <xacro:part name="$(arg name)" radius="${half}"/>
</robot>
"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="part" params="name radius">
    <link name="${name}">
      <collision><geometry><sphere radius="${radius}"/></geometry></collision>
    </link>
  </xacro:macro>
</robot>
"""


def arm(folder, text=ARM):
    (folder / "elsewhere").mkdir()
    (folder / "elsewhere" / "part.xacro").write_text(PART)
    path = folder / "arm.urdf.xacro"
    path.write_text(text)
    return path, {"parts": folder / "elsewhere"}


def body(inner):
    return (
        f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{inner}</robot>'
    )


def write(folder, text):
    path = folder / "r.xacro"
    path.write_text(text)
    return path


def test_macro_include_find_property_and_arguments(tmp_path):
    pytest.importorskip("xacro")
    path, packages = arm(tmp_path)
    for size in (1.0, 3.0):
        model = load_urdf(path, packages=packages, xacro_args={"size": size})
        assert model.links["a"].collisions[0].geometry.radius == size / 2.0
        assert f'radius="{size / 2.0}"'.encode() in model.expanded


def test_a_package_is_found_by_its_package_xml(tmp_path):
    pytest.importorskip("xacro")
    path, packages = arm(tmp_path)
    manifest = "<package><name>parts</name></package>"
    (packages["parts"] / "package.xml").write_text(manifest)
    packages["parts"].rename(tmp_path / "parts")
    assert b'"2.0"' in expand_xacro(path, {}, {"size": 4})


def test_missing_argument_and_package_name_the_line(tmp_path):
    pytest.importorskip("xacro")
    path, packages = arm(tmp_path)
    with pytest.raises(ModelError, match=r"add `xacro_args: \{size: VALUE\}`"):
        expand_xacro(path, packages)
    with pytest.raises(ModelError, match=r"`packages: \{parts: FOLDER\}`"):
        expand_xacro(path, {}, {"size": 1})


def test_the_error_precedes_the_places_of_nested_macros(tmp_path):
    """Their names are long; the argument is named all the same."""
    pytest.importorskip("xacro")
    long = [f"m{k}{'x' * 60}" for k in range(12)]
    inner = "".join(
        f'<xacro:macro name="{name}"><xacro:{called}/></xacro:macro>'
        for name, called in pairwise(long)
    )
    for expression, says in (
        ("$(arg size)", r"add `xacro_args: \{size: VALUE\}`"),
        ("${absent}", "name 'absent' is not defined"),
    ):
        last = f'<xacro:macro name="{long[-1]}"><link name="{expression}"/>'
        text = body(f"{inner}{last}</xacro:macro><xacro:{long[0]}/>")
        with pytest.raises(ModelError, match=says):
            expand_xacro(write(tmp_path, text))


def test_lines_of_the_expansion_are_named_as_such(tmp_path):
    pytest.importorskip("xacro")
    joint = '<link name="a"/><joint name="j" type="planar"/>'
    with pytest.raises(ModelError, match=r"'r.xacro \(expanded to URDF\)' line \d+: j"):
        load_urdf(write(tmp_path, body(joint)))


def test_robots_of_one_file_with_other_arguments_get_lines_of_their_own(tmp_path):
    """The first guess follows the speed limit, which is an argument here."""
    pytest.importorskip("xacro")
    joint = """<xacro:arg name="top" default="1"/><link name="base"/>
    <joint name="j" type="revolute"><parent link="base"/><child link="a"/>
    <limit lower="-1" upper="1" velocity="$(arg top)"/></joint><link name="a">
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>"""
    write(tmp_path, body(joint))
    robot = "{urdf: r.xacro, xacro_args: {top: %g}, base: {xyz: [0, %d, 0]}}"
    tops = enumerate((0.5, 0.25, 0.25))
    rows = "\n".join(f"  r{k}: {robot % (top, k)}" for k, top in tops)
    (tmp_path / "scene.yaml").write_text(f"robots:\n{rows}\n")
    with pytest.raises(ArmguardError) as caught:
        load_scene(tmp_path / "scene.yaml")
    said = str(caught.value)
    assert "robot 'r0' is in" in said
    assert "robots 'r1', 'r2' are in" in said
    assert "{deceleration: 0.5}" in said
    assert "{deceleration: 0.25}" in said


def test_a_known_arm_is_recognised_in_what_xacro_expands(tmp_path):
    pytest.importorskip("xacro")
    row = known_data()["arms"]["ur5e"]
    macro = """<xacro:macro name="turn" params="name parent child x"><link
    name="${child}"><collision><geometry><sphere radius="0.02"/></geometry></collision>
    </link><joint name="$(arg prefix)${name}" type="revolute"><parent link="${parent}"/>
    <child link="${child}"/><origin xyz="${x} 0 0"/><limit lower="-6.3" upper="6.3"
    velocity="3"/></joint></xacro:macro><link name="l0"/>"""
    chain = "".join(
        f'<xacro:turn name="{name}" parent="l{k}" child="l{k + 1}" x="{x}"/>'
        for k, (name, x) in enumerate(
            zip(row["joints"], [0.1, *row["lengths"]], strict=True)
        )
    )
    path = write(tmp_path, body(macro + chain))
    (arm,) = known_arms(load_urdf(path, xacro_args={"prefix": "left_"}))
    assert arm.name == "ur5e"
    assert arm.joints[0] == f"left_{row['joints'][0]}"


def test_syntax_errors_and_endless_expressions_are_refused(tmp_path):
    pytest.importorskip("xacro")
    path, _ = arm(tmp_path, body("<link"))
    with pytest.raises(ModelError, match=r"'arm.urdf.xacro' cannot be expanded: .*\d"):
        expand_xacro(path)
    path.write_text(body('<link name="${[0 for _ in range(10**12) if False]}"/>'))
    with pytest.raises(ModelError, match="is not expanded after 3 s"):
        expand_xacro(path, seconds=3.0)


def test_without_the_extra_the_install_line_is_named(tmp_path, monkeypatch):
    path, _ = arm(tmp_path)
    monkeypatch.setattr(child, "find_spec", lambda _: None)
    with pytest.raises(ModelError, match=r'pip install "armguard\[xacro\]"'):
        load_urdf(path)


def test_arguments_of_a_urdf_are_refused(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text("<robot/>")
    with pytest.raises(ModelError, match="is no xacro file; remove `xacro_args`"):
        load_urdf(path, xacro_args={"size": 1})


def test_an_expression_gets_no_more_memory_than_the_limit(tmp_path):
    pytest.importorskip("xacro")
    path, _ = arm(tmp_path, body("""<link name="${len('a' * 10**10)}"/>"""))
    with pytest.raises(ModelError, match=r"when evaluating expression .len"):
        expand_xacro(path)


def test_a_scene_file_gives_the_arguments(tmp_path):
    pytest.importorskip("xacro")
    joint = """<link name="base"/><joint name="j" type="continuous">
    <parent link="base"/><child link="$(arg name)"/></joint></robot>"""
    arm(tmp_path, ARM.replace("</robot>", joint))
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "packages: {parts: elsewhere}\nrobots:\n  r:\n    urdf: arm.urdf.xacro\n"
        "    mode: fixed\n    xacro_args: {size: 0.2, name: b}\n"
    )
    assert load_scene(scene).robots["r"].model.links.keys() == {"base", "b"}


def test_a_large_expansion_is_refused_by_its_size(tmp_path):
    pytest.importorskip("xacro")
    path = write(tmp_path, body("""<link name="${'a' * 5 * 10**6}"/>"""))
    with pytest.raises(ModelError, match="has more than 4 MB after its expansion"):
        load_urdf(path)
    assert len(expand_xacro(path)) == MOST_XML_BYTES + 1
