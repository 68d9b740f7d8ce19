"""Pose and delay of a sensor: found in a corner of three walls, refused before one."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.errors import SceneError
from armguard.scene.sensor_edit import with_sensor
from armguard.sense import calibration
from armguard.sense.calibration import Track, calibrated
from armguard.sense.frames_file import DEPTH, JOINTS, Event, write_event
from armguard.sense.postures import calibration_postures
from one_sensor import slide
from sliding import EXACT

# Walls at x, y or z = -1, as boxes with a face there.
WALLS = {"x": (-1.5, 0, 0), "y": (0, -1.5, 0), "z": (0, 0, -1.5)}
TRAVEL, DELAY = 3.0, 0.03


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Few frames make tests fast."""
    monkeypatch.setattr(calibration, "MOST", 60)


def corner(walls="xyz", kind="depth"):
    """A camera on a slide along x that looks into a corner."""
    scene = ag.Scene(mode="path", period=0.01)
    scene.add_robot(slide(TRAVEL), "arm", base=ag.Pose(), stopping=EXACT)
    for name in walls:
        size = [20.0, 20.0, 20.0]
        size["xyz".index(name)] = 1.0
        scene.add(ag.Box(size=size), name, pose=ag.Pose(xyz=WALLS[name]))
    shape = {"size": (16, 12), "focal": 10} if kind == "depth" else {}
    scene.add_sensor(
        "eye", kind=kind, on="arm/tip", range=(0.2, 8.0), delay=DELAY, jitter=0.0,
        pose=ag.Pose(xyz=(0.1, 0.05, 0.2), rpy=(0.2, 2.186, -2.356)), **shape,
    )  # fmt: skip
    return scene


def off(seed, way=0.03, turn=0.0873):
    """A frame that is shifted and turned."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 3))
    T = np.eye(4)
    T[:3, :3] = calibration.rotation(turn * b / np.linalg.norm(b))
    T[:3, 3] = way * a / np.linalg.norm(a)
    return T


def frames(scene, X, late=0.0, noise=0.003, walls="xyz"):
    """Depths of the camera where it is in truth, of planes by their equations."""
    rng = np.random.default_rng(3)
    eye = scene.sensors["eye"]
    x = (np.arange(16) - eye.middle[0]) / eye.focal[0]
    y = (np.arange(12) - eye.middle[1]) / eye.focal[1]
    rays = np.stack([*np.meshgrid(x, y), np.ones((12, 16))], axis=2)
    T = eye.pose.matrix() @ X
    ways = rays @ T[:3, :3].T
    for k in range(1200):
        t = 0.01 * k
        # To and fro: in a steady motion a delay would be a shift.
        slid = 0.5 * TRAVEL * (1.0 - np.cos(t))
        yield Event(JOINTS, "", t, [np.array([slid])])
        if k % 3:
            continue
        at = T[:3, 3] + (slid, 0, 0)
        depths = [
            (-1.0 - at["xyz".index(w)]) / ways[..., "xyz".index(w)] for w in walls
        ]
        depth = np.min([np.where(d > 0, d, np.inf) for d in depths], axis=0)
        depth = depth + noise * rng.standard_normal(depth.shape)
        depth = np.where(rng.random(depth.shape) < 0.05, 1.0, depth)
        yield Event(DEPTH, "eye", t + DELAY + late, [depth])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_pose_and_delay_are_found_from_30_mm_and_5_degrees_off(seed):
    scene, X = corner(), off(seed)
    found = calibrated(scene, "eye", frames(scene, X, late=0.02))
    left = np.linalg.inv(found.pose.matrix()) @ scene.sensors["eye"].pose.matrix() @ X
    angle = np.arccos(min(0.5 * (np.trace(left[:3, :3]) - 1.0), 1.0))
    assert np.linalg.norm(left[:3, 3]) < 0.003
    assert np.degrees(angle) < 0.5
    assert found.shift == pytest.approx(0.03, abs=0.003)
    assert np.degrees(found.turn) == pytest.approx(5, abs=0.5)
    assert found.delay == pytest.approx(DELAY + 0.02, abs=0.005)
    assert (3 * found.sigma[:3] < 0.003).all()


@pytest.mark.parametrize("walls", ["z", "yz"])
def test_walls_that_do_not_determine_the_pose_are_refused(walls):
    scene = corner(walls)
    with pytest.raises(SceneError, match="do not determine the pose: it may be"):
        calibrated(scene, "eye", frames(scene, off(0), walls=walls))


def test_too_few_postures_or_surfaces_are_refused():
    scene = corner()
    events = list(frames(scene, off(0)))
    with pytest.raises(SceneError, match=r"are of 1\d postures; 24 are needed"):
        calibrated(scene, "eye", events[: len(events) // 8])
    with pytest.raises(SceneError, match="too few distances are of known surfaces"):
        calibrated(corner(""), "eye", events)
    with pytest.raises(SceneError, match="no sensor is named 'ear'; there are eye"):
        Track(scene, "ear", events)
    with pytest.raises(SceneError, match="measures one distance"):
        Track(corner(kind="range"), "eye", events)


def test_the_guard_allows_the_way_to_each_posture():
    scene = ag.bay_scene("path")
    scene.add_sensor(
        "ring", kind="vl53l8cx", on="left/link5",
        ring={"count": 2, "radius": 0.12, "height": 0.06},
    )  # fmt: skip
    rows = calibration_postures(scene, "ring")
    assert rows.shape == (25, 14)
    assert np.array_equal(rows[0], scene.home)
    assert ag.Guard(scene, self_test=False).check_path(rows).clear
    moved = np.abs(rows - scene.home).max(axis=0) > 0.1
    assert [
        n.split("/")[0] for n, m in zip(scene.q_names, moved, strict=True) if m
    ] == ["left"] * 7
    apart = np.abs(rows[1:, None] - rows[None, 1:]).max(axis=2)
    assert (apart[~np.eye(24, dtype=bool)] > calibration.APART).all()


FILE = """# A cell.
mode: path
robots: {arm: {urdf: panda}}
sensors:
  ring:   # on the forearm
    kind: vl53l8cx
    on: arm/panda_link5
    at:
      xyz: [0, 0, 0.1]
      rpy: [0, 0, 1]
    ring: {count: 4, radius: 0.08}
  top: {kind: depth, focal: 300, delay: 0.04, at: {xyz: [0.4, 0, 1.5]}}   # above
