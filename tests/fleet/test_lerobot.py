"""LeRobot datasets of all versions, and those that contradict themselves."""

import json

import numpy as np
import pytest

from armguard.fleet.episodes import frames_of
from armguard.fleet.inputs import inputs_of
from armguard.fleet.job import FleetError, JobModel
from armguard.fleet.lerobot import VERSIONS, open_dataset
from armguard.scene import load_scene
from datasets_of_fleets import NAMES, passing, write_dataset

STATES = [passing(20), passing(30, bend=0.5), passing(7), passing(12), passing(9)]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("names", [NAMES, {"motors": [*NAMES]}])
def test_every_frame_is_where_it_belongs(tmp_path, version, names):
    rng = np.random.default_rng(3)
    states = [rng.normal(size=(n, 2)).astype(np.float32) for n in (5, 1, 17, 4, 2)]
    actions = [rng.normal(size=state.shape).astype(np.float32) for state in states]
    write_dataset(tmp_path / "d", version, states, actions, names=names, fps=29.943)
    data = open_dataset(tmp_path / "d")
    assert (data.version, data.fps) == (version, 29.943)
    assert data.state == data.action == NAMES
    assert [one.frames for one in data.episodes] == [5, 1, 17, 4, 2]
    for first, end in ((0, 5), (1, 4), (2, 3)):
        found = data.read(data.episodes[first:end])
        np.testing.assert_array_equal(
            np.column_stack(found.state), np.concatenate(states[first:end])
        )
        np.testing.assert_array_equal(
            np.column_stack(found.action), np.concatenate(actions[first:end])
        )
        np.testing.assert_array_equal(
            np.diff(found.first), [len(one) for one in states[first:end]]
        )


def test_columns_become_joints_by_name_unit_scale_and_zero(cell):
    states = [np.degrees(state)[:, ::-1] for state in STATES]
    names = ("bend.pos", "turn.pos")
    write_dataset(cell / "d", "v3.0", states, names=names)
    scene = load_scene(cell / "cell.yaml")
    job = JobModel(inputs=["d"], units="degrees")
    [found] = frames_of(inputs_of(["d"], cell), job, cell, scene)
    np.testing.assert_allclose(found.q, np.concatenate(STATES), atol=1e-6)
    np.testing.assert_allclose(np.diff(found.times)[0], 1.0 / 30.0)
    joints = {
        "bend.pos": {"joint": "arm/bend", "scale": -0.005, "zero": 0.25},
        "turn.pos": None,
    }
    job = JobModel(inputs=["d"], joints=joints, hold_home=True)
    [found] = frames_of(inputs_of(["d"], cell), job, cell, scene)
    bend = -0.005 * np.concatenate(states)[:, 0] + 0.25
    np.testing.assert_allclose(found.q[:, 1], bend, atol=1e-5)
    assert (found.q[:, 0] == -1.0).all()


def info(**changed):
    def change(root):
        path = root / "meta" / "info.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changed))

    return change


def text(name, written):
    return lambda root: (root / name).write_text(written)


FEATURE = {"dtype": "float32", "shape": [3], "names": ["a", "b", "c"]}


@pytest.mark.parametrize(
    ("version", "change", "sentence"),
    [
        ("v2.1", info(codebase_version="v1.6"), "it is of version 'v1.6'"),
        ("v2.1", info(fps=0), "fps is 0 in info.json"),
        ("v2.1", info(features={}), "lists no feature 'observation.state'"),
        ("v3.0", info(total_episodes=6), "says 6 episodes, but meta lists 5"),
        ("v2.0", info(total_frames=79), "says 79 frames, but meta lists 78"),
        ("v2.1", info(data_path="../{episode_index:06d}"), "must lead into the"),
        ("v2.1", info(data_path="{0.__class__}"), "must lead into the"),
        ("v2.1", info(data_path="{video_key:03d}"), "must lead into the"),
        ("v2.1", info(chunks_size=0), "chunks_size is 0"),
        ("v2.1", text("meta/info.json", "{"), "it is no JSON"),
        ("v2.1", text("meta/episodes.jsonl", '{"length": 3}\n'), "line 1: an episode"),
        ("v3.0", text("meta/episodes/chunk-000/file-000.parquet", "x"), "Parquet"),
    ],
)
def test_metadata_that_contradict_each_other(tmp_path, version, change, sentence):
    write_dataset(tmp_path / "d", version, STATES)
    change(tmp_path / "d")
    with pytest.raises(FleetError, match=sentence):
        open_dataset(tmp_path / "d")


