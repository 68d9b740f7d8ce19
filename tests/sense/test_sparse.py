"""Clouds of points and single distances: what they hit, free and clear."""

import numpy as np
import pytest

import armguard as ag
from armguard.scene import Scene
from armguard.sense.frames import BadFrameError, Intake, beam_of, points_of
from armguard.sense.view import View, shared
from one_sensor import CELL, POSE, at_rest, one_sensor


def sensed(kind, **settings):
    return at_rest(one_sensor(kind, **settings))


def exact(kind, **settings):
    """A sensor without noise, error or jitter."""
    return sensed(kind, error=0.0, noise=(0, 0, 0), jitter=0.0, **settings)


def lattice(spacing, wide=0.3):
    slope = np.arange(-wide, wide, spacing)
    x, y = (part.ravel() for part in np.meshgrid(slope, slope))
    return np.stack([x, y, np.ones(len(x))], axis=1)


def met(rays, middle, radius, wall):
    """Points of rays on a ball before a wall."""
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    along = unit @ middle
    below = radius**2 - (middle @ middle - along**2)
    way = along - np.sqrt(np.maximum(below, 0.0))
    return np.where(below[:, None] > 0.0, way[:, None] * unit, wall * rays)


def test_a_ball_of_the_declared_size_is_within_the_claimed_error_of_cells_not_free():
    rng, spacing, freed, farthest = np.random.default_rng(5), 0.025, 0, 0.0
    ball = rng.uniform(-1, 1, (4000, 3))
    ball = 0.025 * ball[np.linalg.norm(ball, axis=1) < 1]
    for k in range(30):
        sense = exact("points", spacing=spacing, range=(0.1, 2.0))
        view = sense._stations["eye"].view
        assert view.reach == pytest.approx(CELL / spacing)
        depth = rng.uniform(0.3, view.reach - 0.05)
        middle = np.array([*rng.uniform(-0.1, 0.1, 2), depth])
        points = met(lattice(spacing), middle, 0.025, 1.5)
        assert sense.points("eye", points, 1.0 + 1e-3 * k) is Intake.TAKEN
        free = sense.cells.known_free()
        freed += free.sum()
        at = middle @ POSE.matrix()[:3, :3].T
        inside = np.argwhere(~free)
        inside = inside[np.linalg.norm(sense.cells.middles(inside) - at, axis=1) < 0.1]
        apart = np.abs((at + ball)[:, None] - sense.cells.middles(inside))
        apart = np.linalg.norm(np.maximum(apart - CELL / 2, 0.0), axis=2).min(axis=1)
        farthest = max(farthest, apart.max())
    assert freed > 30 * 1000
    # It is at most the way from ray to ray along the diagonal, and not nothing.
    assert 0.5 * spacing < farthest / view.reach <= np.sqrt(2) * spacing


def test_points_hit_at_once_and_go_when_rays_pass():
    # They are beyond where space is freed.
    sense = sensed("points", spacing=0.03)
    assert sense._stations["eye"].view.reach < 0.7
    wall = 1.05 * lattice(0.01)
    ball = met(lattice(0.01), np.array([0.0, 0.0, 0.9]), 0.03, 1.05)
    assert sense.points("eye", ball, 1.0) is Intake.TAKEN
    near = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    assert (np.linalg.norm(near - (0.87, 0, 0), axis=1) < 0.02).any()
    for k in range(1, 4):
        sense.points("eye", wall + 1e-4 * k, 1.0 + 0.1 * k)
    far = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    assert (far[:, 0] > 1.0).all()
    assert len(far) > 100


def test_points_beyond_the_range_only_free_and_a_fault_frees_nothing():
    sense = exact("points", spacing=0.01, range=(0.1, 0.6))
    assert sense.points("eye", 0.8 * lattice(0.01), 1.0) is Intake.TAKEN
    assert not sense.cells.occupied().any()
    free = sense.cells.middles(np.argwhere(sense.cells.known_free()))
    assert 0.5 < free[:, 0].max() < 0.6
    again = exact("points", spacing=0.01, range=(0.1, 0.6))
    for k in range(3):
        last = again.points("eye", np.full((5, 3), np.nan), 1.0 + 0.01 * k)
    assert last is Intake.HITS_ONLY
    assert "BLIND" in str(again.health["eye"])
    again.points("eye", 0.4 * lattice(0.01), 1.5)
    assert again.cells.occupied().any()
    assert not again.cells.known_free().any()


def beam(value, **settings):
    sense = exact("range", angle=0.4, least=0.2, **settings)
    return sense, sense.range("eye", value, 1.0)


@pytest.mark.parametrize(("way", "angle"), [(0.11, 0.4), (0.4, 1.2)])
def test_a_distance_hits_the_arc_within_its_cone(way, angle):
    sense = exact("range", angle=angle, least=0.6)
    assert sense.range("eye", way, 1.0) is Intake.TAKEN
    cells = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    # A cell that an arc meets has its middle nearer to it than half its diagonal.
    assert (np.abs(np.linalg.norm(cells, axis=1) - way) < CELL).all()
    angles = np.linspace(-0.5, 0.5, 81) * angle
    arc = way * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    apart = np.maximum(np.abs(arc[:, None] - cells) - CELL / 2, 0.0)
    # The arc is hit in 16 flat parts.
    step = way * np.sin(0.5 * angle) * angle / 32
    assert np.linalg.norm(apart, axis=2).min(axis=1).max() <= step + 1e-9


