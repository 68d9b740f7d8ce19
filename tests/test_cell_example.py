"""The cell with two arms: every command of its README, and what comes of them."""

import re
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.maps.job import map_of, read_job

FOLDER = Path(__file__).parents[1] / "examples" / "cell"
COMMANDS = re.findall(r"^armguard (.+)$", (FOLDER / "README.md").read_text(), re.M)


@pytest.fixture
def answer(tmp_path, monkeypatch):
    """Runs a command of the README, in a folder that may be written to."""
    for file in FOLDER.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)

    def run(command):
        found = CliRunner().invoke(app, command.split())
        assert found.exit_code == 0, found.output
        return found.stdout

    return run


def test_its_commands_lead_from_plans_to_interlocks(answer, tmp_path):
    assert len(COMMANDS) == 6
    _, left, right, job, starts, joints = map(answer, COMMANDS)
    assert "OK, every pair keeps its buffer" in left
    assert "OK, every pair keeps its buffer" in right
    assert "s together, 18.5 s one after the other, 9.5 s if neither were there" in job
    assert "'left' starts at 0.00 s and ends at 9.50 s" in starts
    assert "until then 'left' near (0.38, 0.07, 0.53) has reserved a cell" in starts
    assert "left/panda_joint2 and left/panda_joint4, the others at home" in joints
    results = tmp_path / "results"
    written = YAML(typ="safe").load(results / "interlocks.yaml")["interlocks"]
    assert len(written) >= 1
    for name in ("diagram.png", "slice.png", "schedule.csv", "map.npz"):
        assert (results / name).stat().st_size > 0


def test_its_schedule_saves_a_third_of_the_time_and_obeys_its_interlocks():
    cell = map_of(read_job(FOLDER / "cell-job.yaml"))
    assert [one.name for one in cell.segments["left"]][:2] == ["fetch", "lift"]
    assert not any(cell.alone.values())
    run = cell.execute(cell.interlocks())
    assert run.finished
    assert run.times[-1] < 0.7 * cell.one_after_another
    assert all(cell.allowed(*both) for both in run.plan_times)
    assert not cell.allowed(*np.array([6.5, 6.0]))
