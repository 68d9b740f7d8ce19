"""The command line: jobs with scenes and settings, queries, the page and the view."""

import json
import shutil

import numpy as np
import pytest

import armguard as ag
from armguard.fleet.job import FleetError, JobModel, read_job
from armguard.fleet.manifest import Manifest, settle
from armguard.fleet.playback import item_frames
from armguard.fleet.work import Work
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.recording import open_recording
from armguard.recording.comparison import compare
from armguard.scene import load_scene
from armguard.scene.yaml_source import SceneFileError
from datasets_of_fleets import passing, write_dataset
from recording.tapes import Tape, record_here

JOB = """
inputs: [d, plan.csv]
scenes: [cell.yaml, empty.yaml]
sweep: {scene.buffer: [0.02, 0.3]}
joints: {lift.pos: null}
"""


@pytest.fixture
def job(cell):
    """Three episodes, of which the last is damaged, and a plan, in two scenes."""
    states = [passing(high=1.6), passing(high=0.0), passing(high=0.2)]
    states = [np.column_stack((one, one[:, 0])) for one in states]
    names = ("turn.pos", "bend.pos", "lift.pos")
    write_dataset(cell / "d", "v2.1", states, names=names)
    (cell / "d/data/chunk-000/episode_000002.parquet").write_text("no")
    (cell / "plan.csv").write_text("t,turn,bend\n0,-1,0\n1,-0.5,0.1\n")
    text = (cell / "cell.yaml").read_text()
    (cell / "empty.yaml").write_text(text[: text.index("objects")])
    (cell / "job.yaml").write_text(JOB)
    return cell / "job.yaml"


def test_a_job_with_scenes_and_settings(job, fleet):
    code, said = fleet("audit", "job.yaml", "--out", "r")
    assert code == 2 and "4 could not be judged" in said and "16 results" in said
    code, said = fleet(
        "query", "r", "select scene, setting, input, episode, clear, error is null as "
        "known from results", "--json",
    )  # fmt: skip
    rows = json.loads(said)["rows"]
    # In the order of scenes, settings and inputs.
    inputs = [("d", 0, True), ("d", 1, True), ("d", 2, False), ("plan.csv", -1, True)]
    found = [tuple(row.values()) for row in rows]
    assert [one[:4] + one[5:] for one in found] == [
        (scene, f'{{"scene.buffer": "{buffer}"}}', *one)
        for scene in ("cell.yaml", "empty.yaml")
        for buffer in (0.02, 0.3)
        for one in inputs
    ]
    clear = {one[:4]: one[4] for one in found}
    assert not clear["cell.yaml", '{"scene.buffer": "0.02"}', "d", 0]
    assert clear["empty.yaml", '{"scene.buffer": "0.02"}', "d", 0]
    code, said = fleet(
        "query", "r", "select error from results where error is not null"
    )
    assert code == 0 and "too small" in said
    queries(fleet)
    code, said = fleet("report", "r")
    page = (job.parent / "r" / "report.html").read_text()
    assert code == 0
    assert "armguard fleet view r 0" in page and "plot-least" in page
    assert "4 inputs, 16 results" in page
    scene, frames = item_frames(job.parent / "r", 0)
    shown = [*frames]
    assert len(shown) == 60 and [*scene.robots] == ["arm"]
    stops = [one.verdict[IN_HEADER.reason] == Reason.TOO_CLOSE for one in shown]
    assert any(stops) and not all(stops)
    np.testing.assert_allclose(shown[-1].q, [1.6, 0.0], atol=1e-6)
    with pytest.raises(FleetError, match="0 to 15, not 16"):
        item_frames(job.parent / "r", 16)


def queries(fleet):
    """A query reads the results alone, and an error is a sentence."""
    assert "the query is refused" in fleet("query", "r", "select nothing")[1]
    for sql in (
        "select * from read_csv('plan.csv')",
        "copy results to 'stolen.csv'",
        "attach 'other.db'",
        "set enable_external_access = true",
    ):
        code, said = fleet("query", "r", sql)
        assert "the query is refused" in said and code, sql


def rows_of(folder, work, **job):
    """Results of a job, done in this process."""
    made = Manifest.of(work, JobModel(**job), folder)
    shutil.rmtree(folder / "out", ignore_errors=True)
    settle(folder / "out", made)
    return Work(folder / "out").rows(0, len(made.inputs))


