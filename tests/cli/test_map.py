"""`armguard map`: what it writes and says of cell jobs, and of files that are none."""

import csv
import json

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.view import __main__ as showing

SCENE = """
mode: fixed
buffer: 0.02
robots:
  left: {urdf: arm.urdf, base: {xyz: [0, 0.35, 0]}}
  right: {urdf: arm.urdf, base: {xyz: [0, -0.35, 0]}}
"""
ARM = """<robot name="r"><link name="base"/>
 <link name="rod"><collision><origin xyz="0.5 0 0"/>
  <geometry><sphere radius="0.08"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""
JOB = """
scene: cell.yaml
plans:
  left: {file: left.csv, following_error: 0.01, names: {0: fetch, 1: give, 2: leave}}
  right: {file: right.csv, skew: 0.02, names: {0: fetch, 1: give, 2: leave}}
"""
ROWS = {
    "left": "t,left/turn\n0,0.6\n1,-0.2\n2,-0.8\n4,0.6\n",
    "right": "t,right/turn\n0,-0.6\n1,0.2\n2,0.8\n4,-0.6\n",
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    (tmp_path / "job.yaml").write_text(JOB)
    for robot, rows in ROWS.items():
        (tmp_path / f"{robot}.csv").write_text(rows)
    return tmp_path


def run(folder, *options, job="job.yaml"):
    given = [str(folder / job)] if job else []
    found = folder / "found"
    return CliRunner().invoke(app, ["map", *given, "--out", str(found), *options])


def test_a_job_becomes_a_picture_a_schedule_interlocks_and_a_map(folder):
    answer = run(folder)
    assert answer.exit_code == 0, answer.output
    first, *rules, last = answer.stdout.strip().splitlines()
    assert first.endswith("8.0 s one after the other, 4.0 s if neither were there")
    assert "% free" in first
    assert len(rules) >= 1
    assert last.startswith("  by these interlocks ")
    found = folder / "found"
    assert (found / "diagram.png").read_bytes()[:4] == b"\x89PNG"
    with (found / "schedule.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["t", "left", "right"]
    times = np.array(rows[1:], dtype=float)
    assert (np.diff(times, axis=0) >= 0.0).all()
    assert times[-1, 1:].tolist() == [4.0, 4.0]
    together = float(first.partition("; ")[2].split(" s together")[0])
    assert together == pytest.approx(times[-1, 0], abs=0.0501)
    written = YAML(typ="safe").load(found / "interlocks.yaml")["interlocks"]
    assert [row["words"] for row in written] == [line.strip() for line in rules]
    with (found / "interlocks.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(row["waits_at"]) for row in table] == [
        row["waits_at"] for row in written
    ]
    with np.load(found / "map.npz") as held:
        free = float((held["left_right_labels"] == 0).mean())
    assert f"{100.0 * free:.0f}"[0] == first[0]


def test_json_has_the_same_numbers(folder):
    answer = json.loads(run(folder, "--json").stdout)
    assert answer["robots"] == ["left", "right"]
    assert answer["free"] + answer["forbidden"] + answer["unknown"] == pytest.approx(1)
    assert answer["together_s"] < answer["one_after_another_s"] == 8.0
    assert answer["by_interlocks_s"] <= 1.05 * answer["together_s"] + 0.05
    assert answer["problem"] is None
    assert answer["interlocks"][0]["robot"] in answer["robots"]


def test_a_diagram_without_a_way_is_exit_code_1(folder):
    (folder / "left.csv").write_text("t,left/turn\n0,-0.65\n1,0.6\n")
    (folder / "right.csv").write_text("t,right/turn\n0,0.65\n1,-0.6\n")
    (folder / "job.yaml").write_text(JOB.replace("1: give, 2: leave", ""))
    answer = run(folder)
    assert answer.exit_code == 1
    assert "no way: left and right begin too near, left/rod and right/rod" in (
        answer.stdout
    )


@pytest.mark.parametrize("way", [True, False])
def test_a_map_is_shown_in_the_browser_also_without_a_way(folder, monkeypatch, way):
    shown = []
    monkeypatch.setattr(showing, "show", shown.append)
    if not way:
        (folder / "left.csv").write_text("t,left/turn\n0,-0.65\n1,0.6\n")
        (folder / "right.csv").write_text("t,right/turn\n0,0.65\n1,-0.6\n")
        (folder / "job.yaml").write_text(JOB.replace("1: give, 2: leave", ""))
    answer = run(folder, "--view", "--page-port", "0")
    [view] = shown
    try:
        assert answer.exit_code == (0 if way else 1), answer.output
        [diagram] = json.loads(view.page.newest["charts"])["charts"]
        assert bool(diagram["way"]) == way
        assert diagram["axes"] == ["left", "right"]
        names = [name for name, _ in diagram["segments"][0]]
        assert names == (["fetch", "give", "leave"] if way else ["fetch"])
        assert view.places() == {"left": 0.0, "right": 0.0}
    finally:
        view.close()


def test_a_plan_that_comes_too_near_by_itself_is_exit_code_1(folder):
    scene = SCENE + "objects: {ball: {sphere: {radius: 0.1}, at: {xyz: [0, 0.85, 0]}}}"
    (folder / "cell.yaml").write_text(scene)
    (folder / "left.csv").write_text("t,left/turn\n0,0.6\n1,1.5\n2,0.6\n4,0.6\n")
    answer = run(folder)
    assert answer.exit_code == 1
    assert "left alone: ball and left/rod may be too near from 0." in answer.stdout


def test_joints_become_a_slice(folder):
    arm = ARM.replace(
        "</robot>",
        """<link name="tip"><collision><geometry><sphere radius="0.05"/></geometry>
        </collision></link><joint name="bend" type="revolute"><parent link="rod"/>
        <child link="tip"/><origin xyz="0.8 0 0"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="2"/></joint></robot>""",
    )
    (folder / "arm.urdf").write_text(arm)
    scene = str(folder / "cell.yaml")
    answer = run(folder, "--joints", "left/turn,left/bend", "--scene", scene, job=None)
    assert answer.exit_code == 0, answer.output
    assert "left/turn and left/bend, the others at home: " in answer.stdout
    assert (folder / "found" / "slice.png").exists()


@pytest.mark.parametrize(
    ("job", "words"),
    [
        ("- a", "must be a mapping with the keys 'scene' and 'plans'"),
        (JOB.replace("scene:", "scenes:"), "scenes: there is no such key"),
        (JOB.replace("skew: 0.02", "skew: -1"), "plans.right.skew: is -1; it must be"),
        (JOB.replace("right: {", "write: {"), "plans.write: is no robot of the scene"),
        (JOB.replace("right.csv", "none.csv"), "none.csv' cannot be read"),
        (JOB.replace("2: leave", "9: leave"), "row 9 begins no segment"),
        (JOB.replace("file: right", "file: left"), "the plan of 'right' moves 'left/"),
        (JOB.partition("  right:")[0], "plans: needs at least 2"),
    ],
)
def test_a_file_that_is_no_job_is_refused_in_words(folder, job, words):
    (folder / "job.yaml").write_text(job)
    answer = run(folder)
    assert answer.exit_code != 0
    assert words in f"{answer.output}{answer.exception}"


def test_without_a_job_or_joints_it_says_what_to_give(folder):
    answer = run(folder, job=None)
    assert "give a cell job, or --joints and --scene" in str(answer.exception)
    answer = run(folder, "--joints", "left/turn", job=None)
    assert "give two joints" in str(answer.exception)
