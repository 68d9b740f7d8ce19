"""Closed loops: contacts, stops and needless stops, and what a job may hold."""

import json

import numpy as np
import pytest

import armguard as ag
from armguard.fleet import manifest as manifests
from armguard.fleet.engine import Here, Processes
from armguard.fleet.job import JobModel
from armguard.fleet.loops import Loops
from armguard.fleet.manifest import Manifest, settle
from armguard.fleet.playback import item_frames
from armguard.fleet.run import run_job
from armguard.fleet.store import part_of, query, write_part
from armguard.fleet.work import Work
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason

# Straight through the ball, past nothing, and towards the ball but back in time.
HIT = "t,turn,bend\n0,-1,0\n1.3,1.6,0\n"
FREE = "t,turn,bend\n0,-1,0\n1,-0.2,0.3\n"
BACK = "t,turn,bend\n0,-1,0\n0.6,0.2,0\n1.2,-1,0\n"


@pytest.fixture
def loops(cell, moving):
    """The cell with an arm that stops as declared, and three plans."""
    (cell / "cell.yaml").write_text(moving)
    for name, plan in (("hit", HIT), ("free", FREE), ("back", BACK)):
        (cell / f"{name}.csv").write_text(plan)
    return cell


def job_of(folder, *inputs, **more):
    job = JobModel(inputs=[*inputs], scenes=["cell.yaml"], **more)
    return Manifest.of("run", job, folder)


def gaps(q):
    """Distance of rod and tip from the ball in each state, by trigonometry [m]."""
    turn, bend = q.T
    rod = 0.3 * np.exp(1j * turn)
    tip = rod + 0.33 * np.exp(1j * (turn + bend))
    return np.abs(np.stack((rod, tip)) - (0.5 + 0.45j)).min(axis=0) - 0.15


@pytest.mark.parametrize("judge", ["coal", "checker"])
def test_arms_that_react_late_touch_and_arms_that_keep_their_word_do_not(loops, judge):
    if judge == "coal":
        pytest.importorskip("coal")
    sweep = {"plant.lateness": [1.0, 3.0]}
    made = job_of(loops, "hit.csv", "free.csv", sweep=sweep, judge=judge)
    found = []
    for group in (0, 1):
        own = Loops(made, group)
        for one in made.inputs:
            loop, longest = own.loop(one)
            for _ in loop.run(longest):
                pass
            row = own.row(one)
            least = gaps(np.array(loop.rows)).min()
            # Between the states of the loop it may be nearer.
            near = None if least > 0.05 else pytest.approx(least, abs=2e-4)
            assert row["least"] == near
            assert (row["contacts"] > 0) == (least < 0.0) == (not row["clear"])
            assert row["judge"] == judge and row["frames"] == loop.cycles
            found.append((row, {each["kind"] for each in row["findings"]}))
    (hit, kinds), (free, none), (late, worse), _ = found
    assert hit["clear"] and 0 < hit["stops"] and not hit["needless_stops"]
    assert hit["stop_reason"] == "TOO_CLOSE" and 0.0 < hit["least"] < 0.02
    assert 0.4 < hit["done"] < 0.75 and kinds == {"stop", "not done"}
    assert hit["longest_hold"] > 0.3 and 3.8 < hit["duration"] < 3.9
    assert free["done"] == 1.0 and not none and free["stop"] is None
    assert free["duration"] < 1.1 and free["longest_hold"] == 0.0
    assert late["contacts"] == 1 and late["least"] < -0.003
    assert worse == {"contact", "stop", "not done"}
    [contact] = [each for each in late["findings"] if each["kind"] == "contact"]
    assert {contact["a"], contact["b"]} == {"arm/tip", "ball"}


def test_a_stop_is_needless_if_the_motion_turns_back_in_time(loops):
    made = job_of(loops, "back.csv")
    row = Loops(made, 0).row(made.inputs[0])
    assert (
        row["clear"] and row["needless"] and row["needless_stops"] == row["stops"] > 0
    )
    assert row["findings"][0]["kind"] == "needless stop"
    assert row["findings"][0]["a"] == "arm"


def test_a_wider_buffer_is_kept_and_costs_motion(loops):
    """The settings of the scene are swept, and the simulated arm has them too."""
    made = job_of(loops, "hit.csv", sweep={"scene.buffer": [0.0, 0.04]})
    bare, wide = (Loops(made, group).row(made.inputs[0]) for group in (0, 1))
    assert bare["clear"] and wide["clear"] and bare["least"] < 0.02
    assert wide["least"] >= 0.04 - 1e-5 and wide["done"] < bare["done"]


