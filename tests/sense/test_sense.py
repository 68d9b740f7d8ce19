"""Sensors fill the map: links stay out of it, foreign boxes come in and go."""

import numpy as np
import pytest

import armguard as ag
from armguard.cells.grid import unpacked
from armguard.errors import SceneError
from armguard.sense.prediction import mount_of
from armguard.simulation.sensed import drive, off_mounts, sensed_bay, swing
from armguard.simulation.sensors import Rig


def mapped(scene, seconds, way, late, speed=1.5):
    """Frames after which the map of a moving, unobstructed bay has occupied cells."""
    sense, rig = ag.Sense(scene), Rig(scene)
    rig.invalid = 0.25
    off_mounts(scene, rig, way)
    found, frames = [], []

    def each(t, name):
        frames.append(name)
        if sense.cells.claims.occupied.words.any():
            found.append((t, name))

    drive(sense, rig, swing(scene, speed), seconds, each=each, late=late)
    free = unpacked(~sense.cells.claims.unknown.words, 128)
    return found, len(frames), free


@pytest.mark.parametrize(("way", "late"), [(0.0, 0.0), (0.01, 0.005)])
def test_own_links_and_modelled_objects_are_not_mapped(way, late):
    found, frames, free = mapped(sensed_bay(error=0.01, jitter=0.005), 8.0, way, late)
    assert frames > 1100
    assert found == []
    assert free.sum() > 20_000


def test_a_sensor_further_off_than_declared_maps_them():
    found, _, _ = mapped(sensed_bay(error=0.01, jitter=0.005), 2.0, 0.15, 0.0)
    assert found


def place_before(scene, name, q, depth):
    """A point on the axis of a sensor."""
    sense = ag.Sense(scene)
    for stamp in (0.0, 0.1):
        sense.joints(q, stamp)
    placed = sense._world.at(sense._history, 0.05, 0.0)
    mount = mount_of(scene.sensors[name], sense._world, placed)
    return mount.origin + depth * mount.R[:, 2]


@pytest.mark.parametrize(
    ("name", "depth"),
    [("left_ring/0", 0.27), ("left_ring/1", 0.3), ("left_ring/2", 0.25), ("top", 1.1)],
)
def test_a_box_of_5_cm_is_mapped_by_its_first_frame_and_cleared_in_a_second(
    name, depth
):
    camera = name == "top"
    scene = sensed_bay(zones=not camera, camera=camera)
    sense, rig = ag.Sense(scene), Rig(scene, boxes=[(0.05, 0.05, 0.05)])
    rig.invalid = 0.1

    def motion(t):
        return scene.home + 0.05 * np.sin(t + np.arange(len(scene.home)))

    where = place_before(scene, name, scene.home, depth)
    counts = []

    def each(t, sender):
        counts.append((t, sender, int(sense.cells.occupied().sum())))

    drive(sense, rig, motion, 0.6, each=each)
    assert not any(count for _, _, count in counts)
    rig.place(0, ag.Pose(xyz=where.tolist(), rpy=(0.3, 0.2, 0.1)))
    counts.clear()
    drive(sense, rig, motion, 0.6, start=0.6, each=each)
    # The first of its frames may have been measured before.
    own = [count for _, sender, count in counts if sender == name]
    assert own[1] > 0
    cells = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    assert (np.linalg.norm(cells - where, axis=1) < 0.1).all()
    rig.place(0, None)
    counts.clear()
    drive(sense, rig, motion, 1.1, start=1.2, each=each)
    assert min(t for t, _, count in counts if not count) < 2.2


def test_a_frame_is_taken_where_its_sensor_was_at_its_stamp():
    scene = sensed_bay(zones=False)
    (eye,) = scene.add_sensor(
        "eye", kind="depth", size=(40, 30), focal=30, range=(0.05, 2.0), delay=0.1,
        on="left/link7", pose=ag.Pose(xyz=(0, 0, 0.3)), jitter=0.0,
    )  # fmt: skip
    sense, turned = ag.Sense(scene), scene.home.copy()
    for k in range(101):
        turned[0] = scene.home[0] + 0.5 * 0.01 * k
        sense.joints(turned, 0.01 * k)
    image = np.full((30, 40), np.nan)
    image[15, 20] = image[15, 21] = 0.4
    assert sense.depth("eye", image, 0.85) is ag.Intake.TAKEN
    (cell,) = np.argwhere(sense.cells.occupied())
    # It was measured at 0.75 s.
    q = scene.home.copy()
    q[0] += 0.375
    expected = place_before(scene, "eye", q, 0.4)
    assert np.linalg.norm(sense.cells.middles(cell[None])[0] - expected) < 0.04
    late = place_before(scene, "eye", turned, 0.4)
    assert np.linalg.norm(late - expected) > 0.08
    assert eye.delay == 0.1


def test_deltas_make_a_view_equal_to_the_map():
    scene = sensed_bay()
    sense, rig = ag.Sense(scene), Rig(scene, boxes=[(0.2, 0.2, 0.2)])
    rig.place(0, ag.Pose(xyz=(-0.5, 0, 1.2)))
    view = ag.CellView(sense.cells.centre, sense.cells.cell, sense.cells.size)
    drive(sense, rig, swing(scene), 1.0)
    while len(changes := sense.changes()):
        assert len(changes) <= 512
        view.apply(changes)
    assert np.array_equal(view.occupied(), sense.cells.occupied())
    assert np.array_equal(view.known_free(), sense.cells.known_free())
    assert view.occupied().any()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda scene: setattr(scene, "sensing", None), "does not declare the space"),
        (lambda scene: scene._sensors.clear(), "the scene has no sensors"),
    ],
)
def test_a_scene_without_sensors_or_space_is_refused(change, says):
    scene = sensed_bay()
    change(scene)
    with pytest.raises(SceneError, match=says):
        ag.Sense(scene)


def test_links_that_their_primitives_only_enclose_are_not_mapped():
    scene = ag.Scene(mode="path", period=0.004)
    for name, y in (("left", 0.4), ("right", -0.4)):
        scene.add_robot("panda", name, base=ag.Pose(xyz=(0, y, 0)))
    table = ag.Box(size=(1.2, 2.0, 0.05))
    scene.add(table, "table", pose=ag.Pose(xyz=(0.5, 0, -0.13)))
    scene.set_sensing(
        region={"centre": (0.2, 0, 0.4), "size": 128}, cell=0.025, unknown="still",
        intruder={"speed": 1.6, "size": 0.05},
    )  # fmt: skip
    ring = {"count": 4, "radius": 0.14, "height": -0.1}
    for name in ("left", "right"):
        link = f"{name}/panda_link5"
        scene.add_sensor(name + "_ring", kind="vl53l8cx", on=link, ring=ring)
    found, frames, free = mapped(scene, 8.0, 0.01, 0.005, speed=1.0)
    assert frames > 900
    assert found == []
    assert free.sum() > 5_000
