"""`armguard coordinate`: jobs of two robots, with and without a service."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.cli.coordinate import STALE, Encoder, LineHands
from armguard.maps.job import read_line_job
from armguard.maps.line_run import LineRun
from armguard.plans.verify import PlanVerifier
from armguard.respond.command import Blocked
from armguard.scene.yaml_source import SceneFileError
from armguard.service.wire.keys import keys_path
from armguard.simulation.stage import Stage

EXAMPLE = Path(__file__).parents[2] / "examples" / "line"

SCENE = """
mode: fixed
buffer: 0.02
robots:
  left: {urdf: arm.urdf, base: {xyz: [0, 0.35, 0]}, home: {turn: 0.7}}
  right: {urdf: arm.urdf, base: {xyz: [0, -0.35, 0]}, home: {turn: -0.7}}
"""
ARM = """<robot name="r"><link name="base"/>
 <link name="rod"><collision><origin xyz="0.5 0 0"/>
  <geometry><sphere radius="0.08"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""
ROWS = {
    "left": "t,left/turn\n0,0.7\n1,-0.2\n2,-0.6\n4,0.7\n",
    "right": "t,right/turn\n0,-0.7\n1,0.2\n2,0.6\n4,-0.7\n",
}
ERROR = 0.01
JOB = {
    "scene": "cell.yaml",
    "plans": {
        "fetch": {"robot": "left", "file": "left.csv", "following_error": ERROR},
        "carry": {"robot": "right", "file": "right.csv"},
    },
    "jobs": [
        {"t": 0, "plans": ["fetch"]},
        {"t": 0.2, "plans": ["carry"]},
        {"t": 0.5, "plans": ["fetch"]},
    ],
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    for robot, rows in ROWS.items():
        (tmp_path / f"{robot}.csv").write_text(rows)
    return tmp_path


def written(folder, **changed):
    """A job file: that above, some of it changed."""
    file = folder / "job.yaml"
    YAML().dump({**JOB, **changed}, file)
    return file


def test_jobs_are_done_and_their_motion_is_proven_clear(folder):
    motion = folder / "motion.csv"
    job = written(folder)
    answer = CliRunner().invoke(app, ["coordinate", str(job), "--motion", str(motion)])
    assert answer.exit_code == 0, answer.output
    *events, last = answer.stdout.splitlines()
    assert all(re.match(r" *\d+\.\d\d s  ", line) for line in events)
    assert any("yields to" in line for line in events)
    assert re.fullmatch(r"3 of 3 jobs done in \d+\.\d s", last)
    scene = ag.load_scene(folder / "cell.yaml")
    proof = PlanVerifier(scene).verify(ag.Plan.read(motion, scene))
    assert proof.clear
    # Plans of the same jobs at the same times, each as if it were alone, are not.
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)
    left, right = (
        np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1) for name in ROWS
    )
    times = rows[rows[:, 0] <= 4.0, 0]
    alone = np.column_stack(
        (
            np.interp(times, *left.T),
            np.interp(times - 0.2, *right.T),
        )
    )
    crash = ag.Trajectory(scene.q_names, alone, times, "alone")
    assert not PlanVerifier(scene).verify(ag.Plan.of(crash, scene)).clear


def test_the_motion_of_the_example_is_proven(tmp_path):
    motion = tmp_path / "motion.csv"
    words = ["coordinate", str(EXAMPLE / "job.yaml"), "--motion", str(motion)]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, answer.output
    assert "4 of 4 jobs done" in answer.stdout
    words = ["verify", str(motion), "--scene", str(EXAMPLE / "cell.yaml")]
    assert CliRunner().invoke(app, words).exit_code == 0


@pytest.mark.parametrize("options", [["--belt"], ["--motion", "m.csv", "--port", "1"]])
def test_options_that_do_not_go_together_are_refused(folder, options):
    answer = CliRunner().invoke(app, ["coordinate", str(written(folder)), *options])
    assert answer.exit_code == 2
    assert "--belt needs a --port" in answer.output


def test_the_answer_as_json(folder):
    answer = CliRunner().invoke(app, ["coordinate", str(written(folder)), "--json"])
    found = json.loads(answer.stdout)
    assert found["done"] == [1, 2, 3] and found["missed"] == []
    assert found["jobs"] == 3 and found["fault"] == "" and found["seconds"] > 8.0


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"jobs": [{"t": 0, "plans": ["fetsh"]}]}, "did you mean 'fetch'"),
        ({"jobs": []}, "jobs"),
        ({"jobs": [{"t": float("nan"), "plans": ["fetch"]}]}, "jobs"),
        (
            {"plans": {**JOB["plans"], "fetch": {"robot": "lefd", "file": "left.csv"}}},
            "did you mean 'left'",
        ),
        (
            {"conveyor": {"slowest": 0.1, "fastest": 0.2, "speed": 0.3}},
            "must be from 'slowest' to 'fastest'",
        ),
        ({"belt": 1}, "there is no such key"),
    ],
)
def test_a_wrong_job_is_named_with_its_line(folder, changed, words):
    with pytest.raises(SceneFileError) as refused:
        read_line_job(written(folder, **changed))
    assert words in str(refused.value)
    assert re.match(r"job\.yaml:\d+: ", str(refused.value))


