"""Bags, clouds and images are frames of sensors: what was written comes back."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.errors import RecordingError, SceneError
from armguard.recording.sensor_files import sensor_source
from armguard.sense.clouds import read_clouds, unpacked_lzf
from armguard.sense.frames_file import DEPTH, JOINTS, POINTS, POSE, RANGE
from one_sensor import one_sensor

DATA = Path(__file__).parents[1] / "data" / "sensing"
START = 1_700_000_000_000_000_000
TYPES = {"ros1": Stores.ROS1_NOETIC, "ros2": Stores.ROS2_HUMBLE}
RNG = np.random.default_rng(8)


class Bag:
    """A bag that is being written."""

    def __init__(self, path, kind):
        self.types, self.kind = get_typestore(TYPES[kind]), kind
        one = kind == "ros1"
        self.writer = Writer1(path) if one else Writer2(path, version=9)
        self.writer.open()
        self.connections, self.path = {}, path

    def make(self, kind, **values):
        return self.types.types[kind](**values)

    def header(self, seconds, frame):
        time = START + round(seconds * 1e9)
        stamp = self.make(
            "builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9
        )
        more = {"seq": 0} if self.kind == "ros1" else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **more)

    def add(self, topic, kind, seconds, frame="", **values):
        kind = f"sensor_msgs/msg/{kind}"
        message = self.make(kind, header=self.header(seconds, frame), **values)
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(
                topic, kind, typestore=self.types
            )
        write = "serialize_ros1" if self.kind == "ros1" else "serialize_cdr"
        raw = getattr(self.types, write)(message, kind)
        time = START + round(seconds * 1e9) + 1000
        self.writer.write(self.connections[topic], time, raw)

    def cloud(self, topic, seconds, xyz, frame=""):
        """Points between other fields, in rows with gaps."""
        rows, columns = xyz.shape[:2]
        data = np.zeros((rows, columns * 20 + 12), dtype=np.uint8)
        inner = np.zeros((rows, columns, 20), dtype=np.uint8)
        inner[..., 4:16] = xyz.astype("<f4").view(np.uint8).reshape(rows, columns, 12)
        data[:, : columns * 20] = inner.reshape(rows, -1)
        fields = [
            self.make(
                "sensor_msgs/msg/PointField", name=n, offset=at, datatype=7, count=1
            )
            for n, at in (("i", 0), ("x", 4), ("y", 8), ("z", 12))
        ]
        self.add(
            topic, "PointCloud2", seconds, frame, height=rows, width=columns,
            fields=fields, is_bigendian=False, point_step=20, row_step=data.shape[1],
            data=data.ravel(), is_dense=False,
        )  # fmt: skip

    def joints(self, seconds, names, positions):
        none = np.zeros(0)
        self.add(
            "/joint_states", "JointState", seconds, name=names,
            position=np.array(positions, dtype=float), velocity=none, effort=none,
        )  # fmt: skip


@pytest.fixture(params=["ros1", "ros2"])
def bag(request, tmp_path):
    name = "a.bag" if request.param == "ros1" else "a"
    return Bag(tmp_path / name, request.param)


def played(path, scene, topics=()):
    source = sensor_source(path, scene, topics)
    return list(source.events), source.notes


def rig():
    """A scene with a sensor of each form."""
    scene = one_sensor("points")
    scene.add_sensor("eye2", kind="depth", size=(8, 6), focal=5)
    scene.add_sensor("sonar", kind="range")
    return scene


def test_a_bag_has_joints_clouds_scans_distances_and_images(bag):
    scene = rig()
    cloud = RNG.uniform(-1, 1, (3, 5, 3)).astype(np.float32)
    depth = RNG.integers(300, 3000, (6, 8)).astype(np.uint16)
    bag.joints(0.0, ["other", "joint"], [9.0, 0.004])
    bag.cloud("/cloud", 0.1, cloud)
    bag.add(
        "/range", "Range", 0.2, radiation_type=0, field_of_view=0.2, min_range=0.1,
        max_range=2.0, range=np.inf,
    )  # fmt: skip
    bag.add(
        "/image", "Image", 0.3, height=6, width=8, encoding="16UC1",
        is_bigendian=0, step=16, data=depth.view(np.uint8).ravel(),
    )  # fmt: skip
    bag.joints(0.4, ["joint"], [0.006])
    bag.writer.close()
    events, notes = played(bag.path, scene)
    assert [(e.event, e.name) for e in events] == [
        (JOINTS, ""), (POINTS, "eye"), (RANGE, "sonar"), (DEPTH, "eye2"), (JOINTS, ""),
    ]  # fmt: skip
    assert [e.stamp for e in events] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert [events[k].arrays[0].tolist() for k in (0, 4)] == [[0.004], [0.006]]
    np.testing.assert_array_equal(events[1].arrays[0], cloud)
    assert events[2].arrays[0] == np.inf
    np.testing.assert_array_equal(events[3].arrays[0], depth)
    assert notes == []


def test_a_scan_has_points_and_a_ray_that_meets_nothing_is_beyond(bag):
    scene = one_sensor("points", range=(0.1, 4.0))
    bag.add(
        "/scan", "LaserScan", 0.0, angle_min=-1.0, angle_max=1.0, angle_increment=0.5,
        time_increment=0.0, scan_time=0.1, range_min=0.2, range_max=5.0,
        ranges=np.array([1.0, 0.1, np.nan, np.inf, 2.0], dtype=np.float32),
        intensities=np.zeros(0, dtype=np.float32),
    )  # fmt: skip
    bag.writer.close()
    (*_, event), _ = played(bag.path, scene)
    angles = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    found = event.arrays[0]
    way = np.linalg.norm(found, axis=1)
    np.testing.assert_allclose(way, [1.0, np.nan, np.nan, 8.0, 2.0])
    at = np.arctan2(found[:, 1], found[:, 0])
    np.testing.assert_allclose(at[[0, 3, 4]], angles[[0, 3, 4]])


def test_topics_go_to_sensors_by_frame_by_name_or_not_at_all(bag):
    scene = one_sensor("points")
    scene.add_sensor("second", kind="points")
    cloud = RNG.uniform(0.2, 1, (1, 4, 3))
    for k, (topic, frame) in enumerate(
        [("/a", "second"), ("/b", ""), ("/c", "elsewhere")]
    ):
        bag.cloud(topic, 0.1 * k, cloud, frame)
    bag.writer.close()
    events, notes = played(bag.path, scene, ["eye=/b"])
    assert [e.name for e in events if e.event == POINTS] == ["second", "eye"]
    assert len(notes) == 1
    assert "/c (sensor_msgs/msg/PointCloud2) is left out" in notes[0]
    with pytest.raises(SceneError, match="it must be SENSOR=/topic"):
        sensor_source(bag.path, scene, ["ear=/b"])


def test_a_damaged_message_is_left_out_and_noted(bag):
    scene = one_sensor("points")
    fields = [
        bag.make("sensor_msgs/msg/PointField", name="x", offset=0, datatype=7, count=1)
    ]
    bag.add(
        "/cloud", "PointCloud2", 0.0, height=4, width=9, fields=fields,
        is_bigendian=False, point_step=12, row_step=108, is_dense=True,
        data=np.zeros(50, dtype=np.uint8),
    )  # fmt: skip
    bag.writer.close()
    events, notes = played(bag.path, scene)
    assert events == []
    assert "a message at 0.000 s is no such frame" in notes[0]


def pcd(path, xyz, form, viewpoint="0 0 0 1 0 0 0"):
    """A PCD file with a label before the points, and a colour behind them."""
    rows, columns = xyz.shape[:2]
    flat = xyz.reshape(-1, 3).astype("<f4")
    label = np.arange(len(flat), dtype="<u2")
    header = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS label x y z rgb\nSIZE 2 4 4 4 4\n"
        f"TYPE U F F F U\nCOUNT 1 1 1 1 2\nWIDTH {columns}\nHEIGHT {rows}\n"
        f"VIEWPOINT {viewpoint}\nPOINTS {len(flat)}\nDATA {form}\n"
    )
    colour = np.zeros((len(flat), 2), dtype="<u4")
    if form == "ascii":
        lines = [
            f"{a} {x:.9g} {y:.9g} {z:.9g} 7 7"
            for a, (x, y, z) in zip(label, flat, strict=True)
        ]
        data = "\n".join(lines).encode()
    elif form == "binary":
        parts = [("l", "<u2"), ("p", "<f4", 3), ("c", "<u4", 2)]
        table = np.zeros(len(flat), dtype=parts)
        table["l"], table["p"], table["c"] = label, flat, colour
        data = table.tobytes()
    else:
        plain = label.tobytes() + flat.T.tobytes() + colour.tobytes()
        packed = b"".join(
            bytes([len(part) - 1]) + part
            for part in (plain[k : k + 32] for k in range(0, len(plain), 32))
        )
        data = np.array([len(packed), len(plain)], dtype="<u4").tobytes() + packed
    path.write_bytes(header.encode() + data)


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_file_gives_back_its_points_and_its_viewpoint(tmp_path, form):
    xyz = RNG.uniform(-2, 2, (4, 6, 3)).astype(np.float32)
    half_turn = np.diag([1, -1, -1])
    path = tmp_path / "a.pcd"
    pcd(path, xyz, form, "1 2 3 0 1 0 0")
    (cloud,) = read_clouds(path)
    np.testing.assert_allclose(cloud.xyz, xyz, rtol=1e-7 * (form == "ascii"))
    assert cloud.pose.xyz == (1, 2, 3)
    np.testing.assert_allclose(cloud.pose.matrix()[:3, :3], half_turn, atol=1e-9)
    pcd(path, xyz, form)
    assert read_clouds(path)[0].pose is None


def test_lzf_copies_what_is_before_also_into_itself():
    # "abc" as it is; 9 bytes from 3 before; a long copy of 1 before.
    packed = bytes([2]) + b"abc" + bytes([7 << 5, 0, 2]) + bytes([7 << 5, 20, 0])
    plain = b"abc" * 4 + b"c" * 29
    assert unpacked_lzf(packed, len(plain)) == plain
    short = packed
    # A copy of 4 bytes from 600 before.
    start = RNG.bytes(640)
    parts = [bytes([31]) + start[k : k + 32] for k in range(0, 640, 32)]
    packed = b"".join(parts) + bytes([2 << 5 | 599 >> 8, 599 & 255])
    assert unpacked_lzf(packed, 644) == start + start[40:44]
    for damaged, size in ((short, 3), (bytes([7 << 5, 0, 9]), 9)):
        with pytest.raises(ValueError, match=r"refer|bytes"):
            unpacked_lzf(damaged, size)


@pytest.mark.parametrize("kind", ["ply", "pcd", "graph"])
@pytest.mark.parametrize("data", [b"", b"x" * 300, b"WIDTH 3\nDATA binary\n", b"ply\n"])
def test_a_damaged_cloud_is_refused_with_a_sentence(tmp_path, kind, data):
    path = tmp_path / f"a.{kind}"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="is no cloud of points"):
        read_clouds(path)
    with pytest.raises(RecordingError, match="cannot be read"):
        read_clouds(tmp_path / f"none.{kind}")


def test_a_folder_of_clouds_is_played_with_the_poses_beside_them(tmp_path):
    xyz = RNG.uniform(-0.1, 0.1, (20, 3)) + np.array([0, 0, 0.5])
    T = ag.Pose(xyz=(0.2, 0.1, 0), rpy=(0, 1, 0)).matrix()
    for k in range(3):
        trimesh.PointCloud(xyz + 0.01 * k).export(tmp_path / f"f{k}.ply")
    np.savetxt(tmp_path / "f1.pose.txt", T)
    scene = one_sensor("points")
    events, _ = played(tmp_path, scene)
    kinds = [e.event for e in events if e.event != JOINTS]
    assert kinds == [POINTS, POSE, POINTS, POINTS]
    np.testing.assert_allclose(next(e for e in events if e.event == POSE).arrays[0], T)
    sense = ag.Sense(scene)
    assert sense.play(events) == len(events)
    assert sense.intakes == {ag.Intake.TAKEN: len(events)}
    cells = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    expected = (xyz + 0.02) @ T[:3, :3].T + T[:3, 3]
    low = sense.cells.centre - 0.5 * 64 * 0.02
    own = {tuple(p) for p in np.floor((expected - low) / 0.02).astype(int)}
    found = {tuple(p) for p in np.floor((cells - low) / 0.02).astype(int)}
    assert own <= found


def test_a_folder_of_depth_images_is_played(tmp_path):
    scene = one_sensor("depth", size=(8, 6), focal=8, range=(0.1, 2.0))
    depth = np.full((6, 8), 800, dtype=np.uint16)
    depth[0, 0] = 65535
    for k in range(2):
        Image.fromarray(depth + np.uint16(k)).save(tmp_path / f"frame-{k}.depth.png")
    np.savetxt(tmp_path / "frame-1.pose.txt", np.eye(4))
    events, _ = played(tmp_path, scene)
    frames = [e for e in events if e.event == DEPTH]
    assert [e.stamp for e in frames] == pytest.approx([0.0, 1 / 30])
    assert frames[0].arrays[0][0].tolist() == [0, *[800] * 7]
    assert [e.event for e in events].count(POSE) == 1
    (tmp_path / "frame-1.pose.txt").write_text("1 2 3")
    with pytest.raises(RecordingError, match="is no pose"):
        played(tmp_path, scene)


def test_files_without_a_sensor_or_frames_are_refused(tmp_path):
    path = tmp_path / "a.pcd"
    pcd(path, np.zeros((1, 2, 3)), "ascii")
    with pytest.raises(RecordingError, match="of kind points or depth"):
        played(path, one_sensor("range"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="has no frames"):
        played(tmp_path / "empty", one_sensor("points"))
    with pytest.raises(RecordingError, match="there is no such file"):
        sensor_source(tmp_path / "none", one_sensor("points"))


def test_the_scan_of_octomap_is_a_frame_with_its_pose():
    (cloud,) = read_clouds(DATA / "spherical_scan.graph")
    assert cloud.xyz.shape == (1, 10201, 3)
    assert cloud.pose.xyz == (1, 0, -0.5)
    # It is the inside of a ball, from its middle.
    np.testing.assert_allclose(np.linalg.norm(cloud.xyz, axis=2), 4.01, atol=1e-3)


SCENE = """
cycle: {period: 0.01}
robots: {arm: {urdf: panda}}
sensing:
  {region: {centre: [0.4, 0, 0.4]}, cell: 0.02, unknown: still,
   intruder: {speed: 1.6, size: 0.05}}
