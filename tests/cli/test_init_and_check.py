"""`armguard init` writes a scene that `check` passes; `check` says what to write."""

import json

import pytest
import trimesh
from ruamel.yaml import YAML
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.cli.cycles import slower
from armguard.cli.finding import in_yaml, merged, subject
from armguard.cli.fits import fit_findings
from armguard.cli.plausibility import FAST
from armguard.errors import SceneError
from armguard.geometry import Pose
from armguard.scene import Scene, compile_scene
from armguard.scene.pair_distances import Distances
from armguard.scene.posture import free_homes, touching_fingers

LINK = """<link name="{name}"><collision><origin xyz="{xyz}"/>
 <geometry>{shape}</geometry></collision></link>"""
TURN = """<joint name="{name}" type="revolute"><parent link="{parent}"/>
 <child link="{child}"/><origin xyz="0 0 {z}"/><axis xyz="{axis}"/>
 <limit lower="{lower}" upper="2" effort="1"{speed}/></joint>"""
SLIDE = """<joint name="{name}" type="prismatic"><parent link="hand"/>
 <child link="{name}"/><origin xyz="0 0 0.1"/><axis xyz="{axis}"/>
 <limit lower="0" upper="0.04" effort="1" velocity="0.2"/>{mimic}</joint>"""


def gripper_arm(speed="2", lower="-2", mimic=True):
    """A small arm without SRDF whose fingers touch at position 0."""
    limit = f' velocity="{speed}"' if speed else ""
    turns = [
        TURN.format(
            name="pan",
            parent="base",
            child="rod",
            z=0.1,
            axis="0 0 1",
            lower=lower,
            speed=limit,
        ),
        TURN.format(
            name="lift",
            parent="rod",
            child="hand",
            z=0.4,
            axis="0 1 0",
            lower=lower,
            speed=limit,
        ),
    ]
    ball, rod = '<sphere radius="0.05"/>', '<capsule radius="0.04" length="0.2"/>'
    finger = '<box size="0.02 0.02 0.06"/>'
    links = [
        LINK.format(name="base", xyz="0 0 0.05", shape=ball),
        LINK.format(name="rod", xyz="0 0 0.2", shape=rod),
        LINK.format(name="hand", xyz="0 0 0", shape=ball),
        LINK.format(name="thumb", xyz="0 0.01 0", shape=finger),
        LINK.format(name="index", xyz="0 -0.01 0", shape=finger),
    ]
    follows = '<mimic joint="thumb"/>' if mimic else ""
    slides = [
        SLIDE.format(name="thumb", axis="0 1 0", mimic=""),
        SLIDE.format(name="index", axis="0 -1 0", mimic=follows),
    ]
    return f'<robot name="small">{"".join([*links, *turns, *slides])}</robot>'


def run(*arguments):
    return CliRunner().invoke(app, list(map(str, arguments)))


def words_of(result):
    return " ".join(result.stdout.split())


STOPPING = "stopping: {deceleration: 2.5}"


def check(folder, text, *options, urdf=None):
    (folder / "r.urdf").write_text(urdf or gripper_arm())
    path = folder / "scene.yaml"
    path.write_text(text)
    return run("check", path, *options)


def test_init_of_a_named_robot_twice_is_ready(tmp_path):
    path = tmp_path / "scene.yaml"
    made = run("init", "panda", "panda", "-o", path, "--rate", "100")
    assert made.exit_code == 0, made.output
    text = path.read_text()
    first, values = text.splitlines()[0], YAML(typ="safe").load(text)
    assert first == "# yaml-language-server: $schema=./armguard.schema.json"
    assert values["cycle"] == {"period": 0.01, "late": 0.001}
    assert "here 100 Hz" in text
    assert values["robots"]["right"]["base"]["rpy"] == [0.0, 0.0, 3.1416]
    assert values["robots"]["left"]["gripper"]["link"] == "panda_hand"
    schema = json.loads((tmp_path / "armguard.schema.json").read_text())
    assert {"robots", "cycle"} <= schema["properties"].keys()
    result = run("check", path, "--verbose")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1].startswith("READY")
    # The check tests the filter too, as a guard does when it is made.
    assert "PASS self-test: filter: joint '" in result.stdout
    assert (
        "PASS loop: robots 'left', 'right', 16 joints; call the guard every 10 ms "
        in (words_of(result))
    )


