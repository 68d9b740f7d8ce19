"""The notebook of the examples runs, cell by cell, and shows what its text says."""

import json
from pathlib import Path

import numpy as np

from armguard import Action, Level, Reason

NOTEBOOK = Path(__file__).parents[1] / "examples" / "first_guard.ipynb"


def test_the_cells_of_the_notebook_run_in_order(capsys):
    known: dict = {}
    for cell in json.loads(NOTEBOOK.read_text())["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec(compile("".join(cell["source"]), NOTEBOOK.name, "exec"), known)
    printed = capsys.readouterr().out

    scene, guard, command = known["scene"], known["guard"], known["command"]
    assert scene.period == known["PERIOD"] == 0.01
    assert list(scene.robots) == ["left", "right"]
    for shown in (scene, command, command.verdict):
        assert shown._repr_html_().startswith("<table>")
    turned = np.abs(known["q"] - guard.home)[[0, 8]]
    assert (turned > 0.1).all()
    assert command.action is Action.FOLLOW
    assert max(command.passed.values()) < 0.9
    assert 0.005 < min(known["distances"]) < 0.1

    refused = known["refused"]
    assert refused.level >= Level.STOP and refused.reason is Reason.OUT_OF_LIMITS
    assert "\nOUT_OF_LIMITS\n" in printed
    assert "the positions look like degrees; give radians" in printed

    assert known["stopped"].action >= Action.HOLD
    assert set(known["resting"].held) == {"left", "right"}
    assert "call engage('left')" in printed
    assert known["engaged"].action is Action.FOLLOW
