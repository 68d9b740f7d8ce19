"""Frames in a file: played again they fill the same map; damaged files are refused."""

import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.errors import RecordingError
from armguard.sense.frames_file import DEPTH, JOINTS, ZONES, read_events, write_event
from armguard.simulation.sensed import drive, sensed_bay, swing
from armguard.simulation.sensors import Rig


def test_a_file_fills_the_same_map_to_the_bit(tmp_path):
    path, scene = tmp_path / "frames.bin", sensed_bay()
    rig = Rig(scene, boxes=[(0.2, 0.2, 0.2)])
    rig.invalid = 0.2
    rig.place(0, ag.Pose(xyz=(-0.5, 0, 1.2)))
    with path.open("wb") as file:
        first = ag.Sense(scene, record=file)
        drive(first, rig, swing(scene), 1.0)
        first.zones("left_ring/0", "text", [1], 0.99)
        first.depth("top", np.zeros((2, 2)), "text")
    again = ag.Sense(sensed_bay())
    assert again.play(path) > 250
    assert again.cells.checkpoint() == first.cells.checkpoint()
    assert first.cells.occupied().any()
    names = {name: str(one) for name, one in first.health.items()}
    assert {name: str(one) for name, one in again.health.items()} == names


def test_events_come_back_and_half_written_ones_do_not(tmp_path):
    path, file = tmp_path / "frames.bin", io.BytesIO()
    write_event(file, JOINTS, "", 0.5, [1.0, 2.0])
    write_event(file, ZONES, "a/1", 0.6, np.arange(4, dtype=np.uint16), [5, 5, 5, 0])
    write_event(file, DEPTH, "top", 0.7, None)
    data = file.getvalue()
    path.write_bytes(data)
    found = list(read_events(path))
    assert [(e.event, e.name, e.stamp) for e in found] == [
        (JOINTS, "", 0.5), (ZONES, "a/1", 0.6), (DEPTH, "top", 0.7),
    ]  # fmt: skip
    assert found[1].arrays[0].dtype == np.uint16
    assert [one.tolist() for one in found[1].arrays] == [[0, 1, 2, 3], [5, 5, 5, 0]]
    assert found[2].arrays == []
    path.write_bytes(data[:-3])
    assert len(list(read_events(path))) == 2


def damaged(kind):
    file = io.BytesIO()
    if kind == "objects":
        np.save(file, np.array([{}], dtype=object), allow_pickle=True)
    elif kind == "no header":
        np.save(file, np.zeros(3))
    elif kind == "event":
        write_event(file, 9, "a", 0.0)
    else:
        file.write(b"no array at all")
    return file.getvalue()


@pytest.mark.parametrize("kind", ["objects", "no header", "event", "text"])
def test_a_damaged_file_is_refused_with_a_sentence(tmp_path, kind):
    path = tmp_path / "frames.bin"
    path.write_bytes(damaged(kind))
    with pytest.raises(RecordingError, match="is no file of frames"):
        list(read_events(path))
    with pytest.raises(RecordingError, match="cannot be read"):
        list(read_events(tmp_path / "none.bin"))


SCENE = """
robots: {arm: {urdf: panda}}
sensing:
  {region: {centre: [0, 0, 0.5]}, unknown: still, intruder: {speed: 1.6, size: 0.05}}
sensors:
  top: {kind: depth, size: [40, 30], focal: 30, at: {xyz: [1, 0, 1], rpy: [3.14, 0, 0]}}
"""


def test_the_command_names_faults_with_their_times(tmp_path):
    scene, path = tmp_path / "cell.yaml", tmp_path / "frames.bin"
    scene.write_text(SCENE, encoding="utf-8")
    home = ag.load_scene(scene).home
    with path.open("wb") as file:
        for k in range(200):
            write_event(file, JOINTS, "", 0.01 * k, home)
            if k < 100 and k % 4 == 0:
                image = np.full((30, 40), 1.0) + 0.001 * k
                write_event(file, DEPTH, "top", 0.01 * k, image)
    command = ["sense", str(scene), "--play", str(path)]
    result = CliRunner().invoke(app, [*command, "--json"])
    assert result.exit_code == 1, result.output
    answer = json.loads(result.stdout)
    (fault,) = answer["sensors"]["top"]["faults"]
    assert fault["fault"] == "SILENT"
    # The last frame is of 0.96 s; two periods, delay and jitter are 0.12 s.
    assert fault["from"] == pytest.approx(1.09, abs=0.011)
    assert answer["sensors"]["top"]["frames"] == 25
    # What a silent sensor has freed is forgotten, but for the insides of links.
    assert 0 < answer["known_free"] < 10_000
    shown = CliRunner().invoke(app, command)
    assert "top: SILENT: it sends no frames" in shown.stdout
