"""Mistakes in files: the answer has the value, the place and the remedy.

Each kind in the scene file, in the motion file of `armguard run` and in a URDF.
Mistakes in Python are in tests/guard, messages to the service in tests/service.
"""

import numpy as np
import pytest
from typer.testing import CliRunner

from armguard import ArmguardError, Scene
from armguard.cli.app import app
from arms import TURN_AND_LIFT
from mistakes.motion_file import MOTION_FILE
from mistakes.robot_file import ROBOT_FILE
from mistakes.scene_file import SCENE_FILE, scene_text
from motion_files import HEADER, times

HOME = [0.5, 0.1, 0.5, 0.1]

TRIANGLE = "v 0 0 0\nv 1200 0 0\nv 0 800 0\nf 1 2 3\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the arm's file."""
    path = tmp_path_factory.mktemp("doors")
    (path / "r.urdf").write_text(TURN_AND_LIFT)
    (path / "good.yaml").write_text(scene_text())
    (path / "mm.obj").write_text(TRIANGLE)
    return path


def refusal(result):
    """What a command that failed has printed or raised."""
    assert result.exit_code != 0, result.output
    if result.exception and not isinstance(result.exception, SystemExit):
        assert isinstance(result.exception, ArmguardError), result.exception
        return str(result.exception)
    return " ".join(result.output.split())


def write(path, text):
    """Write a file of text, or of bytes."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("kind", SCENE_FILE)
def test_a_scene_file_is_refused(folder, caplog, kind):
    mistake = SCENE_FILE[kind]
    path = write(folder / "bad.yaml", mistake.given)
    result = CliRunner().invoke(app, ["check", str(path)])
    if mistake.logged:
        assert not mistake.missing(caplog.text)
    else:
        said = refusal(result)
        assert not mistake.missing(said), said
        assert "-> fix " in said or "write under" in said


@pytest.mark.parametrize("kind", MOTION_FILE)
def test_a_motion_file_is_refused(folder, kind):
    mistake = MOTION_FILE[kind]
    path = write(folder / "m.csv", mistake.given)
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    said = refusal(CliRunner().invoke(app, words))
    assert not mistake.missing(said), said


@pytest.mark.parametrize("kind", ROBOT_FILE)
def test_a_robot_file_is_refused(tmp_path, caplog, kind):
    mistake = ROBOT_FILE[kind]
    path = write(tmp_path / "r.urdf", mistake.given)
    figures = {"deceleration": 1.0}
    if mistake.logged:
        Scene().add_robot(path, "a", stopping=figures)
        assert not mistake.missing(caplog.text), caplog.text
        return
    with pytest.raises(ArmguardError) as caught:
        Scene().add_robot(path, "a", stopping=figures)
    assert not mistake.missing(str(caught.value)), caught.value


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + times(0, 0.02),
        times(0, 20, name="t_ms"),
        times(0, 2e4, 4e4, name="t_us"),
        times(0, 0.02).replace(",", "|"),
        times(0, 1, 2, moves=0),
    ],
    ids=["BOM", "t_ms", "t_us", "bars", "slow and at rest"],
)
def test_a_motion_file_that_is_right_is_judged(folder, text):
    path = folder / "m.csv"
    path.write_text(text)
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    assert CliRunner().invoke(app, words).exit_code == 0


@pytest.mark.parametrize(
    ("name", "times", "says"),
    [
        ("t", [0.0, 20.0], "looks like milliseconds; name the times 't_ms', or 't_s'"),
        ("t_ms", [[0.0, 20.0]], "t_ms has shape (1, 2) of float64; it must be (2,) of"),
        ("time", ["0", "1"], "time has shape (2,) of <U1; it must be (2,) of numbers"),
        ("t_ms", [0.0, 20.0], None),
    ],
)
def test_times_of_arrays_are_as_those_of_tables(folder, name, times, says):
    path = folder / "m.npz"
    q = np.array([HOME, [0.51, *HOME[1:]]])
    np.savez(path, names=HEADER.split(",")[1:], q=q, **{name: np.array(times)})
    words = ["run", str(folder / "good.yaml"), "--trajectory", str(path)]
    result = CliRunner().invoke(app, words)
    if says is None:
        assert result.exit_code == 0, result.output
    else:
        assert says in refusal(result)
