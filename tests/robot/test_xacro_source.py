"""Xacro files are expanded in a child process; every refusal has its remedy."""

import pytest

from armguard.errors import ModelError
from armguard.robot import child, load_urdf
from armguard.robot.xacro_source import expand_xacro
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
