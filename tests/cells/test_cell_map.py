"""The public class: what it refuses, and what a map knows at first."""

import subprocess
import sys

import numpy as np
import pytest

import armguard as ag

IMAGE = np.full((4, 4), 1.0)
CAMERA = {"T_world_camera": np.eye(4), "focal": 4.0, "centre": (1.5, 1.5), "stamp": 0.0}


def empty(**settings):
    return ag.CellMap((0, 0, 0), 0.02, 64, **settings)


def test_a_map_that_was_never_fed_frees_nothing():
    cells = empty(intruder_speed=1.6)
    assert not cells.known_free().any()
    assert not cells.occupied().any()
    assert (cells.arrivals() == -np.inf).all()
    ball = ag.Sphere(radius=0.1)
    assert cells.distance(ball, ag.Pose(), 1.0).distance == np.inf
    assert cells.distance(ball, ag.Pose(), 1.0, unknown=True).distance == -0.1


@pytest.mark.parametrize("size", [64, 128, 256, 512])
def test_maps_of_all_sizes_cover_their_cube(size):
    cells = ag.CellMap((0.1, 0.2, 0.3), 0.01, size)
    half = 0.005 * size
    corner = cells.centre + (half - 0.005) * np.array([1, -1, 1])
    cells.points([corner, corner + 0.011], corner, 0.0)
    assert np.argwhere(cells.occupied()).tolist() == [[size - 1, 0, size - 1]]
    found = cells.distance(ag.Sphere(radius=0.001), ag.Pose(xyz=cells.centre), 9.0)
    assert found.cell == (size - 1, 0, size - 1)
    assert found.distance == pytest.approx(np.sqrt(3) * (half - 0.01) - 0.001)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (((0, 0), 0.01), "centre"),
        (((0, 0, np.nan), 0.01), "centre"),
        (((0, 0, 0), 0.0), "cell"),
        (((0, 0, 0), np.inf), "cell"),
        (((0, 0, 0), 0.01, 100), "size"),
    ],
)
def test_a_map_of_wrong_numbers_is_refused(arguments, match):
    with pytest.raises(ag.CellMapError, match=match):
        ag.CellMap(*arguments)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"image": np.zeros(4)}, "shape"),
        ({"image": np.zeros((0, 4))}, "shape"),
        ({"image": [["a"]]}, "floats"),
        ({"focal": 0.0}, "focal"),
        ({"focal": (1.0, np.nan)}, "focal"),
        ({"centre": (1.0, np.inf)}, "centre"),
        ({"centre": 3.0j}, "centre"),
        ({"centre": (1.0, 2.0, 3.0)}, "centre"),
        ({"stamp": np.nan}, "stamp"),
        ({"reach": 0.0}, "reach"),
        ({"reach": np.nan}, "reach"),
        ({"error": -1e-9}, "error"),
        ({"error": np.nan}, "error"),
    ],
)
def test_an_image_of_wrong_numbers_is_refused(change, match):
    cells = empty()
    with pytest.raises(ag.CellMapError, match=match):
        cells.depth(**{"image": IMAGE, **CAMERA, **change})
    assert not cells.known_free().any()


def test_poses_are_rigid_and_finite():
    cells = empty()
    for bad in (2.0 * np.eye(4), np.full((4, 4), np.nan)):
        with pytest.raises(ag.PoseError):
            cells.depth(IMAGE, **{**CAMERA, "T_world_camera": bad})
        with pytest.raises(ag.PoseError):
            cells.own([(ag.Sphere(radius=0.1), bad)])


def test_other_wrong_arguments_are_refused():
    cells = empty()
    ball, plane = ag.Sphere(radius=0.1), ag.HalfSpace()
    with pytest.raises(ag.CellMapError, match="view"):
        cells.zones(IMAGE, np.eye(4), np.pi, 0.0)
    with pytest.raises(ag.CellMapError, match="points"):
        cells.points([1.0, 2.0, 3.0], (0, 0, 0), 0.0)
    with pytest.raises(ag.CellMapError, match="origin"):
        cells.points([(1.0, 2.0, 3.0)], (0, 0, np.nan), 0.0)
    with pytest.raises(ag.CellMapError, match="half-space"):
        cells.own([(plane, ag.Pose())])
    with pytest.raises(ag.CellMapError, match="shell"):
        cells.own([], shell=-0.1)
    with pytest.raises(ag.CellMapError, match="limit"):
        cells.distance(ball, ag.Pose(), np.inf)
    with pytest.raises(ag.CellMapError, match="poses"):
        cells.distance(ball, np.stack([np.eye(4)] * 2), 1.0)
    with pytest.raises(ag.CellMapError, match="intruder_speed"):
        cells.arrivals()
    for wrong in ({"intruder_speed": -1.0}, {"settles": np.nan}):
        with pytest.raises(ag.CellMapError, match=next(iter(wrong))):
            empty(**wrong)


def test_integers_are_millimetres():
    one, two = empty(), empty()
    for k in range(4):
        image = np.full((30, 40), 300 + 10 * k, dtype=np.uint16)
        camera = {**CAMERA, "focal": 40.0, "centre": (19.5, 14.5)}
        one.depth(image, **camera)
        two.depth(np.float32(1e-3) * image, **camera)
    assert one.checkpoint() == two.checkpoint()
    assert one.occupied().any()


def test_a_thin_rod_stays_until_it_is_seen_through():
    cells = empty()
    camera = {**CAMERA, "focal": 80.0, "centre": (39.5, 29.5)}
    camera["T_world_camera"] = ag.Pose(xyz=(0, 0, -0.6))
    back = np.full((60, 80), 1.1)
    rod = back.copy()
    rod[:, 40:42] = 0.6
    cells.depth(back, **camera)
    assert cells.known_free()[32:36, 32, 31].all()
    cells.depth(rod, **{**camera, "stamp": 0.1})
    assert cells.occupied()[32, 24:40, 31:33].any(axis=1).all()
    hidden = rod.copy()
    hidden[:, 38:44] = np.nan
    before = cells.occupied()
    cells.depth(hidden, **{**camera, "stamp": 0.2})
    np.testing.assert_array_equal(cells.occupied() & before, before)
    # One look through its cells takes 1 off the 2 of one hit.
    cells.depth(back, **{**camera, "stamp": 0.3})
    assert not (cells.occupied() & cells.known_free()).any()
    assert not cells.occupied()[:, 24:40, :40].any()


def test_a_guard_without_sensed_space_compiles_none_of_it():
    program = (
        "import sys, armguard as ag;"
        "guard = ag.Guard(ag.bay_scene('path'), self_test=False);"
        "rooms = [m for n, m in sys.modules.items() if n.startswith('armguard.cells')];"
        "rooms += [m for n, m in sys.modules.items() if 'guard.sensed' in n];"
        "found = [k for m in rooms for k in vars(m).values() if hasattr(k, 'py_func')];"
        "own = ('armguard.cells', 'armguard.guard.sensed');"
        "found = [k for k in found if k.py_func.__module__.startswith(own)];"
        "done = [k for k in found if getattr(k, 'dispatcher', k).overloads];"
        "print(len(found) > 20, [k.py_func.__name__ for k in done])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "True []\n"
