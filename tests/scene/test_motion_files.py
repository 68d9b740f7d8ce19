"""Motion files as people have them: other separators, names, units, arrays."""

import json

import numpy as np
import pytest

from armguard.errors import TrajectoryError
from armguard.scene import bay_scene, load_trajectory


@pytest.fixture(scope="module")
def bay():
    """Two arms with seven joints each."""
    return bay_scene()


@pytest.mark.parametrize(
    "text",
    [
        "t,a,b\n0,1,2\n0.5,3,4\n",
        "\ufefft,a,b\r\n0,1,2\r\n0.5,3,4\r\n",
        "# made on Monday\nt,a,b\n0,1,2\n# half way\n0.5,3,4\n",
        "# t,a,b\n0,1,2\n0.5,3,4\n",
        "# t a b\n0.0 1.0 2.0\n5.0e-01 3.0 4.0\n",
        "t;a;b\n0;1,0;2,0\n0,5;3,0;4,0\n",
        "t\ta\tb\n0\t1\t2\n0.5\t3\t4\n",
        "time [s] , a, b\n0, 1, 2\n0.5, 3, 4\n",
        "timestamp_ms,a,b\n0,1,2\n500,3,4\n",
        "time_ns,a,b\n0,1,2\n500000000,3,4\n",
        ",t,a,b\n0,0,1,2\n1,0.5,3,4\n",
        "Unnamed: 0,t,a,b\n0,0,1,2\n1,0.5,3,4\n",
    ],
)
def test_tables_of_every_kind_say_the_same(tmp_path, text):
    path = tmp_path / "m.CSV"
    path.write_text(text, newline="")
    motion = load_trajectory(path)
    assert motion.names == ("a", "b")
    assert motion.q.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert np.allclose(motion.stamps, [0.0, 0.5], rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0.1,0.2\n0.3,0.4\n", "m.csv:1: the first line must hold the joint names; it"),
        ("a,,c\n1,2,3\n", "column 2 has none"),
        ("t\n1\n", "there is no joint in the header"),
        ("t,a\n1700000000000000000,1\n", "name its unit: 't_ms', 't_us' or 't_ns'"),
        ("# nothing\n", "there is no configuration"),
    ],
)
def test_tables_that_cannot_be_intended_are_refused(tmp_path, text, says):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(TrajectoryError) as caught:
        load_trajectory(path)
    assert says in str(caught.value)


def test_a_table_in_another_encoding_is_refused_in_words(tmp_path):
    (tmp_path / "m.csv").write_bytes("größe\n1\n".encode("utf-16"))
    with pytest.raises(TrajectoryError, match="is no text in UTF-8"):
        load_trajectory(tmp_path / "m.csv")


@pytest.mark.parametrize("sign", ["/", "_", "."])
def test_robots_may_stand_before_joints_in_anyones_way(tmp_path, bay, sign):
    q = np.arange(14.0) / 10.0
    names = [name.replace("/", sign) for name in bay.q_names]
    path = tmp_path / "m.csv"
    path.write_text(",".join(names) + "\n" + ",".join(map(str, q)) + "\n")
    assert load_trajectory(path).for_scene(bay)[0].tolist() == q.tolist()


def test_degrees_are_refused_and_a_turn_too_far_is_not(tmp_path, bay):
    path = tmp_path / "m.csv"
    for value, refused in ((90.0, True), (4.0, False), (float("nan"), False)):
        row = ",".join([str(value), *["0"] * 13])
        path.write_text(",".join(bay.q_names) + "\n" + row + "\n")
        motion = load_trajectory(path)
        if refused:
            with pytest.raises(TrajectoryError, match="at 90, which looks like degr"):
                motion.for_scene(bay)
        else:
            assert motion.for_scene(bay).shape == (1, 14)


def test_arrays_may_go_by_other_names(tmp_path, bay):
    path = tmp_path / "m.npz"
    q = np.zeros((3, 14), dtype=np.float32)
    names = np.array(bay.q_names)
    np.savez(path, joint_names=names, qpos=q, time=np.arange(3))
    motion = load_trajectory(path)
    assert motion.for_scene(bay).shape == (3, 14)
    assert motion.stamps.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"names": np.array(["a"]), "x": np.zeros(3)}, "only 'names', 'x'"),
        ({"names": np.array(["a"], object), "q": np.zeros((1, 1))}, "Python objects"),
        ({"names": np.array(["a", "b"]), "q": np.zeros((2, 3))}, "turn it"),
        ({"names": np.array(["a"]), "q": np.array([["x"]])}, "must hold numbers"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_in_words(tmp_path, arrays, says):
    np.savez(tmp_path / "m.npz", **arrays)
    with pytest.raises(TrajectoryError) as caught:
        load_trajectory(tmp_path / "m.npz")
    assert says in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04cut", b"\x93NUMPY"])
def test_what_is_no_npz_is_said_in_words(tmp_path, content):
    (tmp_path / "m.npz").write_bytes(content)
    with pytest.raises(TrajectoryError, match=r"'m\.npz' is no NPZ file"):
        load_trajectory(tmp_path / "m.npz")


def test_a_trajectory_as_ros_prints_it_is_read(tmp_path):
    since = ({"sec": 0, "nanosec": 0}, {"sec": 1, "nanosec": 500_000_000})
    values = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": ["a", "b"],
        "points": [
            {"positions": [k, k + 1.0], "time_from_start": t}
            for k, t in enumerate(since)
        ],
    }
    for name in ("m.json", "m.yaml"):
        (tmp_path / name).write_text(json.dumps(values))
        motion = load_trajectory(tmp_path / name)
        assert motion.q.tolist() == [[0.0, 1.0], [1.0, 2.0]]
        assert motion.stamps.tolist() == [0.0, 1.5]
    values["points"][1]["positions"] = [1.0]
    (tmp_path / "m.json").write_text(json.dumps(values))
    with pytest.raises(TrajectoryError, match="point 2 has 1 positions"):
        load_trajectory(tmp_path / "m.json")
    (tmp_path / "m.yaml").write_text("points: 3\n")
    with pytest.raises(TrajectoryError, match="is no trajectory with joint_names"):
        load_trajectory(tmp_path / "m.yaml")