def test_random_motions_by_all_engines_by_seed_and_in_the_view(loops, monkeypatch):
    """The same bytes; a seed alone is the same episode; the view shows its cycles."""
    monkeypatch.setattr(manifests, "SHARD_SECONDS", 0.2)
    np.save(loops / "rows.npy", np.array([[-1.0, 0.0], [-0.9, 0.0]]))
    made = job_of(loops, "random:3-8", "hit.csv", "rows.npy", duration=0.8)
    assert len(made.ends) > 2
    first = run_job(made, loops / "here", Here())
    assert (first.items, first.failed, first.clear) == (8, 1, 7)
    sql = "select input, error from results where error is not null"
    assert query(loops / "here", sql)[1] == [
        ("rows.npy", "rows.npy: it has no times; `run` needs them")
    ]
    run_job(made, loops / "two", Processes(2))
    parts = [
        {path.name: path.read_bytes() for path in sorted((loops / name).glob("part-*"))}
        for name in ("here", "two")
    ]
    assert parts[0] == parts[1]
    own = Loops(made, 0)
    all_rows = [own.row(one) for one in made.inputs[:7]]
    alone = job_of(loops, "random:5", duration=0.8)
    assert Loops(alone, 0).row(alone.inputs[0]) == all_rows[2]
    # Other seeds are other motions.
    assert len({row["done"] for row in all_rows[:6]}) > 2
    scene, frames = item_frames(loops / "here", 6)
    shown = [*frames]
    assert [*scene.robots] == ["arm"] and len(shown) == all_rows[6]["frames"] == 100
    reasons = [one.verdict[IN_HEADER.reason] for one in shown]
    assert (Reason.TOO_CLOSE in reasons) == (all_rows[6]["stops"] > 0)


def done_here(folder, name, *inputs, **more):
    """Do a job in this process, as the command line's would be."""
    made, out = job_of(folder, *inputs, **more), folder / name
    settle(out, made)
    work = Work(out)
    for number in range(len(made.ends)):
        rows = work.rows(*made.shard(number))
        write_part(part_of(out, number), rows, made.hash)


def test_the_command_its_exit_codes_and_its_page(loops, fleet):
    words = ["run", "hit.csv", "--scene", "cell.yaml", "--out"]
    done_here(loops, "kept", "hit.csv")
    done_here(loops, "both", "hit.csv", sweep={"plant.lateness": ["1", "3"]})
    # The guard stops the arm, which is no error.
    code, said = fleet(*words, "kept")
    assert code == 0 and "1 results: 1 clear, 1 with findings" in said
    code, said = fleet(*words, "both", "--set", "plant.lateness=1,3")
    assert code == 1 and "2 results: 1 clear, 2 with findings" in said
    sql = "select contacts, stops > 0 as stops, judge from results order by item"
    rows = json.loads(fleet("query", "both", sql, "--json")[1])["rows"]
    assert [row["contacts"] for row in rows] == [0, 1] and rows[0]["stops"]
    assert fleet("report", "both")[0] == 0
    page = (loops / "both" / "report.html").read_text()
    assert "1 of them with contacts" in page and "for another second" in page
    assert "armguard fleet view both 1" in page and "plot-done" in page
    assert "motion done" in page and rows[0]["judge"] in page


@pytest.mark.parametrize(
    ("work", "job", "sentence"),
    [
        ("run", {"inputs": ["random:-3"]}, "names no seeds; write random:SEED"),
        ("run", {"inputs": ["random:"]}, "names no seeds"),
        ("run", {"inputs": ["random:1.5"]}, "names no seeds"),
        ("run", {"inputs": ["random:9-0"]}, r"no episode; .* as in random:0-9"),
        ("run", {"inputs": ["random:0-99999999"]}, "divide it into jobs of at most"),
        ("run", {"inputs": ["random:1-3", "random:3"]}, "given twice"),
        ("run", {"inputs": ["drive:0-9"]}, "no such file .* random:FIRST-LAST"),
        ("run", {"inputs": ["random:0"], "scenes": []}, "`run` needs a scene"),
        ("run", {"inputs": ["random:0"], "scenes": ["fixed.yaml"]}, "mode 'fixed'"),
        ("run", {"inputs": ["random:0"], "scenes": ["sensed-table"]}, "has no sensors"),
        ("audit", {"inputs": ["random:0-9"]}, "`audit` has no use for a random motion"),
        ("verify", {"inputs": ["random:0"]}, "`verify` has no use for a random motion"),
        ("replay", {"inputs": ["random:0"]}, "`replay` has no use for a random motion"),
        ("audit", {"inputs": ["hit.csv"], "duration": 3.0}, "keys of `run` alone"),
        ("verify", {"inputs": ["hit.csv"], "judge": "coal"}, "keys of `run` alone"),
        (
            "audit",
            {"inputs": ["hit.csv"], "sweep": {"plant.errors": [1.0]}},
            "plant.errors is a setting of `run` alone",
        ),
        (
            "run",
            {"inputs": ["random:0"], "sweep": {"plant.lateness": [-1.0]}},
            "it must be a number from 0 on",
        ),
        (
            "run",
            {"inputs": ["random:0"], "sweep": {"plant.errors": ["nan"]}},
            "it must be a number from 0 on",
        ),
    ],
)
def test_jobs_that_cannot_be_run(loops, work, job, sentence):
    text = (loops / "cell.yaml").read_text()
    (loops / "fixed.yaml").write_text(text.replace("mode: path", "mode: fixed"))
    with pytest.raises(ag.ArmguardError, match=sentence):
        Manifest.of(work, JobModel(**{"scenes": ["cell.yaml"]} | job), loops)


def test_objects_that_move_are_refused(loops):
    text = (loops / "cell.yaml").read_text()
    text = text.replace("radius: 0.1},", "radius: 0.1}, top_speed: 1.0,")
    (loops / "cell.yaml").write_text(text)
    with pytest.raises(ag.SceneError, match="moves no objects"):
        job_of(loops, "random:0")