sensors:
  top: {kind: depth, size: [640, 480], focal: 525, range: [0.3, 3],
        at: {xyz: [0.115, 0.427, 0.570], rpy: [-1.92, 0.19, 2.22]}}
"""


def answered(tmp_path, text, *plays, code=0):
    scene = tmp_path / "cell.yaml"
    scene.write_text(text, encoding="utf-8")
    options = [part for play in plays for part in ("--play", str(play))]
    result = CliRunner().invoke(app, ["sense", str(scene), *options, "--json"])
    assert result.exit_code == code, result.output
    return json.loads(result.stdout)


def test_the_command_plays_the_bag_of_moveit(tmp_path):
    answer = answered(tmp_path, SCENE, DATA / "perception_tutorial.bag")
    assert answer["sensors"]["top"] == {
        "state": "in order", "frames": 1, "faults": []
    }  # fmt: skip
    assert answer["occupied"] > 1000
    assert answer["known_free"] > 10_000


def test_the_command_begins_with_a_tree_of_octomap(tmp_path):
    text = SCENE.replace("size: 0.05", "size: 0.1").replace("cell: 0.02", "cell: 0.04")
    answer = answered(tmp_path, text, DATA / "geb079.bt")
    assert answer["events"] == 0
    assert answer["known_free"] > 1000


TABLES = sorted((Path(__file__).parents[1] / "data" / "tables").glob("*.pcd"))


def test_table_tops_are_mapped_where_their_files_are_present(tmp_path):
    if not TABLES:
        pytest.skip("tests/data/tables has no clouds of PointCloudLibrary/data")
    for path in TABLES:
        (cloud,) = read_clouds(path)
        assert cloud.xyz.shape == (480, 640, 3)
        answer = answered(tmp_path, SCENE, path)
        assert answer["occupied"] > 500
