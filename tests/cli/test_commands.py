"""The commands, as a user runs them: output, files, exit codes."""

import json
import re
import subprocess
import sys
from io import StringIO

import pytest
import typer
from typer.testing import CliRunner

from approach import ball_guard
from armguard.cli import main
from armguard.cli.app import LISTED, app
from armguard.cli.console import (
    STYLES,
    Lines,
    event_line,
    exit_code,
    jsonable,
    loading_bar,
)
from armguard.cli.run import print_summary, summary
from armguard.guard import EventLog, Level
from armguard.scene.bay import FOLDER, bay_path

BAY = str(bay_path())
TASK = str(FOLDER / "task_150.csv")


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


def test_run_writes_a_report_and_says_too_close(tmp_path):
    report = tmp_path / "report.json"
    result = run("run", BAY, "--trajectory", TASK, "--report", str(report))
    assert result.exit_code == 1
    events = json.loads(report.read_text())["events"]
    assert any(e["level"] == "STOP" for e in events)


def test_run_is_clear_where_nothing_comes_near(tmp_path):
    lines = (FOLDER / "task_150.csv").read_text().splitlines()[:40]
    path = tmp_path / "start.csv"
    path.write_text("\n".join(lines) + "\n")
    assert run("run", BAY, "--trajectory", str(path)).exit_code == 0


def test_run_with_a_nan_is_bad_input(tmp_path):
    lines = (FOLDER / "task_150.csv").read_text().splitlines()[:4]
    cells = lines[2].split(",")
    cells[3] = "nan"
    path = tmp_path / "nan.csv"
    path.write_text("\n".join([*lines[:2], ",".join(cells), lines[3]]) + "\n")
    result = run("run", BAY, "--trajectory", str(path), "--json")
    assert result.exit_code == 2
    (event,) = json.loads(result.stdout)["events"]
    assert event["why"].startswith("joint 'left/joint3' is at nan: stop")


def test_check_lists_findings():
    result = run("check", BAY, "-v")
    assert result.exit_code == 0, result.output
    for topic in ("versions", "joints", "meshes", "fit", "home", "index", "cycle time"):
        assert f"{topic}: " in result.stdout
    answer = json.loads(run("check", BAY, "--json", "--propose", "50").stdout)
    assert {f["status"] for f in answer["findings"]} <= {"PASS", "WARN"}
    assert len(answer["fits"]) == 14