def test_proofs_of_plans_are_those_of_the_verifier(cell):
    (cell / "a.csv").write_text("t,turn,bend\n0,-1,0\n1,-0.5,0.1\n")
    (cell / "b.csv").write_text("t,turn,bend\n0,-0.5,0\n2,1.6,0\n")
    (cell / "c.csv").write_text("t,turn,bend\n0,0,0\n0,1,0\n")
    (cell / "d.csv").write_text("t,turned,bend\n0,0,0\n1,1,0\n")
    rows = rows_of(cell, "verify", inputs=["?.csv"], scenes=["cell.yaml"])
    proof = ag.verify(str(cell / "b.csv"), load_scene(cell / "cell.yaml"))
    assert [row["clear"] for row in rows] == [True, False, False, False]
    assert rows[1]["least"] == proof.least.distance
    assert rows[1]["contacts"] == 1 and rows[1]["b"] == "ball"
    [one] = rows[1]["findings"]
    assert (one["start"], one["end"]) == (
        proof.intervals[0].start,
        proof.intervals[0].end,
    )
    assert "time" in rows[2]["error"] and "'turned'" in rows[3]["error"]
    sweep = {"following_error": [0.6]}
    wide = rows_of(cell, "verify", inputs=["a.csv"], scenes=["cell.yaml"], sweep=sweep)
    assert not wide[0]["clear"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("scenes: [cell.yaml]\n", "inputs"),
        (
            "inputs: [d]\nscene: cell.yaml\n",
            "there is no such key; did you mean 'scenes'",
        ),
        ("inputs: [d]\nunits: grad\n", "units"),
        ("[1]\n", "must be a mapping"),
        ("inputs: [d]\nrest_offset: -1\n", "rest_offset"),
    ],
)
def test_jobs_that_are_none(cell, text, sentence):
    (cell / "job.yaml").write_text(text)
    with pytest.raises(SceneFileError, match=sentence):
        read_job(cell / "job.yaml")


@pytest.mark.parametrize(
    ("work", "job", "sentence"),
    [
        ("audit", {"inputs": ["a.csv"]}, "needs a scene"),
        ("replay", {"inputs": ["a.csv"]}, "`replay` has no use for a plan"),
        ("verify", {"inputs": ["d"], "scenes": ["cell.yaml"]}, "no use for a dataset"),
        (
            "audit",
            {"inputs": ["a.csv"], "scenes": ["cell.yaml"], "sweep": {"skew": [1.0]}},
            "skew is a setting of `verify` alone",
        ),
        (
            "audit",
            {"inputs": ["a.csv"], "scenes": ["cell.yaml"], "sweep": {"buffer": [1.0]}},
            "there is no setting 'buffer'",
        ),
        (
            "verify",
            {"inputs": ["a.csv"], "scenes": ["cell.yaml"], "sweep": {"skew": ["x"]}},
            "skew is 'x'; it must be a number",
        ),
    ],
)
def test_work_without_a_use_for_its_inputs(cell, work, job, sentence):
    (cell / "a.csv").write_text("t,turn,bend\n0,-1,0\n1,-0.5,0.1\n")
    write_dataset(cell / "d", "v2.1", [passing(5)])
    with pytest.raises(ag.ArmguardError, match=sentence):
        Manifest.of(work, JobModel(**job), cell)


def test_a_recording_is_replayed_the_same_way_and_with_other_settings(tmp_path):
    """As `armguard replay` does it: bit by bit, and a wider buffer adds stops."""
    tape = Tape(tmp_path)
    tape.begin()
    record_here(tape, tmp_path / "tapes", 1.0)
    tape.close()
    (tmp_path / "none.mcap").write_bytes(b"none")
    inputs = ["tapes", "none.mcap"]
    same, none = rows_of(tmp_path, "replay", inputs=inputs)
    assert same["clear"] and same["frames"] == 250 and not same["findings"]
    assert "no MCAP file" in none["error"]
    sweep = {"scene.buffer": [0.2]}
    wider, _ = rows_of(tmp_path, "replay", inputs=inputs, sweep=sweep)
    right = compare(open_recording(tmp_path / "tapes"), {"scene.buffer": "0.2"})
    assert right.new and not wider["clear"]
    assert [
        one["start"] for one in wider["findings"] if one["kind"] == "stop added"
    ] == [stop.time for stop in right.new]
    assert wider["stop"] == right.changed.stops[0].time