def test_init_of_a_urdf_is_ready_and_never_overwrites(tmp_path):
    (tmp_path / "small.urdf").write_text(gripper_arm(speed=None))
    path = tmp_path / "scenes" / "scene.yaml"
    assert "create it first" in str(run("init", "x.urdf", "-o", path).exception)
    path.parent.mkdir()
    made = run("init", tmp_path / "small.urdf", "-o", path)
    assert made.exit_code == 0, made.output
    values = YAML(typ="safe").load(path.read_text())
    arm = values["robots"]["arm"]
    assert arm["urdf"] == "../small.urdf"
    assert arm["gripper"] == {"link": "hand", "fingers": ["thumb", "index"]}
    assert arm["stopping"]["velocity"]["pan"] == 3.2
    (pair,) = values["allow"]
    assert {pair["a"], pair["b"]} == {"arm/thumb", "arm/index"}
    assert "'thumb' closes them" in pair["reason"]
    assert values["cycle"]["period"] == 0.02
    result = run("check", path)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1].startswith("READY")
    before = path.read_text()
    again = run("init", "panda", "-o", path)
    assert "exists; replace it with --force" in str(again.exception)
    assert path.read_text() == before


ARM_IN_MJCF = """<mujoco><worldbody><body name="base">
 <geom type="cylinder" size="0.1 0.1" pos="0 0 0.1"/><body pos="0 0 0.3">
 <joint name="pan" axis="0 0 1" range="-90 90"/><geom size="0.05"/><body pos="0 0 0.1">
 <joint name="lift" axis="0 1 0" range="-90 90"/>
 <geom type="capsule" fromto="0 0 0.05 0 0 0.4" size="0.04"/></body></body></body>
 </worldbody><keyframe><key name="home" qpos="0.1 -0.2"/></keyframe></mujoco>"""


def test_init_of_mjcf_and_of_xacro_with_its_arguments_is_ready(tmp_path):
    pytest.importorskip("mujoco")
    pytest.importorskip("xacro")
    (tmp_path / "arm.xml").write_text(ARM_IN_MJCF)
    part = gripper_arm().replace('name="small"', 'name="$(arg name)"')
    scheme = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.xacro").write_text(
        part.replace("<robot", f"<robot {scheme}")
    )
    (tmp_path / "r.xacro").write_text(
        f'<robot {scheme} name="r"><xacro:include filename="$(find parts)/arm.xacro"/>'
        "</robot>"
    )
    path = tmp_path / "scenes" / "scene.yaml"
    path.parent.mkdir()
    given = ["--package", f"parts={tmp_path / 'parts'}", "--xacro-arg", "name=2"]
    wrong = run("init", tmp_path / "r.xacro", "-o", path, "--xacro-arg", "name")
    assert "write --xacro-arg NAME=VALUE" in str(wrong.exception)
    made = run("init", tmp_path / "arm.xml", tmp_path / "r.xacro", "-o", path, *given)
    assert made.exit_code == 0, made.output
    values = YAML(typ="safe").load(path.read_text())
    assert values["packages"] == {"parts": "../parts"}
    left, right = values["robots"]["left"], values["robots"]["right"]
    assert left["urdf"] == "../arm.xml"
    assert "xacro_args" not in left
    assert right["xacro_args"] == {"name": "2"}
    result = run("check", path)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[-1].startswith("READY")


