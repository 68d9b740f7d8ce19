"""Zones of a sensor: what they free holds no object of the declared size."""

import numpy as np
import pytest

import armguard as ag
from armguard.scene import Scene
from armguard.sense.frames import BadFrameError, Intake, frame_of
from armguard.sense.view import View, sure_reach

RNG = np.random.default_rng(3)

# Rays along each edge of a zone, for the share that a ball fills.
FINE = 40


def sensor(**settings):
    (made,) = Scene(mode="fixed").add_sensor("eye", **settings)
    return made


def exact(**settings):
    """A sensor without noise or error, so that only the size limits it."""
    return sensor(kind="vl53l8cx", error=0.0, noise=(0, 0, 0), **settings)


def seen(one, middle, radius, background):
    """Distances of zones to a ball before a wall, where it fills the share of one."""
    columns, rows = one.zones
    parts = (np.arange(FINE) + 0.5) / FINE - 0.5
    u = (np.arange(columns)[:, None] + parts - one.middle[0]).ravel() / one.focal[0]
    v = (np.arange(rows)[:, None] + parts - one.middle[1]).ravel() / one.focal[1]
    ways = np.stack([*np.meshgrid(u, v), np.ones((len(v), len(u)))], axis=2)
    along = (ways @ middle) / (ways**2).sum(axis=2)
    apart = np.linalg.norm(ways * along[..., None] - middle, axis=2)
    hit = (apart <= radius).reshape(rows, FINE, columns, FINE)
    share = hit.mean(axis=(1, 3))
    return np.where(share >= one.fill, middle[2] - radius, background)


def test_no_cell_of_a_ball_of_the_declared_size_is_freed():
    one, size, freed = exact(), 0.05, 0
    view = View(one, size)
    assert 0.4 < view.reach < 0.5
    for _ in range(150):
        depth = RNG.uniform(0.12, view.reach - 0.001)
        x, y = RNG.uniform(-0.3, 0.3, 2) * depth
        middle = np.array([x, y, depth])
        distance = seen(one, middle, size / 2, 2.0)
        frame = frame_of(one, view.slopes, distance, np.full((8, 8), 5))
        cells = ag.CellMap((0, 0, 0.25), 0.005, 128)
        cells.depth(
            np.full((8, 8), np.nan), np.eye(4), one.focal, one.middle, 0.0,
            reach=view.reach, freeing=view.freeing(view.through(frame)),
        )  # fmt: skip
        free = cells.middles(np.argwhere(cells.known_free()))
        freed += len(free)
        # The front half of the ball lies before what hits, so no pixel hides it.
        assert (np.linalg.norm(free - middle, axis=1) > size / 2 - 0.005).all()
    assert freed > 150 * 2000


def test_with_twice_the_reach_cells_of_such_a_ball_are_freed():
    one, lost = exact(), 0
    view = View(one, 0.05)
    for _ in range(40):
        depth = 2.0 * view.reach
        middle = np.array([*RNG.uniform(-0.3, 0.3, 2) * depth, depth])
        frame = frame_of(one, view.slopes, seen(one, middle, 0.025, 2.0), None)
        zones = np.rint(middle[:2] / depth * one.focal + one.middle).astype(int)
        lost += view.through(frame)[zones[1], zones[0]] > depth
    assert lost > 0


@pytest.mark.parametrize("size", [0.02, 0.05])
def test_the_reach_is_where_a_quarter_of_a_disc_fills_the_share(size):
    one = exact(fill=0.25)
    width = sure_reach(one, size) / one.focal[0]
    assert np.pi * size**2 / 16 == pytest.approx(0.25 * width**2)


def test_distances_along_rays_become_perpendicular_ones():
    one = exact(along="ray")
    view = View(one, 0.05)
    wall = np.full((8, 8), 0.7) * view.slopes
    assert frame_of(one, view.slopes, wall, None).depth == pytest.approx(0.7)
    corner = frame_of(exact(), view.slopes, wall, None).depth[0, 0]
    assert corner == pytest.approx(0.7 * np.sqrt(1 + 2 * (3.5 / one.focal[0]) ** 2))


def test_codes_say_what_a_distance_is_worth():
    one = exact()
    view = View(one, 0.05)
    status = np.full((8, 8), 5)
    status[0] = [9, 255, 0, 4, 5, 5, 5, 5]
    distance = np.full((8, 8), 300)
    distance[0, 4:] = [-1, 0, 5000, 300]
    frame = frame_of(one, view.slopes, distance, status)
    assert np.isnan(frame.depth[0, 1:7]).all()
    assert frame.depth[0, [0, 7]].tolist() == [0.3, 0.3]
    assert frame.firm[0].tolist() == [False] * 7 + [True]
    assert frame.nothing[0].tolist() == [False, True] + [False] * 6
    assert frame.impossible[0].tolist() == [False] * 4 + [True, True, False, False]
    through = view.through(frame)[0]
    assert np.isnan(through[[0, 2, 3, 4, 5, 6]]).all()
    assert through[1] > one.range[1]


@pytest.mark.parametrize(
    ("distance", "status", "intake"),
    [
        (np.zeros((4, 8)), None, Intake.WRONG_SIZE),
        (np.zeros(63), None, Intake.WRONG_SIZE),
        ("text", None, Intake.WRONG_TYPE),
        ([[1], [2, 3]], None, Intake.WRONG_TYPE),
        (None, None, Intake.WRONG_TYPE),
        (np.zeros((8, 8), dtype=complex), None, Intake.WRONG_TYPE),
        (np.zeros(64), np.zeros(64), Intake.WRONG_TYPE),
        (np.zeros(64), np.zeros(3, dtype=int), Intake.WRONG_SIZE),
    ],
)
def test_a_frame_that_cannot_be_used_says_why(distance, status, intake):
    one = exact()
    with pytest.raises(BadFrameError) as caught:
        frame_of(one, View(one, 0.05).slopes, distance, status)
    assert caught.value.intake is intake
