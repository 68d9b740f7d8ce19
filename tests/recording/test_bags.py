"""Bags of ROS 1 and ROS 2 give back the motion that was written into them."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from typer.testing import CliRunner

from armguard.cli.app import app
from armguard.errors import TrajectoryError
from armguard.recording.motions import load_motion, motion_notes
from armguard.scene import bay_scene
from armguard.scene.bay import bay_path

ONE = get_typestore(Stores.ROS1_NOETIC)
TWO = get_typestore(Stores.ROS2_HUMBLE)

# Header stamps begin here, receipts a little later [ns].
START = 1_700_000_000_000_000_000
LATE = 700_000
STEP = 4_000_000

# Feedback of ros2_control, cut to what is read of it.
CONTROLLER_STATE = """std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
"""

NAMES = tuple(f"joint{k}" for k in range(1, 8))


@pytest.fixture(scope="module")
def bay():
    """Two arms with seven joints each, all named alike."""
    return bay_scene()


class Bag:
    """A bag of either kind that is being written."""

    def __init__(self, path: Path, kind: str) -> None:
        self.kind, self.path = kind, path
        self.types = ONE if kind == "ros1" else TWO
        if kind == "ros1":
            self.writer = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer2(path, version=9, storage_plugin=plugin)
        self.writer.open()
        self.connections = {}

    def close(self) -> Path:
        self.writer.close()
        return self.path

    def stamp(self, time: int):
        return self.types.types["builtin_interfaces/msg/Time"](
            sec=time // 10**9, nanosec=time % 10**9
        )

    def header(self, time: int):
        more = {"seq": 0} if self.kind == "ros1" else {}
        make = self.types.types["std_msgs/msg/Header"]
        return make(stamp=self.stamp(time), frame_id="", **more)

    def write(self, topic: str, message, received: int) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(
                topic, kind, typestore=self.types
            )
        if self.kind == "ros1":
            raw = self.types.serialize_ros1(message, kind)
        else:
            raw = self.types.serialize_cdr(message, kind)
        self.writer.write(self.connections[topic], received, raw)

    def joints(self, topic, names, q, time, late=LATE) -> None:
        """A JointState that was stamped at a time and received later."""
        none = np.zeros(0)
        message = self.types.types["sensor_msgs/msg/JointState"](
            header=self.header(time),
            name=list(names),
            position=np.ascontiguousarray(q, dtype=float),
            velocity=none,
            effort=none,
        )
        self.write(topic, message, time + late)


def bag(tmp_path: Path, kind: str = "mcap") -> Bag:
    return Bag(tmp_path / ("motion.bag" if kind == "ros1" else "motion"), kind)


def motion(count: int, joints: int, seed: int = 0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, size=(count, joints))


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_one_topic_gives_back_its_bits(tmp_path, bay, kind):
    q = motion(50, 14)
    written = bag(tmp_path, kind)
    shuffled = [n.replace("/", "_") for n in reversed(bay.q_names)]
    for k, row in enumerate(q):
        written.joints("/joint_states", shuffled, row[::-1], START + k * STEP)
    path = written.close()
    files = [path] if kind == "ros1" else [path, next(path.glob("motion*.*"))]
    for file in files:
        read = load_motion(file)
        assert read.for_scene(bay).tobytes() == q.tobytes()
        assert np.allclose(read.stamps, np.arange(50) * STEP * 1e-9, atol=1e-9)
        assert read.notes == ()


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_two_arms_are_put_on_one_clock_and_their_skew_is_reported(tmp_path, bay, kind):
    left, right = motion(40, 7, 1), motion(20, 7, 2)
    written = bag(tmp_path, kind)
    for k in range(40):
        written.joints("/left/joint_states", NAMES, left[k], START + k * STEP)
        if k % 2 == 0:
            late = START + k * STEP + STEP // 4
            written.joints("/right/joint_states", NAMES, right[k // 2], late)
    path = written.close()
    with pytest.raises(TrajectoryError) as caught:
        load_motion(path)
    assert "several topics" in str(caught.value)
    assert "--topic /right/joint_states" in str(caught.value)
    read = load_motion(path, ["/left/joint_states", "/right/joint_states"])
    q = read.for_scene(bay)
    begin, end = START + STEP // 4, START + 38 * STEP + STEP // 4
    stamps = sorted(
        t
        for t in [
            *(START + k * STEP for k in range(40)),
            *(START + k * STEP + STEP // 4 for k in range(0, 40, 2)),
        ]
        if begin <= t <= end
    )
    assert len(q) == len(stamps)
    for row, t in zip(q, stamps, strict=True):
        assert (row[:7] == left[(t - START) // STEP]).all()
        assert (row[7:] == right[(t - START - STEP // 4) // (2 * STEP)]).all()
    (left_note, right_note) = [n for n in read.notes if "newest sample" in n]
    assert "left/joint1" in left_note
    assert "at most 1.0 ms" in left_note
    assert "at most 7.0 ms" in right_note
    other = ["right=/left/joint_states", "left=/right/joint_states"]
    swapped = load_motion(path, other).for_scene(bay)
    assert (swapped[:, 7:] == q[:, :7]).all()


def test_nodes_that_share_a_topic_are_streams_of_their_own(tmp_path, bay):
    q = motion(30, 14)
    written = bag(tmp_path)
    names = [n.replace("/", "_") for n in bay.q_names]
    for k, row in enumerate(q):
        time = START + k * STEP
        written.joints("/joint_states", names[:7], row[:7], time)
        written.joints("/joint_states", names[7:], row[7:], time)
        written.joints("/joint_states", ["lid_hinge"], [0.0], time)
    read = load_motion(written.close())
    assert read.for_scene(bay).tobytes() == q.tobytes()
    assert any("lid_hinge" in note for note in motion_notes(read, bay))


def test_a_misspelt_joint_is_asked_about_and_not_left_out(tmp_path, bay):
    written = bag(tmp_path)
    names = [n.replace("left/joint3", "left/jiont3") for n in bay.q_names]
    written.joints("/joint_states", names, np.zeros(14), START)
    read = load_motion(written.close())
    fill = dict.fromkeys(bay.q_names, 0.0)
    with pytest.raises(TrajectoryError, match="did you mean 'left/joint3'"):
        read.for_scene(bay, fill)


def test_what_overtook_or_came_twice_is_left_out_and_reported(tmp_path, bay):
    q = motion(6, 14)
    times = [0, 1, 3, 2, 3, 4]
    written = bag(tmp_path)
    for k, row in enumerate(q):
        received = START + k * STEP + 10 * STEP
        time = START + times[k] * STEP
        written.joints("/joint_states", bay.q_names, row, time, received - time)
    read = load_motion(written.close())
    assert (read.for_scene(bay) == q[[0, 1, 2, 5]]).all()
    notes = " ".join(read.notes)
    assert "1 messages were overtaken by newer ones, by up to 4.0 ms" in notes
    assert "1 messages have the stamp of the one before" in notes


def test_time_that_goes_back_is_refused_with_its_place(tmp_path, bay):
    written = bag(tmp_path)
    for k in range(4):
        time = START + (k - 2 * (k > 1)) * 10**9
        written.joints("/joint_states", bay.q_names, np.zeros(14), time, k * 10**10)
    with pytest.raises(TrajectoryError) as caught:
        load_motion(written.close())
    assert "stamp of message 3 is 1.000 s older" in str(caught.value)


def test_headers_without_a_stamp_are_reported(tmp_path, bay):
    written = bag(tmp_path)
    for k in range(3):
        written.joints("/joint_states", bay.q_names, np.zeros(14), 0, START + k * STEP)
    read = load_motion(written.close())
    assert np.allclose(np.diff(read.stamps), STEP * 1e-9)
    assert "headers have no stamp" in read.notes[0]


def test_topics_that_are_not_there_or_hold_no_joints_are_named(tmp_path):
    written = bag(tmp_path)
    text = TWO.types["std_msgs/msg/String"](data="hello")
    written.write("/chatter", text, START)
    path = written.close()
    with pytest.raises(TrajectoryError, match=r"there is /chatter \(std_msgs"):
        load_motion(path)
    written = Bag(tmp_path / "second", "mcap")
    written.write("/chatter", text, START)
    written.joints("/joint_states", NAMES, np.zeros(7), START)
    path = written.close()
    with pytest.raises(TrajectoryError, match="did you mean '/joint_states'"):
        load_motion(path, ["/joint_state"])
    with pytest.raises(TrajectoryError, match="has no joint positions"):
        load_motion(path, ["/chatter"])


def test_a_message_with_other_positions_than_names_is_named(tmp_path):
    written = bag(tmp_path)
    written.joints("/joint_states", NAMES, np.zeros(7), START)
    written.joints("/joint_states", NAMES, np.zeros(6), START + STEP)
    with pytest.raises(TrajectoryError, match="message 2: 6 positions for 7 joints"):
        load_motion(written.close())


def point(types, positions, since=0):
    """A waypoint some time after its trajectory's start [ns]."""
    none = np.zeros(0)
    return types.types["trajectory_msgs/msg/JointTrajectoryPoint"](
        positions=np.asarray(positions, dtype=float),
        velocities=none,
        accelerations=none,
        effort=none,
        time_from_start=types.types["builtin_interfaces/msg/Duration"](
            sec=since // 10**9, nanosec=since % 10**9
        ),
    )