@pytest.mark.parametrize(
    ("thumb", "sentence"),
    [
        ("0.02", "WARN fingers: closed fingers touch at home"),
        ("0.3", "WARN links: by construction these are too near"),
    ],
)
def test_contacts_within_a_gripper_are_warnings_with_lines_that_allow_them(
    thumb, sentence, tmp_path
):
    scene = f"robots: {{a: {{urdf: r.urdf, {STOPPING}}}}}\n"
    urdf = gripper_arm().replace("0.02 0.02 0.06", f"0.02 {thumb} 0.06", 1)
    result = check(tmp_path, scene, urdf=urdf)
    words = words_of(result)
    assert f"{sentence}: a/index and a/thumb" in words
    assert "FAIL" not in words
    assert result.exit_code == 1
    last = result.stdout.splitlines()[-1]
    assert last.startswith("NOT READY: ")
    assert last.endswith("pairs of links to settle")
    lines = result.stdout.splitlines()
    start = lines.index("          allow:")
    pasted = "\n".join(
        line.strip() if "allow" in line else line[8:]
        for line in lines[start : start + 2]
    )
    fixed = check(tmp_path, scene + pasted + "\n", urdf=urdf)
    assert fixed.exit_code == 0, fixed.output


def test_arms_that_step_stops_at_rest_get_the_figures_that_let_them_rest(tmp_path):
    path = tmp_path / "scene.yaml"
    bases = {"left": [0.0, 0.25, 0.0], "right": [0.0, -0.25, 0.0]}
    robots = {
        name: {"urdf": "so101", "base": {"xyz": xyz}} for name, xyz in bases.items()
    }
    path.write_text(in_yaml({"cycle": {"period": 0.02}, "robots": robots}))

    def rest_findings():
        found = json.loads(run("check", path, "--json").stdout)["findings"]
        assert sum(one["topic"] == "cycle time" for one in found) == 1
        return [one for one in found if one["topic"] == "rest"]

    found = rest_findings()
    assert [one["keys"] for one in found] == [["robots", "left"], ["robots", "right"]]
    assert "Guard.step orders a stop" in found[0]["sentence"]
    assert "call Guard.filter" in found[0]["remedy"]
    yaml = YAML()
    scene = yaml.load(path.read_text())
    for one in found:
        scene["robots"][one["keys"][1]].update(yaml.load(one["paste"]))
    with path.open("w") as file:
        yaml.dump(scene, file)
    assert not rest_findings()


def test_a_search_for_figures_leaves_the_scene_as_it_is():
    scene = Scene()
    for name, y in (("left", 0.25), ("right", -0.25)):
        scene.add_robot("so101", name, base=Pose(xyz=(0.0, y, 0.0)))
    before = {name: robot.stopping for name, robot in scene.robots.items()}
    found = slower(scene)
    for name, robot in scene.robots.items():
        assert robot.stopping is before[name]
        assert found[name]["velocity"] < before[name].velocity.max()


def test_an_overlap_without_a_free_posture_names_the_pair(tmp_path):
    blocked = "objects: {post: {box: [0.2, 0.2, 0.2], at: {xyz: [0, 0, 0.3]}}}\n"
    robot = f"{{urdf: r.urdf, {STOPPING}, home: {{thumb: 0.02}}}}"
    result = check(tmp_path, f"robots: {{a: {robot}}}\n{blocked}")
    assert result.exit_code == 1
    words = words_of(result)
    assert "no free posture was found: move the base or the object" in words
    assert "`allow: [{a: a/rod, b: post, reason: WHY}]` (line 1 of scene.yaml)" in words


def test_an_overlap_at_home_is_answered_by_a_free_home(tmp_path):
    blocked = "objects: {post: {box: [0.1, 0.1, 0.1], at: {xyz: [0, 0, 0.66]}}}\n"
    robot = f"urdf: r.urdf, {STOPPING}"
    result = check(tmp_path, f"robots: {{a: {{{robot}}}}}\n{blocked}")
    assert result.exit_code == 1
    words = words_of(result)
    assert "FAIL home: robot 'a': at home these overlap: " in words
    assert (
        "without an SRDF home is that of a recognised arm, or the pose nearest" in words
    )
    assert "under robots.a (line 1 of scene.yaml)" in words
    line = next(
        row for row in result.stdout.splitlines() if row.startswith(" " * 10 + "home")
    )
    fixed = check(tmp_path, f"robots: {{a: {{{robot}, {line.strip()}}}}}\n{blocked}")
    assert fixed.exit_code == 0, fixed.output