@pytest.mark.parametrize(("share", "stops"), [(0.99, False), (1.01, True)])
def test_robots_stop_where_one_is_farther_from_its_plan_than_declared(
    folder, share, stops
):
    job = read_line_job(written(folder))
    run = LineRun(job)
    for k in range(50):
        run.step(0.01 * k)
    q, _ = run.line.motion()
    q[0] += share * ERROR
    desired = run.velocities(q)
    assert bool(run.line.fault) == stops
    if stops:
        assert run.line.fault.startswith("left/turn is 0.010 rad")
    else:
        assert desired[0] < run.line.motion()[1][0]


def test_a_position_that_is_no_number_stops_both(folder):
    run = LineRun(read_line_job(written(folder)))
    run.step(0.0)
    q, _ = run.line.motion()
    q[1] = np.nan
    run.velocities(q)
    assert "right/turn" in run.line.fault
    now = 0.0
    while run.step(now) and now < 5.0:
        now += 0.01
    assert run.line.rests and now < 5.0


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["1.0 0.2\n", "one 0.2\n"], "'one 0.2' is no travel and speed"),
        (["1.0\n"], "'1.0' is no travel and speed"),
        (["1.0 0.2\n"], "the belt was not measured for 0.1 s"),
    ],
)
def test_a_belt_that_is_not_measured_any_more_stops_both(folder, lines, words):
    belt = {"slowest": 0.1, "fastest": 0.3, "speed": 0.2}
    run = LineRun(read_line_job(written(folder, conveyor=belt)))
    goes, wait = Event(), Event()

    def measurements():
        yield lines[0] if len(lines) > 1 else "0.0 0.2\n"
        goes.set()
        wait.wait(10.0)
        yield lines[-1]

    hands = LineHands(run, Encoder(measurements()), quiet=True)
    assert goes.wait(10.0)
    q, _ = run.line.motion()
    hands.drive(0.0, q, {})
    assert hands.moves and not run.line.fault
    wait.set()
    time.sleep(2 * STALE)
    for k in range(1, 200):
        q, _ = run.line.motion()
        hands.drive(0.02 * k, q, {})
    assert words in run.line.fault
    assert run.line.rests and not hands.moves


def test_robots_that_the_guard_holds_stop_both(folder):
    # Robots here are a cycle behind.
    plans = {name: {**one, "skew": 0.05} for name, one in JOB["plans"].items()}
    run = LineRun(read_line_job(written(folder, plans=plans)))
    hands = LineHands(run, None, quiet=True)
    q, _ = run.line.motion()
    # Before the start robots wait for velocities of zero.
    desired, _ = hands.drive(0.0, q, {"left": Blocked.STOPPED})
    assert not desired.any() and hands.moves and not run.line.fault
    for k in range(1, 40):
        hands.drive(0.02 * k, run.line.motion()[0], {"left": Blocked.NOT})
    assert not run.line.rests
    hands.drive(0.8, run.line.motion()[0], {"left": Blocked.STOPPED})
    assert run.line.fault.startswith("left: stopped")


def test_a_robot_that_is_not_where_its_plans_begin_is_not_led_there(folder):
    run = LineRun(read_line_job(written(folder)))
    hands = LineHands(run, None, quiet=True)
    q, _ = run.line.motion()
    q[0] += 0.3
    for k in range(3):
        desired, _ = hands.drive(0.02 * k, q, {})
        assert not desired.any()
    assert run.line.fault.startswith("left/turn is 0.300 rad") and not hands.moves


@pytest.mark.realtime
def test_robots_of_a_service_execute_the_example(tmp_path):
    jobs = YAML(typ="safe").load(EXAMPLE / "job.yaml")
    jobs["scene"] = str(EXAMPLE / "cell.yaml")
    for one in jobs["plans"].values():
        one["file"] = str(EXAMPLE / one["file"])
    jobs["jobs"] = jobs["jobs"][:2]
    job = tmp_path / "job.yaml"
    YAML().dump(jobs, job)
    with Stage(jobs["scene"], "--no-self-test", "--late=0.05", "--stale=0.1") as stage:
        stage.start_service()
        stage.wait_for_service()
        stage.start_arms()
        command = [sys.executable, "-m", "armguard", "coordinate", str(job), "--json"]
        to = ["--port", str(stage.port), "--key-file", str(keys_path(stage.port))]
        found = subprocess.run(
            [*command, *to], check=False, capture_output=True, text=True, timeout=120
        )
    answer = json.loads(found.stdout)
    assert answer["fault"] == "" and answer["done"] == [1, 2], found.stderr
    assert found.returncode == 0