def test_a_plan_ends_where_the_next_one_begins(tmp_path, bay):
    q = motion(8, 14)
    written = bag(tmp_path)
    for first, begin in ((0, 0), (4, 2)):
        message = TWO.types["trajectory_msgs/msg/JointTrajectory"](
            header=written.header(START + begin * STEP),
            joint_names=list(bay.q_names),
            points=[point(TWO, q[first + k], k * STEP) for k in range(4)],
        )
        written.write("/plan", message, START)
    read = load_motion(written.close())
    assert (read.for_scene(bay) == q[[0, 1, 4, 5, 6, 7]]).all()
    assert np.allclose(read.stamps, np.arange(6) * STEP * 1e-9)


def test_a_controllers_feedback_is_what_was_measured(tmp_path, bay):
    types = get_typestore(Stores.ROS2_HUMBLE)
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    types.register(get_types_from_msg(CONTROLLER_STATE, kind))
    q = motion(5, 14)
    written = bag(tmp_path)
    written.types = types
    for k, row in enumerate(q):
        message = types.types[kind](
            header=written.header(START + k * STEP),
            joint_names=list(bay.q_names),
            reference=point(types, row + 1.0),
            feedback=point(types, row),
        )
        written.write("/controller/state", message, START + k * STEP)
    assert load_motion(written.close()).for_scene(bay).tobytes() == q.tobytes()


