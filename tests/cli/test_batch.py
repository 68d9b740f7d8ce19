"""`armguard batch`: counts, pairs, exit codes and files that cannot be read."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.scene.bay import bay_path


@pytest.fixture(scope="module")
def home():
    return ag.load_scene(bay_path()).home


def play(*args):
    return CliRunner().invoke(
        app, ["batch", *map(str, args), "--scene", str(bay_path())]
    )


def test_rows_are_counted_and_pairs_named(tmp_path, home):
    rows = np.tile(home, (20, 1))
    rows[3, 1] = np.nan
    rows[5:8] += np.linspace(1.0, 2.0, 3)[:, None]
    np.save(tmp_path / "rows.npy", rows)
    np.savetxt(tmp_path / "rows.csv", rows, delimiter=",")
    for name in ("rows.npy", "rows.csv"):
        done = play(tmp_path / name, "--json", "--margin", 1.0)
        report = json.loads(done.stdout)
        assert report["rows"] == 20
        assert report["invalid"] == 1
        assert report["clear"] + report["not_clear"] == 19
        clear = ag.Checker(ag.load_scene(bay_path())).clear(rows)
        assert report["clear"] == clear.sum()
        assert done.exit_code == 1
        assert sum(pair["rows"] for pair in report["pairs"]) <= 19
        assert report["pairs"][0]["a"]


def test_motions_are_proven_from_row_to_row(tmp_path, home):
    np.save(tmp_path / "plan.npy", home + np.linspace(0.0, 0.05, 9)[:, None])
    done = play(tmp_path / "plan.npy", "--motions")
    assert done.exit_code == 0
    assert done.stdout.startswith("8 motions: 8 proven, 0 not proven, 0 invalid")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("rows.csv", "a,b", "holds no table of numbers"),
        ("rows.npy", "no numbers", "holds no table of numbers"),
        ("rows.txt", "1,2", "must end in .npy or .csv"),
        ("rows.csv", "1,2", "q has shape (1, 2)"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    done = play(tmp_path / name)
    assert done.exit_code != 0
    assert isinstance(done.exception, ag.SceneError)
    assert said in str(done.exception)


def test_a_file_that_is_not_there_is_named(tmp_path):
    done = play(tmp_path / "none.npy")
    assert isinstance(done.exception, ag.SceneError)
    assert "none.npy" in str(done.exception)
