"""Poses: one way to give an orientation, in radians, with unit quaternions."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard import Box, Pose, PoseError, Region, ShapeError, distance, distances
from armguard.geometry.pose import LOOKS_LIKE_DEGREES, rotation_from_rpy
from armguard.scene.file_shapes import PoseModel

# A quarter turn about z, as a quaternion.
HALF = np.sqrt(0.5)

REFUSED = {
    "degrees": (
        {"rpy": (0, 0, 90)},
        "rpy[2] is 90 rad, which looks like degrees; give radians: 1.5708",
    ),
    "norm": ({"quat_xyzw": (0, 0, 0, 0.5)}, "quat_xyzw has norm 0.5; it must be 1"),
    "norm first": ({"quat_wxyz": (2, 0, 0, 0)}, "quat_wxyz has norm 2; it must be 1"),
    "two": (
        {"rpy": (0, 0, 0), "quat_wxyz": (1, 0, 0, 0)},
        "rpy and quat_wxyz are given; give one orientation",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_python_and_the_scene_file_refuse_a_pose_with_the_same_words(case):
    given, says = REFUSED[case]
    with pytest.raises(PoseError) as python:
        Pose(**given)
    assert str(python.value).startswith(says)
    with pytest.raises(ValueError, match=r".") as file:
        PoseModel.model_validate({key: list(value) for key, value in given.items()})
    # The file's message names the key by its place in the file.
    assert str(python.value).removeprefix("rpy[2] ") in str(file.value)


@pytest.mark.parametrize("value", [(0, 0), (0, 0, np.nan), 5, ("a", 0, 0)])
@pytest.mark.parametrize("key", ["xyz", "rpy"])
def test_three_finite_numbers_or_a_named_error(key, value):
    with pytest.raises(PoseError, match=rf"^{key} is .*; it must be 3 "):
        Pose(**{key: value})
    with pytest.raises(PoseError, match=r"^quat_xyzw is .*; it must be 4 "):
        Pose(quat_xyzw=value)


def test_two_turns_are_still_radians():
    assert Pose(rpy=(0, 0, LOOKS_LIKE_DEGREES)).rpy[2] == LOOKS_LIKE_DEGREES


def test_both_orders_of_a_quaternion_are_the_same_pose():
    first = Pose(xyz=(1, 2, 3), quat_wxyz=(HALF, 0, 0, HALF))
    last = Pose(xyz=(1, 2, 3), quat_xyzw=(0, 0, HALF, HALF))
    assert first == last and hash(first) == hash(last)
    assert last.rpy == pytest.approx((0, 0, np.pi / 2))
    assert Pose(rpy=last.rpy).matrix()[:3, :3] == pytest.approx(
        rotation_from_rpy(0, 0, np.pi / 2)
    )
    assert Pose.from_matrix(last.matrix()).rpy == pytest.approx(last.rpy)


def test_a_pose_that_was_used_is_the_same_pose():
    pose = Pose(xyz=(1, 2, 3), rpy=(0.1, 0.2, 0.3))
    rows = pose.rows()
    assert rows is pose.rows()
    assert np.array_equal(rows.reshape(3, 4), pose.matrix()[:3])
    assert pickle.loads(pickle.dumps(pose)) == pose == Pose(xyz=pose.xyz, rpy=pose.rpy)
    assert replace(pose, xyz=(0, 0, 0)).rows()[0, 3] == 0.0


def test_a_box_has_its_full_size_and_a_region_too():
    box = Box(size=(0.2, 0.4, 0.6))
    assert box.half_extents == (0.1, 0.2, 0.3)
    assert repr(box) == "Box(size=(0.2, 0.4, 0.6), rounding=0.0)"
    side = distance(box, Pose(), box, Pose(xyz=(1, 0, 0)))
    assert side.distance == pytest.approx(0.8)
    with pytest.raises(ShapeError, match=r"Box size y is 0\.0 m; it must be finite"):
        Box(size=(1, 0, 1))
    with pytest.raises(TypeError):
        Box(half_extents=(1, 1, 1))
    assert Region(size=(1, 1, 1)).size == (1, 1, 1)


def test_prepared_shapes_measure_with_the_same_bits():
    rng = np.random.default_rng(3)
    boxes = [Box(size=tuple(rng.uniform(0.1, 0.5, 3))) for _ in range(2)]
    for _ in range(20):
        poses = [
            Pose(xyz=tuple(rng.uniform(-1, 1, 3)), rpy=tuple(rng.uniform(-3, 3, 3)))
            for _ in range(2)
        ]
        again = [Pose(xyz=pose.xyz, rpy=pose.rpy) for pose in poses]
        fresh = [Box(size=box.size) for box in boxes]
        known = distance(boxes[0], poses[0], boxes[1], poses[1])
        many = distances(fresh[0], again[0], fresh[1], again[1])[0]
        for name in ("distance", "point_a", "point_b", "normal"):
            assert np.array_equal(getattr(known, name), getattr(many, name))


def test_more_shapes_than_are_kept_prepared():
    ball, far = Box(size=(1, 1, 1)), Pose(xyz=(3, 0, 0))
    for k in range(1500):
        other = Box(size=(0.1 + 1e-4 * k, 1, 1))
        gap = distance(ball, Pose(), other, far).distance
        assert gap == pytest.approx(2.5 - other.size[0] / 2)


def test_a_matrix_keeps_its_rotation_near_a_pitch_of_90_degrees():
    """Quaternions of seven digits leave the horizontal part of an axis at 1e-8."""
    for angle in 10.0 ** np.arange(-16.0, -1.0):
        for roll, yaw in ((0.3, -2.0), (3.0, 1.0), (-1.0, 0.0)):
            T, rpy = np.eye(4), (roll, np.pi / 2 - angle, yaw)
            T[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
            assert np.abs(Pose.from_matrix(T).matrix() - T).max() < 2e-12