def test_bases_at_one_place_are_one_failure(tmp_path):
    robot = f"{{urdf: r.urdf, {STOPPING}, home: {{thumb: 0.02}}}}"
    result = check(tmp_path, f"robots:\n  l: {robot}\n  r: {robot}\n")
    words = words_of(result)
    assert "FAIL home: robot 'r': bases of 'l' and 'r' coincide" in words
    assert (
        "-> give one a base; write under robots.r (line 3 of scene.yaml): base:"
        in words
    )
    assert result.stdout.splitlines()[-1].startswith("NOT READY: 1 failure")


IMPLAUSIBLE = {
    "millimetres": (
        "base: {xyz: [800, 0, 0]}",
        "",
        {},
        "800 m from 'l'",
        "base: {xyz: [0.8",
    ),
    "far": ("base: {xyz: [9, 0, 0]}", "", {}, "so they never meet", "base: "),
    "large": (
        "base: {xyz: [1, 0, 0]}",
        "objects: {t: {box: [1200, 2000, 50], at: {xyz: [500, 0, -100]}}}",
        {},
        "object 't': its longest side is 2000 m: millimetres?",
        "box: [1.2, 2.0, 0.05]",
    ),
    "unreachable": (
        "base: {xyz: [1, 0, 0]}",
        "objects: {t: {box: [1, 1, 1], at: {xyz: [0, 9, 0]}}}",
        {},
        "object 't': no robot reaches it",
        "line 4 of scene.yaml",
    ),
    "fast": (
        "base: {xyz: [1, 0, 0]}",
        "",
        {"speed": "10"},
        "joint 'pan' is 10 rad/s in r.urdf line ",
        "stopping: {velocity: {pan: 4.0",
    ),
    "long stop": (
        "base: {xyz: [1, 0, 0]}",
        "",
        {"speed": "10"},
        "goes on for",
        "check velocity and deceleration",
    ),
}


@pytest.mark.parametrize("case", IMPLAUSIBLE)
def test_what_is_seldom_true_is_a_warning_with_its_line(case, tmp_path):
    base, rest, arm, says, remedy = IMPLAUSIBLE[case]
    robot = f"urdf: r.urdf, {STOPPING}, home: {{thumb: 0.02}}"
    text = f"robots:\n  l: {{{robot}}}\n  r: {{{robot}, {base}}}\n{rest}\n"
    words = words_of(check(tmp_path, text, urdf=gripper_arm(**arm)))
    found = words.partition("WARN plausibility")[2]
    assert says in found
    assert remedy in found


def test_both_bases_in_millimetres_get_a_line_and_keep_their_orientation(tmp_path):
    robot = f"urdf: r.urdf, {STOPPING}, home: {{thumb: 0.02}}"
    words = words_of(
        check(
            tmp_path,
            "robots:\n"
            f"  l: {{{robot}, base: {{xyz: [0, 400, 0]}}}}\n"
            f"  r: {{{robot}, base: {{xyz: [0, -400, 0], rpy: [0, 0, 1.5]}}}}\n",
        )
    )
    assert "base: {xyz: [0.0, 0.4, 0.0]}" in words
    assert "base: {xyz: [0.0, -0.4, 0.0], rpy: [0.0, 0.0, 1.5]}" in words


def test_a_plausible_scene_prints_neither_tables_nor_passes(tmp_path):
    robot = f"urdf: r.urdf, {STOPPING}, home: {{thumb: 0.02}}"
    text = f"robots:\n  l: {{{robot}}}\n  r: {{{robot}, base: {{xyz: [0.9, 0, 0]}}}}\n"
    result = check(tmp_path, text)
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) < 15
    assert [line for line in result.stdout.splitlines() if line.startswith("PASS")] == [
        result.stdout.splitlines()[0]
    ]
    full = check(tmp_path, text, "-v").stdout
    assert "figures of robot 'l', and where each is from" in full
    assert "PASS plausibility: lengths, speeds and stops are plausible" in full
    answer = json.loads(check(tmp_path, text, "--json").stdout)
    stopping = [row for row in answer["findings"] if row["topic"] == "stopping"]
    assert [row["keys"] for row in stopping] == [["robots", "l"], ["robots", "r"]]
    assert FAST == 4.0


