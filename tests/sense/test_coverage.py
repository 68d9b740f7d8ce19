"""Blind patches of links, against MuJoCo's rays."""

import mujoco
import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.sense.coverage import coverage
from armguard.sense.eye import unseen
from armguard.sense.patches import connected, extent
from blind_spots import PLATE_STANDOFF, one_link, plate
from coverage_campaign import episode

DOWN = (np.pi, 0, 0)


def shadow(size):
    """A plate below a camera, and a disc whose shadow at the standoff has this size."""
    top, disc = 1.01, 0.16
    shrunk = (top - disc) / (top - 0.01 - PLATE_STANDOFF)
    return plate([(0.02, 0.01, disc, size * shrunk)], [Pose(xyz=(0, 0, top), rpy=DOWN)])


def upper(scene, **options):
    """Patches on the upper side of the plate."""
    found = coverage(scene, standoff=PLATE_STANDOFF, **options).patches
    return [one for one in found if one.facing[2] > 0.99]


@pytest.mark.parametrize("size", [0.0188, 0.0208])
def test_a_patch_is_named_from_20_mm_on(size):
    found = upper(shadow(size))
    if size < 0.019:
        assert not found
        return
    (patch,) = found
    assert patch.link == "arm/link"
    assert patch.size == pytest.approx(size, abs=0.001)
    # The disc is 0.15 m before the plate, and its shadow is there from 1 m on.
    middle = np.array([0.02, 0.01]) * (1.0 - PLATE_STANDOFF) / 0.85
    assert patch.centre == pytest.approx((*middle, 0.01), abs=0.001)


def test_a_finer_or_coarser_least_size_is_kept():
    assert len(upper(shadow(0.03), least=0.028)) == 1
    assert not upper(shadow(0.03), least=0.032)


def test_the_lower_side_is_seen_from_below_alone():
    scene = plate([], [Pose(xyz=(0, 0, 1.0), rpy=DOWN)])
    (patch,) = coverage(scene, standoff=PLATE_STANDOFF).patches
    assert patch.facing[2] < -0.99
    assert patch.size == pytest.approx(np.hypot(0.3, 0.3), abs=0.008)
    scene.add_sensor(
        "low", kind="depth", size=(320, 320), focal=150, range=(0.1, 3.0),
        pose=Pose(xyz=(0, 0, -1.0)),
    )  # fmt: skip
    found = coverage(scene, standoff=PLATE_STANDOFF)
    assert not found.patches and found.seen == {"arm/link": 1.0}


def test_nothing_is_seen_before_the_joint_positions_bring_it_into_view():
    scene = plate([], [Pose(xyz=(0, 0, 3.07), rpy=DOWN)])
    assert coverage(scene, standoff=PLATE_STANDOFF).seen == {"arm/link": 0.0}
    found = coverage(scene, [0.1], standoff=PLATE_STANDOFF)
    assert found.seen["arm/link"] > 0.3
    assert not [one for one in found.patches if one.facing[2] > 0.99]


def test_pads_and_clouds_see_nothing():
    scene = one_link(
        plate([], []).robots["arm"].model.links["link"].collisions[0].geometry
    )
    for kind in ("points", "capacitive"):
        scene.add_sensor(kind, kind=kind, pose=Pose(xyz=(0, 0, 0.2), rpy=DOWN))
    found = coverage(scene)
    assert found.seen == {"arm/link": 0.0}
    assert found.patches[0].body == np.inf


@pytest.mark.parametrize("kind", ["plate", "capsule"])
@pytest.mark.parametrize("seed", [2, 10])
def test_each_blind_spot_that_rays_find_is_named(kind, seed):
    found = episode(kind, seed)
    assert found["spots"] > 0
    assert (found["missed"], found["false"]) == (0, 0)


@pytest.mark.parametrize("seed", range(20))
def test_a_body_that_hides_meets_no_ray_and_a_larger_one_does(seed):
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-0.3, 0.3, (40, 3)) + np.array([0.0, 0.0, 0.1])
    ways = rng.normal(size=(40, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    lengths = rng.uniform(0.05, 0.4, 40)
    size = unseen(origins, ways, lengths, np.array([0.0, 0.0, 1.0]))
    assert np.isfinite(size)
    hit = {}
    for factor in (0.999, 1.001):
        radius = 0.5 * factor * size
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=(0, 0, radius), size=(radius, 0, 0)
        )
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        ids = np.zeros(1, dtype=np.int32)
        first = [
            mujoco.mj_ray(model, data, o, w, None, True, -1, ids)
            for o, w in zip(origins, ways, strict=True)
        ]
        hit[factor] = any(0 <= f <= n for f, n in zip(first, lengths, strict=True))
    assert hit == {0.999: False, 1.001: True}


def test_points_are_connected_across_cubes_and_not_across_gaps():
    line = np.zeros((60, 3))
    line[:, 0] = 0.001 * np.arange(60)
    line[30:, 0] += 0.01
    labels = connected(line, 0.0012)
    assert len(set(labels[:30])) == len(set(labels[30:])) == 1
    assert labels[0] != labels[-1]
    assert len(connected(np.zeros((0, 3)), 0.01)) == 0


def test_the_extent_is_that_of_the_farthest_points():
    rng = np.random.default_rng(1)
    for _ in range(20):
        points = rng.normal(size=(300, 3)) * rng.uniform(0.1, 1.0, 3)
        apart = np.linalg.norm(points[:, None] - points, axis=2).max()
        assert 0.99 * apart <= extent(points) <= apart