"""


def test_an_edit_changes_pose_and_delay_of_one_sensor_and_no_other_letter():
    pose = ag.Pose(xyz=(0.41234, 0.0001, 1.5), rpy=(3.1, 0, -0.25))
    text = with_sensor(FILE, "top", pose, 0.05123)
    place = "at: {xyz: [0.4123, 0.0001, 1.5], rpy: [3.1, 0, -0.25]}"
    line = f"  top: {{kind: depth, focal: 300, delay: 0.0512, {place}}}   # above\n"
    assert text == FILE[: FILE.index("  top:")] + line
    ring = with_sensor(FILE, "ring", pose, None)
    assert ring.count("\n") < FILE.count("\n")
    assert (
        "    at: {xyz: [0.4123, 0.0001, 1.5], rpy: [3.1, 0, -0.25]}\n    ring:" in ring
    )
    for name in ("none", "arm"):
        with pytest.raises(SceneError, match=f"no sensor '{name}' to edit"):
            with_sensor(FILE, name, pose, None)


CELL = """
mode: path
robots:
  arm: {urdf: URDF, stopping: {velocity: 2, acceleration: 1, deceleration: 10}}
"""


def test_the_command_writes_postures_and_the_difference(tmp_path):
    urdf, scene = tmp_path / "slide.urdf", tmp_path / "cell.yaml"
    urdf.write_text(
        '<robot name="s"><link name="base"/><link name="tip"><collision><geometry>'
        '<sphere radius="0.02"/></geometry></collision></link><joint name="joint" '
        'type="prismatic"><parent link="base"/><child link="tip"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="3" velocity="1" effort="9"/></joint></robot>'
    )
    boxes = "".join(
        f"  {w}: {{box: {[1.0 if w == v else 20.0 for v in 'xyz']}, "
        f"at: {{xyz: {list(WALLS[w])}}}}}\n"
        for w in "xyz"
    )
    sensor = (
        "  eye: {kind: depth, size: [16, 12], focal: 10, on: arm/tip, delay: 0.03,\n"
        "        range: [0.2, 8], jitter: 0, at: {xyz: [0.1, 0.05, 0.2], "
        "rpy: [0.2, 2.186, -2.356]}}\n"
    )
    text = (
        CELL.replace("URDF", urdf.name) + "objects:\n" + boxes + "sensors:\n" + sensor
    )
    scene.write_text(text, encoding="utf-8")
    loaded, X = ag.load_scene(scene), off(4)
    command = ["sense", "calibrate", str(scene), "--sensor", "eye"]
    plan, play = tmp_path / "postures.csv", tmp_path / "frames.bin"
    result = CliRunner().invoke(app, [*command, "--plan", str(plan)])
    assert result.exit_code == 0, result.output
    assert np.loadtxt(plan, delimiter=",", skiprows=1).shape == (25,)
    with play.open("wb") as file:
        for event, name, stamp, arrays in frames(loaded, X, late=0.01):
            write_event(file, event, name, stamp, *arrays)
    result = CliRunner().invoke(
        app, [*command, "--play", str(play), "--write", "--json"]
    )
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["shift"] == pytest.approx(0.03, abs=0.003)
    corrected = ag.load_scene(scene).sensors["eye"]
    left = np.linalg.inv(corrected.pose.matrix()) @ loaded.sensors["eye"].pose.matrix()
    assert np.linalg.norm((left @ X)[:3, 3]) < 0.003
    assert corrected.delay == pytest.approx(0.04, abs=0.005)
    again = CliRunner().invoke(app, [*command, "--play", str(play)])
    assert "+++ cell.yaml" in again.stdout
    assert "from its declared pose" in again.stdout
    neither = CliRunner().invoke(app, command)
    assert "give --plan FILE for postures, or --play FILE" in str(neither.exception)