def test_a_missing_scene_is_answered_by_how_to_write_one(tmp_path):
    result = run("check", tmp_path / "scene.yaml")
    assert result.exit_code == 2
    assert "No such file" in result.stdout
    assert "armguard init ROBOT ROBOT" in result.stdout


def test_closer_fits_are_measured_and_leave_the_scene_as_it_is(tmp_path):
    """An L of two bars, which one primitive holds badly and two hold well."""
    bars = [
        trimesh.creation.box((0.16, 0.04, 0.04)),
        trimesh.creation.box(
            (0.04, 0.04, 0.16),
            trimesh.transformations.translation_matrix((0.06, 0, 0.06)),
        ),
    ]
    trimesh.util.concatenate(bars).export(tmp_path / "l.stl")
    rod = '<capsule radius="0.04" length="0.2"/>'
    urdf = gripper_arm().replace(rod, '<mesh filename="l.stl"/>')
    (tmp_path / "r.urdf").write_text(urdf)
    scene = Scene(mode="fixed", buffer=0.005)
    own = {"fit_target": 0.005, "max_primitives": 1}
    scene.add_robot(tmp_path / "r.urdf", "a", home={"thumb": 0.02}, **own)
    fits = dict(scene.robots["a"].fits)
    (plain,) = fit_findings(scene, "s.yaml", False)
    assert plain.sentence.startswith("rod overreaches by ")
    assert "`armguard check s.yaml --closer` measures the effect" in plain.remedy
    assert plain.paste == "max_primitives: 2"
    (closer,) = fit_findings(scene, "s.yaml", True)
    assert closer.paste == plain.paste
    for name, fit in scene.robots["a"].fits.items():
        assert fit.shapes == fits[name].shapes
    assert scene.robots["a"].max_primitives == 1
    scene.set_fit("a", max_primitives=2)
    found = scene.robots["a"].fits["rod"].overreach
    assert found < 0.5 * fits["rod"].overreach
    assert f": 2 primitives instead of 1 bring {found * 1e3:.1f} mm" in closer.remedy
    assert "; a cycle at home takes " in closer.remedy
    with pytest.raises(SceneError, match="max_primitives"):
        scene.set_fit("a", max_primitives=0)
    assert scene.robots["a"].max_primitives == 2


def small_scene(tmp_path, **arm):
    (tmp_path / "r.urdf").write_text(gripper_arm(**arm))
    scene = Scene(mode="fixed", buffer=0.005)
    scene.add_robot(tmp_path / "r.urdf", name="a")
    return scene


@pytest.mark.parametrize("mimic", [True, False])
def test_fingers_are_recognised_with_and_without_mimic(mimic, tmp_path):
    scene = small_scene(tmp_path, mimic=mimic)
    tables = compile_scene(scene)
    (pair,) = touching_fingers(scene, tables, tables.home)
    assert set(pair) == {"a/thumb", "a/index"}
    opened = tables.home.copy()
    opened[2:] = 0.03
    assert touching_fingers(scene, tables, opened) == {}


def test_a_free_home_is_the_middle_of_the_limits_where_that_is_free(tmp_path):
    scene = small_scene(tmp_path)
    tables = compile_scene(scene)
    first = next(free_homes(scene, tables, {"a"}))["a"]
    assert first == next(free_homes(scene, tables, {"a"}))["a"]
    distances = Distances(tables)
    at = distances.at([first[name.partition("/")[2]] for name in tables.q_names])
    assert (at >= distances.buffers).all()
    assert 0.0 < first["thumb"] < 0.04
    assert abs(first["pan"]) < 2.0


def test_equal_findings_are_one_and_names_are_quoted_as_yaml():
    from armguard.cli.finding import Finding

    two = [Finding("fit", "WARN", "x", keys=("robots", name)) for name in "lr"]
    ((_, keys),) = merged(two)
    assert subject(keys) == "robots 'l', 'r': "
    odd = {"a: b": [1.0, "yes", "#x"]}
    assert YAML(typ="safe").load(in_yaml(odd)) == odd
