"""Links that are too near each other by construction: telescopes and short wrists."""

import re

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from armguard import Guard, Scene, load_scene
from armguard.cli.app import app
from armguard.errors import HomeContactError
from armguard.scene import compile_scene
from armguard.scene.inseparable import inseparable_links

LINK = """<link name="{name}"><collision><origin xyz="{xyz}"/>
 <geometry>{shape}</geometry></collision></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/>
 <child link="{child}"/><origin xyz="{at}"/><axis xyz="{axis}"/>
 <limit lower="{lower}" upper="{upper}" effort="1" velocity="0.1"/></joint>"""
BEAM = '<box size="0.3 {width} {width}"/>'
BALL = '<sphere radius="0.05"/>'


def link(name, shape=BALL, xyz="0 0 0"):
    return LINK.format(name=name, shape=shape, xyz=xyz)


def joint(name, parent, child, kind, axis, lower, upper, at="0 0 0"):
    """A joint from `lower` to `upper` [rad or m]."""
    return JOINT.format(
        name=name,
        parent=parent,
        child=child,
        kind=kind,
        axis=axis,
        lower=lower,
        upper=upper,
        at=at,
    )


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def telescope(axis="1 0 0"):
    """Three beams, each 1 cm inside the one before; the last one turns about `axis`."""
    return robot(
        *(link(f"beam{k}", BEAM.format(width=0.10 - 0.02 * k)) for k in range(3)),
        joint("out1", "beam0", "beam1", "prismatic", "1 0 0", 0, 0.25, at="0.02 0 0"),
        joint("out2", "beam1", "beam2", "prismatic", axis, 0, 0.25, at="0.02 0 0"),
    )


def wrist(offset, reach=0.103):
    """A ball that turns at a distance about a point `offset` from another's middle."""
    return robot(
        link("fore", xyz=f"0 0 {-offset}"),
        '<link name="cross"/>',
        link("hand", xyz=f"0 0 {reach}"),
        joint("roll", "fore", "cross", "revolute", "1 0 0", -3, 3),
        joint("pitch", "cross", "hand", "revolute", "0 1 0", -3, 3),
    )


def carriages():
    """Two carriages on one rail, one of them in two stages, which overlap at home."""
    return robot(
        link("rail", xyz="0 0 -0.2"),
        *(link(name) for name in "ab"),
        '<link name="stage"/>',
        joint("slide_a", "rail", "a", "prismatic", "1 0 0", 0, 1),
        joint("slide_s", "rail", "stage", "prismatic", "1 0 0", 0, 1, at="0.09 0 0"),
        joint("slide_b", "stage", "b", "prismatic", "1 0 0", 0, 1),
    )


def found(tmp_path, urdf):
    (tmp_path / "r.urdf").write_text(urdf)
    scene = Scene(mode="fixed", buffer=0.005)
    scene.add_robot(tmp_path / "r.urdf", name="a")
    return {
        frozenset((x.a, x.b)): (x.buffer, x.reason)
        for x in inseparable_links(scene, compile_scene(scene))
    }


def test_sections_of_a_telescope_are_found_by_their_joints(tmp_path):
    assert found(tmp_path, telescope()) == {
        frozenset(("a/beam0", "a/beam2")): (
            None,
            "sections of a telescope; 'out1' and 'out2' move them",
        )
    }
    # Sideways they come apart, and they can meet again.
    assert found(tmp_path, telescope(axis="0 1 0")) == {}


def test_carriages_on_one_rail_have_to_be_checked(tmp_path):
    assert found(tmp_path, carriages()) == {}


@pytest.mark.parametrize(
    ("urdf", "buffer", "reason"),
    [
        (wrist(0.0, 0.09), None, "their shapes overlap wherever their joints are"),
        (wrist(0.0), None, "3.0 mm apart wherever their joints are"),
        (wrist(0.0015), 0.0022, "at most 4.5 mm apart wherever their joints are"),
        (wrist(0.004), "none", ""),
    ],
)
def test_a_short_wrist_gets_half_of_what_it_can_keep(urdf, buffer, reason, tmp_path):
    rows = found(tmp_path, urdf)
    if buffer == "none":
        assert rows == {}
    else:
        ((pair, row),) = rows.items()
        assert pair == {"a/fore", "a/hand"}
        assert row == (buffer, reason)


def pasted(printed):
    """Lines that `check` prints to be written into the scene."""
    rows = re.search(r"WARN links.*\n.*\n((?: {10}.*\n)+)", printed)
    assert rows is not None
    return rows[1].replace(" " * 10, "")


@pytest.mark.parametrize(
    ("urdf", "key"),
    [(telescope(), "allow"), (wrist(0.0), "allow"), (wrist(0.0015), "buffers")],
)
def test_the_lines_of_check_make_the_scene_ready(urdf, key, tmp_path):
    def run(*words):
        return CliRunner().invoke(app, list(map(str, words)))

    file = tmp_path / "scene.yaml"
    (tmp_path / "r.urdf").write_text(urdf)
    text = (
        "cycle: {period: 0.02}\n"
        "robots: {a: {urdf: r.urdf, stopping: {deceleration: 5.0, velocity: 0.1}}}\n"
    )
    file.write_text(text)
    before = run("check", file)
    assert before.exit_code == 1
    assert "WARN links: by construction these are " in before.stdout
    rows = pasted(before.stdout)
    assert list(YAML(typ="safe").load(rows)) == [key]
    file.write_text(text + rows)
    after = run("check", file)
    assert after.exit_code == 0, after.output
    assert after.stdout.splitlines()[-1].startswith("READY")
    # A guard agrees with `check`, before and afterwards.
    Guard(load_scene(file))
    made = tmp_path / "made.yaml"
    assert run("init", tmp_path / "r.urdf", "-o", made).exit_code == 0
    assert key in YAML(typ="safe").load(made.read_text())
    again = run("check", made)
    assert again.stdout.splitlines()[-1].startswith("READY"), again.output


def test_a_telescope_touches_before_it_is_allowed(tmp_path):
    (tmp_path / "r.urdf").write_text(telescope())
    scene = Scene(mode="fixed", buffer=0.005)
    scene.add_robot(tmp_path / "r.urdf", name="a")
    with pytest.raises(HomeContactError):
        Guard(scene)
    for pair in inseparable_links(scene, compile_scene(scene)):
        pair.settle(scene)
    Guard(scene)
