"""`armguard verify`: what it says of plans, and of files that hold none."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.errors import TrajectoryError, UnknownNameError
from arms import wall_scene

NAMES = ("joint1", "joint2", "joint3")
SCENE = """
mode: fixed
buffer: 0.02
robots:
  arm: {urdf: arm.urdf}
objects:
  ball: {sphere: {radius: 0.1}, at: {xyz: [0.5, 0.5, 0]}}
"""
ARM = """<robot name="r"><link name="base"/>
 <link name="rod"><collision><origin xyz="0.3 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <link name="tip"><collision><origin xyz="0.4 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
 <joint name="bend" type="revolute"><parent link="rod"/><child link="tip"/>
  <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    return tmp_path


def run(folder, name, text, *options):
    if isinstance(text, str):
        (folder / name).write_text(text)
    else:
        np.save(folder / name, text)
    given = [str(folder / name), "--scene", str(folder / "cell.yaml"), *options]
    return CliRunner().invoke(app, ["verify", *given])


def csv(rows, header="t,turn,bend"):
    lines = [",".join(f"{x:.17g}" for x in row) for row in rows]
    return "\n".join([header, *lines]) + "\n"


# The tip passes the ball, whose middle is 0.7071 m away, at 45 degrees.
PASSING = [(0.0, -0.5, 0.0), (2.0, 1.5, 0.0)]


def times_of_contact(distance):
    """When the tip, 0.7 m away, is that near the ball in PASSING, by trigonometry."""
    apart, far = distance + 0.15, np.hypot(0.5, 0.5)
    cosine = (0.7**2 + far**2 - apart**2) / (2.0 * 0.7 * far)
    return np.pi / 4.0 + 0.5 + np.arccos(cosine) * np.array([-1.0, 1.0])


def test_it_says_when_which_pair_is_how_near(folder):
    found = run(folder, "plan.csv", csv(PASSING), "--json")
    assert found.exit_code == 1, found.output
    answer = json.loads(found.stdout)["plans"][0]
    tip = next(o for o in answer["intervals"] if "arm/tip" in o["nearest"].values())
    start, end = times_of_contact(0.02)
    assert tip["start"] == pytest.approx(start, abs=5e-5)
    assert tip["end"] == pytest.approx(end, abs=5e-5)
    first, _ = times_of_contact(0.0)
    assert tip["contact"] == pytest.approx(first, abs=5e-5)
    deepest = np.hypot(0.5, 0.5) - 0.7 - 0.15
    assert tip["nearest"]["distance"] == pytest.approx(deepest, abs=5e-4)
    assert tip["nearest"]["bound"] <= deepest <= tip["nearest"]["distance"]
    words = run(folder, "plan.csv", csv(PASSING))
    assert words.exit_code == 1
    assert f"contact from {tip['contact']:.4f} s" in words.stdout
    assert "proven for straight lines" in words.stdout


def test_a_clear_plan_is_proven_and_says_how_near_it_comes(folder):
    rows = [(0.0, -0.5, 0.0), (1.0, 0.0, 0.0)]
    found = run(folder, "plan.csv", csv(rows))
    assert found.exit_code == 0
    assert "OK, every pair keeps its buffer" in found.stdout
    least = np.hypot(0.5 - 0.7, 0.5) - 0.15
    assert f"least distance {1e3 * least:.1f}" in found.stdout


def test_a_path_without_time_has_rows_instead(folder):
    rows = np.array(PASSING)[:, 1:]
    found = run(folder, "rows.npy", rows, "--json")
    answer = json.loads(found.stdout)["plans"][0]
    assert not answer["timed"]
    tip = next(o for o in answer["intervals"] if "arm/tip" in o["nearest"].values())
    start, _ = times_of_contact(0.02)
    assert tip["start"] == pytest.approx(start / 2.0, abs=1e-3)
    assert answer["order"] is None