def lines(*lengths):
    """Lengths of the episodes, in meta and in info.json."""

    def change(root):
        rows = [{"episode_index": k, "length": n} for k, n in enumerate(lengths)]
        (root / "meta" / "episodes.jsonl").write_text("\n".join(map(json.dumps, rows)))
        info(total_frames=sum(lengths))(root)

    return change


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lines(20, 30, 8, 12, 9), "episode 2 has 7 frames, but meta says 8"),
        (text("data/chunk-000/episode_000002.parquet", "no"), "too small"),
        (
            lambda root: (root / "data/chunk-000/episode_000002.parquet").unlink(),
            "episode_000002.parquet: the file is missing",
        ),
        (info(features={"observation.state": FEATURE}), "no value of"),
    ],
)
def test_files_that_contradict_the_metadata(cell, change, sentence):
    """The episode is named, and the others are read."""
    write_dataset(cell / "d", "v2.1", STATES)
    change(cell / "d")
    scene = load_scene(cell / "cell.yaml")
    found = [*frames_of(inputs_of(["d"], cell), JobModel(inputs=["d"]), cell, scene)]
    wrong = [one for one in found if isinstance(one, tuple)]
    assert sentence in wrong[0][1]
    if len(wrong) == 1:
        assert wrong[0][0].episode == 2 and len(found) == 5


@pytest.mark.parametrize(
    ("names", "job", "sentence"),
    [
        (("turn.pos", "bent.pos"), {}, "joint 'bent' is not in the scene; "),
        (("turn.pos", "bend.pos"), {"joints": {"x": "arm/turn"}}, "name no column"),
        (("turn.pos", "bend.pos"), {"joints": {"bend.pos": None}}, "no positions for"),
        (("turn.pos", "bend.pos"), {"units": "degrees"}, None),
        (None, {}, "joint 'observation.state[0]' is not in the scene"),
    ],
)
def test_names_that_fit_no_joint(cell, names, job, sentence):
    write_dataset(cell / "d", "v2.1", STATES[:1], names=names)
    scene = load_scene(cell / "cell.yaml")
    job = JobModel(inputs=["d"], **job)
    [found] = frames_of(inputs_of(["d"], cell), job, cell, scene)
    if sentence is None:
        assert not isinstance(found, tuple)
    else:
        assert sentence in found[1]


def test_degrees_are_refused_as_radians(cell):
    write_dataset(cell / "d", "v2.1", [np.degrees(STATES[0])])
    scene = load_scene(cell / "cell.yaml")
    [found] = frames_of(inputs_of(["d"], cell), JobModel(inputs=["d"]), cell, scene)
    assert "degrees" in found[1]


def test_inputs_are_found_in_folders_and_refused_by_name(cell):
    write_dataset(cell / "all" / "one", "v2.1", STATES[:2])
    write_dataset(cell / "all" / "two", "v3.0", STATES[:1])
    (cell / "all" / "plan.csv").write_text("t,turn,bend\n0,0,0\n1,1,0\n")
    (cell / "empty").mkdir()
    found = inputs_of(["all"], cell)
    assert [(one.source, one.episode) for one in found] == [
        ("all/one", 0), ("all/one", 1), ("all/plan.csv", -1), ("all/two", 0)
    ]  # fmt: skip
    assert inputs_of(["all/t*"], cell) == [found[3]]
    for given, sentence in (
        (["none"], "there is no such file"),
        (["arm.urdf"], "is no input"),
        (["empty"], "no LeRobot dataset, recording or plan"),
        (["all", "all/two"], "all/two, episode 0: it is given twice"),
    ):
        with pytest.raises(FleetError, match=sentence):
            inputs_of(given, cell)