def test_check_of_a_broken_scene_fails(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("robots: {a: {urdf: pnda}}\n")
    result = run("check", str(path))
    assert result.exit_code == 2
    assert "FAIL" in result.stdout
    words = " ".join(result.stdout.split())
    assert "one of the named robots: baxter, g1, kinova, panda, " in words
    assert "did you mean" not in words
    assert "-> fix line 1 of s.yaml" in words
    assert result.stdout.endswith("\nNOT READY: 1 failure\n")


def test_an_error_is_one_message_and_exit_code_two(monkeypatch, capsys, tmp_path):
    arguments = ["armguard", "run", str(tmp_path / "no.yaml"), "--trajectory", TASK]
    monkeypatch.setattr("sys.argv", arguments)
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "no.yaml: cannot be read" in " ".join(capsys.readouterr().err.split())


def test_the_version_is_the_packages():
    assert run("--version").stdout.strip() == "0.1.0"


def test_check_prints_how_far_links_go_on_and_the_source_of_that(tmp_path):
    fixed = run("check", BAY, "-v")
    assert "robots 'left', 'right': mode fixed: 30.48 mm at every speed" in " ".join(
        fixed.stdout.split()
    )
    path = tmp_path / "bay.yaml"
    text = bay_path().read_text().replace("\nmode: fixed\n", "\nmode: path\n")
    text = text.replace("bay_arm.urdf", str(FOLDER / "bay_arm.urdf"))
    path.write_text(text.replace("\nbuffer: 0.03048\n", "\n"))
    result = run("check", str(path), "-v")
    words = " ".join(result.stdout.split())
    assert result.exit_code == 0, result.output
    assert (
        "WARN stopping: robots 'left', 'right': mode path: 15 figures are assumptions"
        in words
    )
    assert "figures of robot 'left', and where each is from" in words
    assert "figures of robot 'right': as of 'left'" in words
    assert "paper, section 4: 10 to 20 ms" in words
    assert "PASS self-test: levels: joint 'left/" in words
    assert "PASS self-test: faults: a NaN, a late cycle" in words
    answer = json.loads(run("check", str(path), "--json").stdout)
    assert sum(f["topic"] == "stopping" for f in answer["findings"]) == 2
    stops = [s for s in answer["stopping"] if s["link"] == "left/link7"]
    assert [s["speed_percent"] for s in stops] == [10, 33, 66, 100]
    for stop in stops:
        parts = stop["reaction_mm"] + stop["braking_mm"] + stop["settle_mm"]
        assert abs(parts - stop["distance_mm"]) < 0.2
        assert stop["time_ms"] > 200
    sources = {f["figure"]: f["source"] for f in answer["figures"]}
    assert sources["velocity"] == "the URDF's speed limits"
    assert sources["brake_delay"].startswith("paper")
    assert len(answer["figures"]) == 36


def test_every_level_has_a_style_and_a_place_in_the_exit_code():
    assert set(STYLES) == set(Level.__members__)
    for level in Level:
        found = exit_code({**dict.fromkeys(Level, 0), level: 1}, 0)
        assert found == (1 if level >= Level.STOP else 0)


def test_a_summary_lists_every_level_that_was_there(capsys):
    guard, log = ball_guard(), EventLog()
    verdicts = []
    guard.step([-1.0], 0.0, velocity=[0.0])
    q = -1.0
    for k in range(1, 2600):
        q += 0.8 * 1e-3
        verdicts.append(guard.step([q], k * 1e-3, velocity=[0.8]))
        log.add(verdicts[-1])
    answer = summary(
        log, [v.cycle_time for v in verdicts], [v.counts for v in verdicts]
    )
    print_summary(answer, log)
    printed = " ".join(capsys.readouterr().out.split())
    for word in ("slow", "stop", "brake", "hardware stop"):
        assert re.search(rf"\d+ {word}\b", printed), word
    assert answer["exit_code"] == 1
    json.dumps(jsonable(answer), allow_nan=False)
    assert {e["level"] for e in answer["events"]} >= {"HARDWARE_STOP"}
    assert all(len(event_line(e, 0.0)) > 20 for e in log.events)


ROWS = """<robot name="r">
 <disable_collisions link1="base" link2="tip" reason="Never"/>
 <disable_collisions link1="rod" link2="base" reason="Adjacent"/>
</robot>"""

PLANAR = """<robot name="r">
 <link name="base"><collision><origin xyz="0 1.5 0"/>
  <geometry><sphere radius="0.3"/></geometry></collision></link>
 <link name="rod"><collision><origin xyz="0.5 0 0"/>
  <geometry><sphere radius="0.1"/></geometry></collision></link>
 <link name="tip"><collision><origin xyz="0.8 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <joint name="shoulder" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
 <joint name="elbow" type="revolute"><parent link="rod"/><child link="tip"/>
  <origin xyz="1 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>"""


PLANAR_SCENE = """mode: path
cycle: {period: 0.004}
robots:
  arm: {urdf: r.urdf, base: {xyz: [0, 0, 0]}, stopping: {deceleration: 1.0}}
allow: [{a: arm/base, b: arm/tip, reason: apart}]
objects:
  wall: {box: [0.1, 0.1, 1.0], at: {xyz: [1.8, 0.3, 0]}}
"""


def test_check_proves_claims_or_says_that_it_did_not(tmp_path):
    (tmp_path / "r.urdf").write_text(PLANAR)
    (tmp_path / "r.srdf").write_text(ROWS)
    path = tmp_path / "s.yaml"
    path.write_text("mode: fixed\nrobots: {arm: {urdf: r.urdf, srdf: r.srdf}}\n")
    words = " ".join(run("check", str(path)).stdout.split())
    remedy = "2 claims are unproven and accepted as they are; prove them with "
    assert remedy + "`armguard check s.yaml --prove`" in words
    result = run("check", str(path), "--prove", "--prove-seconds", "300")
    words = " ".join(result.stdout.split())
    assert result.exit_code == 2
    assert (
        "FAIL claims: claims: 2, proved 1, contradicted 1, sometimes 0, open 0" in words
    )
    assert "arm/base and tip ('r.srdf: Never') touch, " in words
    assert "mm deep at shoulder " in words
    result = run("check", str(path), "--prove", "--json")
    claims = json.loads(result.stdout)["claims"]
    assert [claims["proved"], claims["contradicted"]] == [1, 1]
    assert set(claims["rows"][0]["contradiction"]) == {"shoulder", "elbow"}
    assert claims["rows"][0]["least_mm"] < -100.0
    assert claims["rows"][1]["contradiction"] is None


def timed(tmp_path, times, elbow, name="t", scene=PLANAR_SCENE):
    """A scene with a planar arm, and a motion of its elbow."""
    (tmp_path / "r.urdf").write_text(PLANAR)
    path = tmp_path / "s.yaml"
    path.write_text(scene)
    rows = (f"{t},0,{q}" for t, q in zip(times, elbow, strict=True))
    motion = tmp_path / "m.csv"
    motion.write_text("\n".join([f"{name},arm/shoulder,arm/elbow", *rows]) + "\n")
    return run("run", str(path), "--trajectory", str(motion), "--json")


def test_run_judges_with_recorded_speeds_what_is_clear_at_rest(tmp_path):
    """0.16 m from a wall: enough at rest, too little to stop at 0.7 m/s."""
    fast = timed(tmp_path, [0.0, 0.5], [-0.4, 0.05])
    slow = timed(tmp_path, [0.0, 50.0], [-0.4, 0.05])
    assert (fast.exit_code, slow.exit_code) == (1, 0), fast.stdout
    answer = json.loads(fast.stdout)
    assert answer["judged"] == "with recorded speeds"
    assert answer["duration"] == 0.5
    assert answer["rate"] == pytest.approx(2.0)
    assert answer["top_speeds"]["arm"] == pytest.approx({"rad/s": 0.9})
    assert answer["cycles"] > 100
    assert "TOO_CLOSE" in {e["reason"] for e in answer["events"]}, answer["events"]
    assert answer["faults"] == 0


def test_run_without_times_says_that_it_judges_at_rest(tmp_path):
    timed(tmp_path, [0.0, 0.5], [-0.4, 0.05])
    (tmp_path / "m.csv").write_text("arm/shoulder,arm/elbow\n0,-0.4\n0,0.05\n")
    words = ("run", str(tmp_path / "s.yaml"), "--trajectory", str(tmp_path / "m.csv"))
    result = run(*words)
    assert result.exit_code == 0, result.output
    assert "judged at rest: no times" in result.stdout
    assert "needs 0.0 mm" not in result.stdout
    assert json.loads(run(*words, "--json").stdout)["judged"] == "at rest: no times"


@pytest.mark.parametrize("times", [[0.0, 500.0, 1000.0], [0.0, 0.0005, 0.001]])
def test_run_refuses_times_in_another_unit_with_the_column_to_write(tmp_path, times):
    count = 3
    result = timed(tmp_path, times, [-0.4, -0.2, 0.0][:count])
    assert result.exit_code != 0
    said = str(result.exception)
    if times[-1] > 1.0:
        assert "looks like milliseconds" in said and "t_ms" in said
    else:
        assert "speed limit" in said and "unit" in said


def test_run_prints_duration_rate_and_top_speeds(tmp_path):
    timed(tmp_path, [0.0, 0.5], [-0.4, 0.05])
    words = ("run", str(tmp_path / "s.yaml"), "--trajectory", str(tmp_path / "m.csv"))
    result = run(*words)
    assert "0.5 s, 2 Hz; top speeds: arm 0.90 rad/s" in result.stdout


def test_lines_are_not_broken_outside_a_terminal(capsys):
    from armguard.cli.console import out, plain_table

    table = plain_table("a", "b")
    table.add_row("x " * 200, "y " * 200)
    out.print(table)
    out.print("word " * 100)
    assert len(capsys.readouterr().out.splitlines()) == 3


@pytest.mark.parametrize("terminal", [True, False])
def test_loading_is_a_bar_on_a_terminal_and_lines_elsewhere(terminal, monkeypatch):
    file = StringIO()
    screen = Lines(file=file, force_terminal=terminal, width=100)
    monkeypatch.setattr("armguard.cli.console.err", screen)
    with loading_bar() as progress:
        progress("fitting base", 1, 2)
        progress("fitting [rod]", 2, 2)
    shown = file.getvalue()
    assert "fitting [rod]" in shown
    assert ("left" in shown) is terminal
    if not terminal:
        assert shown.splitlines() == ["fitting base, 1 of 2", "fitting [rod], 2 of 2"]


def test_the_help_offers_completion_and_no_tree():
    said = run("--help").stdout
    assert "--install-completion" in said
    assert "octree" not in said


def test_the_list_of_commands_begins_the_help_of_each():
    commands = typer.main.get_command(app).commands
    for name, row in LISTED.items():
        assert commands[name].help.startswith(row.summary.removesuffix(".")), name


@pytest.mark.parametrize("command", ["", "keys", "reset", "view", "report", "fleet"])
def test_help_imports_neither_compiler_nor_scenes(command):
    code = (
        "import sys\n"
        "from armguard.cli.app import app\n"
        "try:\n    app(sys.argv[1:])\n"
        "finally:\n    print({'numba', 'numpy', 'scipy'} & set(sys.modules))\n"
    )
    words = [sys.executable, "-c", code, *command.split(), "--help"]
    ran = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("Usage:")
    assert ran.stdout.endswith("set()\n")


@pytest.mark.parametrize(
    ("times", "step", "says"),
    [
        (("0", "1", "1"), 0.01, "2 and 3 differ and both have the time 1 s; correct"),
        (("3", "3", "3"), 0.01, "all 3 configurations have the time 3 s; correct the"),
        (
            ("0", "20", "40"),
            0.01,
            "looks like milliseconds; name the times 't_ms'",
        ),
        (("0", "1e-6", "2e-6"), 0.01, "the times are too short for seconds; correct"),
    ],
    ids=["repeated", "constant", "milliseconds", "too short"],
)
def test_run_refuses_times_that_do_not_fit_the_motion(tmp_path, times, step, says):
    lines = (FOLDER / "task_150.csv").read_text().splitlines()
    names, home = lines[0].split(","), lines[1].split(",")
    rows = [["t", *names[-14:]]]
    for k, time in enumerate(times):
        rows.append([time, str(float(home[-14]) + k * step), *home[-13:]])
    path = tmp_path / "motion.csv"
    path.write_text("\n".join(map(",".join, rows)) + "\n")
    result = run("run", BAY, "--trajectory", str(path))
    assert result.exit_code != 0
    assert says in " ".join(str(result.exception or result.output).split())