def test_following_error_and_skew_are_in_what_is_proven(folder):
    rows = [(0.0, -0.5, 0.0), (2.0, times_of_contact(0.02)[0] - 0.5 - 0.02, 0.0)]
    assert run(folder, "plan.csv", csv(rows)).exit_code == 0
    inside, beyond = "arm/turn=0.018", "arm/turn=0.022"
    assert run(folder, "p.csv", csv(rows), "--following-error", inside).exit_code == 0
    found = run(folder, "p.csv", csv(rows), "--following-error", beyond)
    assert found.exit_code == 1
    assert "only with the declared errors" in found.stdout
    rows.append((4.0, -0.5, 0.0))
    speed = (rows[1][1] - rows[0][1]) / 2.0
    for share, code in ((0.9, 0), (1.1, 1)):
        skew = f"arm={share * 0.02 / speed}"
        assert run(folder, "p.csv", csv(rows), "--skew", skew).exit_code == code


def test_velocities_of_a_robot_trajectory_bend_its_lines(folder):
    """Both rows keep clear, as does the line: the cubic between them does not."""
    end = times_of_contact(0.02)[0] - 0.5 - 0.05
    point = "{positions: [%s, 0], velocities: [%s, 0], time_from_start: {sec: %s}}"
    both = [point % (end - 0.2, 1.0, 0), point % (end, -1.0, 1)]
    joints = "joint_names: [turn, bend], points: "
    text = f"joint_trajectory: {{{joints}[{', '.join(both)}]}}"
    assert run(folder, "p.yaml", text, "--interpolation", "linear").exit_code == 0
    found = run(folder, "p.yaml", text)
    assert found.exit_code == 1
    assert "cubic curves" in found.stdout
    assert json.loads(run(folder, "p.yaml", text, "--json").stdout)


def test_a_plan_that_starts_too_near_is_verified_from_where_it_leaves(folder):
    rows = [(0.0, 0.785, 0.0), (2.0, 2.785, 0.0), (4.0, 0.785, 0.0)]
    found = run(folder, "plan.csv", csv(rows), "--json")
    answer = json.loads(found.stdout)["plans"][0]
    tip = [o for o in answer["intervals"] if "arm/tip" in o["nearest"].values()]
    assert [one["start"] == 0.0 for one in tip] == [True, False]
    assert "from the start: contact" in run(folder, "plan.csv", csv(rows)).stdout


def test_the_latest_order_of_a_stop_is_reaction_and_stop_before(folder):
    figures = (
        "{deceleration: 4.0, acceleration: 1.0e-9, velocity: 2.0, "
        "delays: {sensing: 0.01, command: 0.03}}"
    )
    robot = f"{{urdf: arm.urdf, stopping: {figures}}}"
    scene = "cycle: {period: 0.002}\n" + SCENE.replace("{urdf: arm.urdf}", robot)
    (folder / "cell.yaml").write_text(scene)
    found = run(folder, "plan.csv", csv(PASSING), "--json")
    answer = json.loads(found.stdout)["plans"][0]
    order = answer["order"]
    assert order["reaction"] == pytest.approx(0.01 + 0.03 + 0.002, abs=2e-3)
    assert order["stop"] == pytest.approx(1.0 / 4.0, abs=1e-6)
    first = answer["intervals"][0]["start"]
    rest = order["time"] + order["reaction"] + order["stop"]
    assert first - 1e-3 <= rest <= first
    assert order["lead"] == pytest.approx(first - order["time"])