@pytest.mark.parametrize(
    ("value", "hits", "frees"),
    [(-np.inf, True, False), (np.inf, False, True), (0.01, True, False),
     (np.nan, False, False), (2.5, False, False)],
)  # fmt: skip
def test_infinite_distances_are_too_near_and_nothing_there(value, hits, frees):
    middle_of_cells = ag.Pose(xyz=(0.0, CELL / 2, CELL / 2), rpy=POSE.rpy)
    sense, intake = beam(value, range=(0.04, 2.0), pose=middle_of_cells)
    assert intake is Intake.TAKEN
    assert sense.cells.occupied().any() == hits
    assert sense.cells.known_free().any() == frees
    reach = sense._stations["eye"].view.reach
    free = sense.cells.middles(np.argwhere(sense.cells.known_free()))
    assert 0.7 < reach < 0.8
    assert (free[:, 0] < reach).all()


def fills(a, b, apart, rng):
    """Area that two discs share, by samples."""
    x, y = rng.uniform(-a, a, (2, 400_000))
    both = (np.hypot(x, y) < a) & (np.hypot(x - apart, y) < b)
    return both.mean() * 4 * a * a


@pytest.mark.parametrize(
    "sizes", [(1, 0.5, 1.0), (1, 2, 1.4), (1, 0.3, 0.2), (1, 1, 3)]
)
def test_the_area_that_two_discs_share(sizes):
    found = fills(*sizes, np.random.default_rng(1))
    assert shared(*sizes) == pytest.approx(found, abs=0.01)


def test_a_disc_that_reaches_the_freed_part_of_a_beam_fills_its_share():
    (one,) = Scene(mode="fixed").add_sensor("eye", kind="range", angle=0.4)
    view, rng = View(one, 0.05), np.random.default_rng(2)
    inner = view.freeing(np.ones((16, 16)))
    assert inner.shape == (64, 64)
    assert np.isfinite(inner).sum() == 8 * 8
    radius = view.reach * np.tan(0.2)
    least = min(
        fills(w, 0.025, np.sqrt(2) / 8 * w + 0.025, rng) / (np.pi * w * w)
        for w in np.linspace(0.2, 1.0, 9) * radius
    )
    assert least == pytest.approx(one.fill, abs=0.01)


@pytest.mark.parametrize(
    ("values", "intake"),
    [
        (np.zeros((3, 2)), Intake.WRONG_SIZE),
        (np.zeros(3), Intake.WRONG_SIZE),
        ([["a", "b", "c"]], Intake.WRONG_TYPE),
        (np.zeros((2, 3), dtype=int), Intake.WRONG_TYPE),
        ([[1, 2, 3], [1]], Intake.WRONG_TYPE),
    ],
)
def test_points_of_a_wrong_shape_or_type_are_refused(values, intake):
    (one,) = Scene(mode="fixed").add_sensor("eye", kind="points")
    with pytest.raises(BadFrameError) as caught:
        points_of(one, values)
    assert caught.value.intake is intake


@pytest.mark.parametrize(
    ("value", "intake"),
    [("far", Intake.WRONG_TYPE), ([1.0, 2.0], Intake.WRONG_SIZE), (None, "type")],
)
def test_a_distance_that_is_no_number_is_refused(value, intake):
    (one,) = Scene(mode="fixed").add_sensor("eye", kind="range")
    view = View(one, 0.05)
    with pytest.raises(BadFrameError) as caught:
        beam_of(one, view.slopes, view.cone, value)
    assert caught.value.intake in (intake, Intake.WRONG_TYPE)


def test_a_negative_distance_is_a_fault_of_the_driver():
    sense, _ = beam(-0.5)
    assert "UNUSABLE" in str(sense.health["eye"])


def test_a_frame_of_another_form_is_counted():
    sense = sensed("range")
    assert sense.frame("eye", 0.5, None, 1.0) is Intake.TAKEN
    assert sense.points("eye", lattice(0.1), 1.1) is Intake.WRONG_KIND
    assert sense.frame("none", 0.5, None, 1.0) is Intake.UNKNOWN_SENSOR


def test_a_sensor_in_the_world_is_moved_and_one_on_a_link_is_not():
    sense = exact("range", angle=0.4)
    T = ag.Pose(xyz=(0.3, 0, 0)).matrix()
    assert sense.move_sensor("eye", T, 1.0) is Intake.TAKEN
    sense.range("eye", 0.1, 1.0)
    cells = sense.cells.middles(np.argwhere(sense.cells.occupied()))
    assert cells.mean(axis=0) == pytest.approx((0.3, 0, 0.1), abs=0.0101)
    assert sense.move_sensor("eye", 2 * T, 1.0) is Intake.WRONG_TYPE
    carried = sensed("range", on="arm/tip")
    assert carried.move_sensor("eye", T, 1.0) is Intake.WRONG_KIND
