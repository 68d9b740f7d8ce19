"""The commands, as a user runs them: output, files, exit codes."""

import json
import re

import pytest
from typer.testing import CliRunner

from approach import ball_guard
from armguard.cli import main
from armguard.cli.app import app
from armguard.cli.console import STYLES, event_line, exit_code, jsonable
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


def test_octree_prints_numbers_and_draws(tmp_path):
    png = tmp_path / "tree.png"
    result = run("octree", BAY, "--png", str(png), "--json")
    answer = json.loads(result.stdout)
    assert answer["audit"] == "passed"
    assert answer["primitives"] == 35
    assert png.read_bytes()[:4] == b"\x89PNG"


def test_an_error_is_one_message_and_exit_code_two(monkeypatch, capsys, tmp_path):
    arguments = ["armguard", "run", str(tmp_path / "no.yaml"), "--trajectory", TASK]
    monkeypatch.setattr("sys.argv", arguments)
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "no.yaml: cannot be read" in " ".join(capsys.readouterr().err.split())


def test_the_version_is_the_packages():
    assert run("--version").stdout.strip() == "0.1.0"


def test_check_tells_how_far_links_go_on_and_who_says_so(tmp_path):
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
    assert set(STYLES) == set(Level)
    for level in Level:
        found = exit_code({**dict.fromkeys(Level, 0), level: 1}, 0)
        assert found == (1 if level >= Level.STOP else 0)


def test_a_summary_tells_every_level_that_was_there(capsys):
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
    told = " ".join(capsys.readouterr().out.split())
    for word in ("slow", "stop", "brake", "hardware stop"):
        assert re.search(rf"\d+ {word}\b", told), word
    assert answer["exit_code"] == 1
    json.dumps(jsonable(answer), allow_nan=False)
    assert {e["level"] for e in answer["events"]} >= {"HARDWARE_STOP"}
    assert all(len(event_line(e)) > 20 for e in log.events)


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


def test_check_proves_claims_or_tells_that_it_did_not(tmp_path):
    (tmp_path / "r.urdf").write_text(PLANAR)
    (tmp_path / "r.srdf").write_text(ROWS)
    path = tmp_path / "s.yaml"
    path.write_text("mode: fixed\nrobots: {arm: {urdf: r.urdf, srdf: r.srdf}}\n")
    words = " ".join(run("check", str(path)).stdout.split())
    remedy = "2 claims are unproven, taken as claims; prove them with "
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