BAD = {
    "nan": (csv([(0, 0, 0), (1, np.nan, 0)]), "configuration 2: joint 'arm/turn'"),
    "still": (csv([(0, 0, 0), (0, 1, 0)]), "it must rise"),
    "back": (csv([(1, 0, 0), (0, 1, 0)]), "must not go back"),
    "wide": ("t,turn,bend\n0,0,0\n1,0\n", "2 columns; the header has 3"),
    "unknown": (csv([(0, 0, 0), (1, 1, 0)], "t,turn,bent"), "joint 'bent' is not in"),
    "missing": (csv([(0, 0), (1, 1)], "t,turn"), "no positions for 'arm/bend'"),
    "degrees": (csv([(0, 0, 0), (1, 90, 0)]), "degrees"),
    "one": (csv([(0, 0, 0)]), "a plan needs two"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_file_that_holds_no_plan_is_refused_with_place_and_remedy(folder, kind):
    text, said = BAD[kind]
    found = run(folder, "plan.csv", text)
    assert isinstance(found.exception, TrajectoryError), found.output
    assert said in str(found.exception)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--interpolation", "spline"), "interpolation 'spline' is unknown"),
        (("--following-error", "arm=x"), "'x' is no number"),
        (("--following-error", "arms=0.1"), "no robot or joint"),
        (("--skew", "-0.1"), "must be finite and >= 0"),
    ],
)
def test_an_option_that_makes_no_sense_is_refused(folder, options, said):
    found = run(folder, "plan.csv", csv(PASSING), *options)
    assert isinstance(found.exception, TrajectoryError), found.output
    assert said in str(found.exception)


def test_a_path_without_time_has_no_clock_and_no_cubic(folder):
    rows = np.array(PASSING)[:, 1:]
    for options, said in (
        (("--skew", "0.1"), "no clock can be off"),
        (("--interpolation", "cubic"), "no curve of it"),
    ):
        found = run(folder, "rows.npy", rows, *options)
        assert said in str(found.exception)


def test_an_object_that_is_moved_is_where_it_is_now():
    scene = wall_scene()
    verifier = ag.PlanVerifier(scene)
    rows = np.array([[0.0, 0.3, 0.0], [0.4, 0.3, 0.0]])
    plan = ag.Plan.of(ag.Trajectory(NAMES, rows, np.array([0.0, 1.0]), "x"), scene)
    assert not verifier.verify(plan).clear
    verifier.checker.place("wall", ag.Pose(xyz=(0, 1.6, 0.5)))
    assert verifier.verify(plan).clear
    verifier.checker.place("wall", ag.Pose(xyz=(0, 0.6, 0.5)))
    verifier.checker.remove("wall")
    assert verifier.verify(plan).clear


TWO = SCENE + "  block: {box: {size: [0.2, 0.2, 0.2]}, at: {xyz: [0.7, -0.3, 0]}}\n"


def test_after_a_move_the_pairs_of_what_moved_are_proven_as_all_are(folder):
    (folder / "cell.yaml").write_text(TWO)
    plan = csv([(0.0, -1.5, 0.0), (3.0, 1.5, 0.0)])
    every = json.loads(run(folder, "plan.csv", plan, "--json").stdout)["plans"][0]
    again = run(folder, "plan.csv", plan, "--json", "--moved", "block")
    assert again.exit_code == 1
    found = json.loads(again.stdout)["plans"][0]
    own = [one for one in every["intervals"] if one["nearest"]["b"] == "block"]
    assert 0 < len(own) < len(every["intervals"])
    assert [(o["start"], o["end"], o["contact"]) for o in found["intervals"]] == [
        (o["start"], o["end"], o["contact"]) for o in own
    ]
    assert found["moved"] == ["block"]


def test_an_answer_for_what_moved_claims_nothing_of_other_pairs(folder):
    (folder / "cell.yaml").write_text(TWO.replace("[0.7, -0.3, 0]", "[0, 0, -2]"))
    found = run(folder, "plan.csv", csv(PASSING), "--moved", "block")
    assert found.exit_code == 0
    assert "OK, every pair of block keeps its buffer all the way" in found.stdout
    assert "other pairs than those of block were not proven again" in found.stdout


def test_what_moved_is_an_object_and_gets_no_certificate(folder):
    (folder / "cell.yaml").write_text(TWO)
    found = run(folder, "plan.csv", csv(PASSING), "--moved", "blok")
    assert isinstance(found.exception, UnknownNameError)
    assert "did you mean 'block'?" in str(found.exception)
    proof = str(folder / "proof.npz")
    found = run(
        folder, "plan.csv", csv(PASSING), "--moved", "ball", "--certificate", proof
    )
    assert "a certificate is of all pairs" in str(found.exception)
