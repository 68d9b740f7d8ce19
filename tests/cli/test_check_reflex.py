"""`armguard check --reflex`: the file of the reflex, and the zones that it masks."""

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.processes import free_port
from armguard.reflex import read_settings

# A ball that a joint leads through the right half of the view of a sensor on the base.
URDF = """<robot name="ball">
  <link name="base"/>
  <link name="rod"><collision>
    <origin xyz="0.3 0 0"/><geometry><sphere radius="0.05"/></geometry>
  </collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
    <limit lower="-0.6" upper="-0.1" velocity="1" effort="1"/>
  </joint>
</robot>"""

SCENE = """
mode: fixed
robots: {arm: {urdf: ball.urdf}}
sensors:
  eye:
    {on: arm/base, zones: [8, 2], error: 0.0, at: {rpy: [-1.5708, 0, -1.5708]}}
reflex: {sensors: [eye], distance: 0.3, port: PORT, listeners: [LISTENER], vote: 2}
"""


@pytest.fixture
def cell(tmp_path):
    (tmp_path / "ball.urdf").write_text(URDF)
    path = tmp_path / "cell.yaml"
    text = SCENE.replace("PORT", str(free_port()))
    path.write_text(text.replace("LISTENER", str(free_port())))
    return path


def check(path, *words):
    """What `armguard check` prints as JSON."""
    result = CliRunner().invoke(app, ["check", str(path), "--json", *words])
    return json.loads(result.stdout)


def of_topic(found, topic):
    return [row for row in found["findings"] if row["topic"] == topic]


def test_it_writes_thresholds_and_masks_what_the_arm_trips(cell):
    (missing,) = of_topic(check(cell), "reflex")
    assert missing["status"] == "WARN"
    assert "`armguard check SCENE --reflex` writes this file" in missing["sentence"]
    found = check(cell, "--reflex")
    (line,) = of_topic(found, "reflex")
    file = cell.parent / "reflex.json"
    assert file.stat().st_mode & 0o777 == 0o600
    sensor = read_settings(file)["sensors"][0]
    assert (sensor.name, sensor.vote, sensor.timeout) == ("eye", 2, 0.134)
    # The ball is on the right: columns from 4 on, in both rows; some on the left stay.
    masked = {k for k, t in enumerate(sensor.thresholds) if t is None}
    assert {k % 8 for k in masked} >= {5, 6, 7} and not masked & {0, 1, 8, 9}
    assert {t for t in sensor.thresholds if t is not None} == {0.3}
    assert line["status"] == "PASS"
    assert (
        f"trips {16 - len(masked)} of them, {len(masked)} are masked"
        in (line["sentence"])
    )
    (warning,) = of_topic(found, "zones")
    assert (
        "(rod is in zone" in warning["sentence"] and "turn -0." in warning["sentence"]
    )
    (table,) = found["zones"]
    assert {row["zone"] for row in table["masked"]} == masked
    assert not of_topic(check(cell), "reflex")


def test_it_keeps_the_keys_and_the_reflex_runs_with_it(cell):
    file = cell.parent / "reflex.json"
    check(cell, "--reflex")
    before = json.loads(file.read_text())
    check(cell, "--reflex")
    assert json.loads(file.read_text()) == before
    words = [sys.executable, "-m", "armguard.reflex", str(file)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr.readline() == "stop 1: STARTED \n"
        process.terminate()


def test_a_sensor_that_sees_nothing_but_the_arm_is_a_failure(cell):
    cell.write_text(cell.read_text().replace("[8, 2]", "[1, 1]"))
    found = check(cell, "--reflex")
    (line,) = of_topic(found, "reflex")
    assert (line["status"], found["exit_code"]) == ("FAIL", 2)
    assert "every zone of 'eye' is masked" in line["sentence"]
    assert not (cell.parent / "reflex.json").exists()


def test_a_scene_without_a_reflex_is_a_failure(cell):
    lines = cell.read_text().splitlines()
    cell.write_text("\n".join(line for line in lines if "reflex:" not in line))
    (line,) = of_topic(check(cell, "--reflex"), "reflex")
    assert line["status"] == "FAIL" and "declares no reflex" in line["sentence"]
    assert not of_topic(check(cell), "reflex")