def test_what_is_no_bag_is_said_in_words(tmp_path):
    for name in ("a.bag", "a.mcap", "a.db3"):
        path = tmp_path / name
        path.write_bytes(b"nothing of the kind" * 10)
        with pytest.raises(TrajectoryError, match="cannot be read as a bag"):
            load_motion(path)
    with pytest.raises(TrajectoryError, match=r"folder without metadata\.yaml"):
        load_motion(tmp_path)
    with pytest.raises(TrajectoryError, match="no such file"):
        load_motion(tmp_path / "none.bag")
    (tmp_path / "a.csv").write_text("a\n1\n")
    with pytest.raises(TrajectoryError, match="has no topics"):
        load_motion(tmp_path / "a.csv", ["/joint_states"])


@pytest.mark.parametrize("kind", ["ros1", "sqlite3"])
def test_a_bag_that_was_cut_off_is_an_error_in_words(tmp_path, bay, kind):
    written = bag(tmp_path, kind)
    for k in range(50):
        written.joints("/joint_states", bay.q_names, np.zeros(14), START + k * STEP)
    path = written.close()
    file = path if kind == "ros1" else next(path.glob("motion*.*"))
    whole = file.read_bytes()
    for share in (0.02, 0.3, 0.6, 0.95):
        file.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(TrajectoryError, match="cannot be read as a bag"):
            load_motion(file)


def test_what_a_killed_recorder_wrote_is_read_up_to_the_cut(tmp_path, bay):
    q = motion(20_000, 14)
    written = bag(tmp_path, "mcap")
    for k, row in enumerate(q):
        written.joints("/joint_states", bay.q_names, row, START + k * STEP)
    folder = written.close()
    file = next(folder.glob("motion*.mcap"))
    whole = file.read_bytes()
    (folder / "metadata.yaml").unlink()
    counts = []
    for share in (0.5, 0.8, 0.999):
        file.write_bytes(whole[: int(len(whole) * share)])
        read = load_motion(folder)
        found = read.for_scene(bay)
        assert found.tobytes() == q[: len(found)].tobytes()
        assert "has no end" in " ".join(read.notes)
        assert "metadata.yaml" in read.notes[0]
        counts.append(len(found))
    assert 0 < counts[0] <= counts[1] < counts[2]
    file.write_bytes(whole[:4000])
    with pytest.raises(TrajectoryError, match="cannot be read as a bag"):
        load_motion(folder)


@pytest.mark.parametrize(
    ("profile", "encoding"), [("", "jsonschema"), ("ros1", "ros1msg")]
)
def test_an_mcap_file_that_ros_2_did_not_write_is_named(tmp_path, profile, encoding):
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=profile)
        schema = writer.register_schema("sensor_msgs/JointState", encoding, b"{}")
        channel = writer.register_channel("/joint_states", "json", schema)
        writer.add_message(channel, START, b"{}", START)
        writer.finish()
    with pytest.raises(TrajectoryError, match="not written by ROS 2"):
        load_motion(path)


def test_run_judges_a_bag(tmp_path, bay):
    written = bag(tmp_path)
    for k in range(5):
        written.joints("/joint_states", bay.q_names, bay.home, START + k * STEP)
    path = written.close()
    arguments = ["run", str(bay_path()), "--trajectory", str(path), "--json"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["cycles"] == 5
    result = CliRunner().invoke(app, [*arguments, "--topic", "/joint_states"])
    assert result.exit_code == 0, result.output
