"""Infrared signals: bounds by the material, distances by the way, and free space."""

import numpy as np
import pytest

import armguard as ag
from armguard.scene import Scene
from armguard.sense.infrared import Infrared
from one_sensor import CELL, POSE, at_rest, one_sensor

AXIS = np.array([0.0, 0.0, 1.0])
DARK, BRIGHT = 0.04, 0.88


def finder(**settings):
    (one,) = Scene(mode="fixed").add_sensor("eye", kind="infrared", **settings)
    return Infrared(one)


def volts(distance, strength, gain=0.02, offset=0.01):
    """The formula of the signal."""
    return gain * strength / (distance + offset) ** 2


def approach(made, strength, start=0.15, way=0.04, count=60, noise=0.0, moves=0.0):
    """What is seen at the end of a way towards a body, which may move itself."""
    rng, seen, true = np.random.default_rng(0), None, start
    for k in range(count + 1):
        at = way * k / count
        true = start - at - moves * at * at
        value = volts(true, strength) * (1.0 + noise * rng.standard_normal())
        seen = made.take(value, 0.01 * k, at * AXIS, AXIS)
    return seen, true


@pytest.mark.parametrize("strength", [DARK, 0.2, BRIGHT])
def test_one_signal_gives_bounds_of_all_materials(strength):
    made = finder(tilt=0.0, noise=(0.0, 1e-9, 0.0))
    seen = made.take(volts(0.1, strength), 0.0, np.zeros(3), AXIS)
    assert not seen.fitted
    assert seen.near == pytest.approx(0.11 * np.sqrt(DARK / strength) - 0.01, abs=1e-6)
    assert seen.far == pytest.approx(0.11 * np.sqrt(BRIGHT / strength) - 0.01, abs=1e-6)
    # A body may fill a quarter of the cone only.
    assert seen.surely == pytest.approx(
        max(0.11 * np.sqrt(0.25 * DARK / strength) - 0.01, 0.0), abs=1e-6
    )


def test_an_oblique_surface_has_the_signal_of_a_darker_one():
    straight, oblique = finder(tilt=0.0), finder(tilt=1.0)
    value = volts(0.1, 0.3)
    near = [one.take(value, 0.0, np.zeros(3), AXIS).near for one in (straight, oblique)]
    ratio = (near[1] + 0.01) / (near[0] + 0.01)
    assert ratio == pytest.approx(np.sqrt(np.cos(1.0)))


@pytest.mark.parametrize("strength", [0.04, 0.1, 0.5, 0.88])
def test_a_known_way_gives_the_distance_of_any_material(strength):
    seen, true = approach(finder(), strength)
    assert seen.fitted
    assert 0.5 * (seen.near + seen.far) == pytest.approx(true, abs=1e-3)
    assert true - 0.006 < seen.near < true < seen.far


def test_a_learned_reflectance_is_kept_until_another_body_comes():
    made = finder()
    approach(made, 0.4)
    strength, _ = made.learned
    assert strength == pytest.approx(0.4, abs=0.01)
    # Long after the way: the samples of the fit are too old.
    seen = made.take(volts(0.1, 0.4), 60.0, 0.05 * AXIS, AXIS)
    assert seen.fitted
    assert seen.near < 0.1 < seen.far
    assert seen.far - seen.near < 0.02
    other = made.take(volts(0.1, 0.05), 60.01, 0.05 * AXIS, AXIS)
    assert not other.fitted
    assert made.learned is None


def test_a_body_that_recedes_fast_keeps_its_near_bound():
    seen, true = approach(finder(), 0.4, moves=-25.0)
    assert not seen.fitted
    assert seen.near < true


@pytest.mark.parametrize("moves", [-25.0, -8.0, 0.0, 8.0, 25.0])
def test_a_body_that_moves_is_never_in_freed_space_and_one_that_comes_seems_nearer(
    moves,
):
    seen, true = approach(finder(), 0.4, moves=moves)
    assert seen.surely < true
    assert seen.near < true or moves == -8.0


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.6, 0.8)])
def test_a_way_across_the_axis_is_not_used(axis):
    made, seen = finder(), None
    for k in range(60):
        at = 0.04 * k / 60 * np.array(axis)
        seen = made.take(volts(0.15 - at[2], 0.4), 0.01 * k, at, AXIS)
    assert not seen.fitted


def test_without_a_signal_space_is_free_as_far_as_the_darkest_body_gives_one():
    made = finder(noise=(0.001, 0.0, 0.0))
    seen = made.take(0.0, 0.0, np.zeros(3), AXIS)
    assert seen.near == np.inf
    strength = 0.25 * DARK * np.cos(0.5)
    # Three standard deviations of the noise.
    assert volts(seen.surely, strength) == pytest.approx(0.003)


def test_the_map_has_a_hit_at_the_near_end_and_frees_less():
    at = ag.Pose(xyz=(0.0, CELL / 2, CELL / 2), rpy=POSE.rpy)
    sense = at_rest(one_sensor("infrared", least=0.2, pose=at, angle=0.3))
    value = volts(0.3, 0.2)
    assert sense.infrared("eye", value, 1.0) is ag.Intake.TAKEN
    near = finder().take(value, 0.0, np.zeros(3), AXIS).near
    cells = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    assert (np.abs(np.linalg.norm(cells - at.xyz, axis=1) - near) < CELL).all()
    assert len(cells) > 0
    assert sense.infrared("eye", 0.0, 1.5) is ag.Intake.TAKEN
    free = sense.cells.middles(np.argwhere(sense.cells.known_free()))
    assert 0 < len(free)
    surely = finder().take(0.0, 0.0, np.zeros(3), AXIS).surely
    assert free[:, 0].max() < surely


def test_a_modelled_surface_explains_what_the_brightest_one_would_give():
    scene = one_sensor("infrared", angle=0.3)
    wall = ag.Box(size=(0.1, 1.0, 1.0))
    scene.add(wall, "wall", pose=ag.Pose(xyz=(0.25, 0, 0)))
    sense = at_rest(scene)
    sense.infrared("eye", volts(0.2, 0.85), 1.0)
    assert not sense.cells.occupied().any()
    # Brighter than any surface at the wall.
    sense.infrared("eye", volts(0.12, 0.88), 1.1)
    assert sense.cells.occupied().any()


@pytest.mark.parametrize("value", ["bright", np.nan, [1.0, 2.0]])
def test_a_signal_that_is_no_number_is_counted(value):
    sense = at_rest(one_sensor("infrared"))
    intake = sense.infrared("eye", value, 1.0)
    assert intake in (ag.Intake.WRONG_TYPE, ag.Intake.WRONG_SIZE)
