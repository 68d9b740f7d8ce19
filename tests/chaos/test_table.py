"""Every row of the table of faults, played against real processes."""

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from armguard.chaos.fault import Effect
from armguard.chaos.sensor_faults import GROUP, SENSOR_FAULTS
from armguard.chaos.table import FAULTS
from armguard.cli.app import app
from armguard.scene.bay import FOLDER, bay_path
from armguard.scene.two_pandas import sensed_table_path


@pytest.fixture
def patient_bay(tmp_path):
    """The bay, with states believed for longer than a busy machine is late."""
    text = bay_path().read_text().replace("\nmode: fixed\n", "\nmode: path\n")
    text = text.replace("\nbuffer: 0.03048\n", "\n")
    text = text.replace("stale: 0.010", "stale: 0.120")
    # Something that moves, far away, whose sightings may be wrong.
    cart = "  cart: {sphere: {radius: 0.05}, present: false, top_speed: 0.01}\n"
    assert text.count("\nobjects:\n") == 1
    text = text.replace("\nobjects:\n", f"\nobjects:\n{cart}")
    path = tmp_path / "bay.yaml"
    path.write_text(text.replace("bay_arm.urdf", str(FOLDER / "bay_arm.urdf")))
    return path


@pytest.mark.realtime
def test_every_fault_is_answered_as_declared(patient_bay):
    words = ("chaos", str(patient_bay), "--json", "--late", "0.08", "--slack", "0.5")
    run = subprocess.run(
        [sys.executable, "-m", "armguard", *words],
        capture_output=True,
        check=False,
        text=True,
        timeout=900.0,
    )
    rows = json.loads(run.stdout)["faults"]
    assert [row["fault"] for row in rows] == [fault.name for fault in FAULTS]
    assert not [row for row in rows if row["status"] == "FAIL"]
    assert run.returncode == 0
    # Faults are skipped only for want of a part.
    assert all("started no" in row["skipped"] for row in rows if row["skipped"])


@pytest.fixture
def patient_table(tmp_path):
    """The table whose boxes only sensors know, with states believed for longer."""
    text = sensed_table_path().read_text()
    figures = "urdf: panda\n    stopping: {delays: {stale: 0.12}}\n"
    path = tmp_path / "table.yaml"
    path.write_text(text.replace("urdf: panda\n", figures))
    return path


@pytest.mark.realtime
def test_every_fault_of_sensors_is_answered_as_declared(patient_table):
    words = ("chaos", str(patient_table), "--json", "--only", GROUP)
    patient = ("--rate", "100", "--late", "0.25", "--slack", "1")
    run = subprocess.run(
        [sys.executable, "-m", "armguard", *words, *patient],
        capture_output=True,
        check=False,
        text=True,
        timeout=1800.0,
    )
    rows = json.loads(run.stdout)["faults"]
    assert [row["fault"] for row in rows] == [fault.name for fault in SENSOR_FAULTS]
    assert not [row for row in rows if row["status"] != "PASS"]
    assert run.returncode == 0


def test_rows_differ_and_declare_what_can_be_observed():
    names = [(fault.group, fault.name) for fault in FAULTS]
    assert len(set(names)) == len(names)
    for fault in FAULTS:
        if fault.effect in (Effect.STOPS, Effect.REPORTED_ONLY):
            assert fault.reasons and fault.within
        if fault.effect is Effect.GOES_ON:
            assert not fault.reasons


def test_every_row_is_in_the_docs():
    page = (bay_path().parents[4] / "docs" / "chaos.md").read_text()
    for fault in FAULTS:
        assert f"| {fault.name} |" in page, fault.name


def test_a_word_that_is_in_no_name_is_an_error_in_words():
    result = CliRunner().invoke(app, ["chaos", "--only", "all losst"])
    assert result.exit_code != 0
    assert "did you mean 'all lost'" in str(result.exception)
    assert "armguard chaos --list" in str(result.exception)


def test_the_list_has_every_fault_and_starts_nothing():
    names = [fault.name for fault in FAULTS]
    listed = json.loads(CliRunner().invoke(app, ["chaos", "--list", "--json"]).stdout)
    assert [row["fault"] for row in listed["faults"]] == names
    lines = CliRunner().invoke(app, ["chaos", "--list"]).stdout.splitlines()
    assert len(lines) == len(names) + 1
    some = CliRunner().invoke(app, ["chaos", "--list", "--only", "nan"]).stdout
    assert "a position is NaN" in some and "all lost" not in some
