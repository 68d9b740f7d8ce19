"""Bodies that a camera sees move: their boxes and velocities against where they are."""

import sys

import numpy as np
import pytest

from armguard.cells.cell_map import CellMap
from armguard.errors import SceneError
from armguard.guard.clusters import CONFIRMED, MOST_CLUSTERS
from armguard.sense.clusters import (
    MOST_CELLS,
    MOST_TRACKS,
    Clusters,
    Track,
    part_of,
)

CELL, PERIOD, FASTEST = 0.025, 1.0 / 30.0, 1.6
FOCAL, MIDDLE = 200.0, (119.5, 89.5)
EYE, FLOOR = 2.2, 2.1

# The camera looks straight down: x of its frame is x of the world.
DOWN = np.diag([1.0, -1.0, -1.0])


class View:
    """A camera above a floor, by hand; bodies are squares that face it.

    Args:
        noise: Standard deviation of depths [m].
    """

    def __init__(self, noise=0.0):
        self.cells = CellMap((0.0, 0.0, 1.0), CELL, 64)
        self.clusters = Clusters(self.cells, FASTEST)
        self.rng, self.noise = np.random.default_rng(5), noise
        v, u = np.mgrid[:180, :240]
        self.x, self.y = (u - MIDDLE[0]) / FOCAL, (MIDDLE[1] - v) / FOCAL
        for k in range(6):
            self.look([], (k - 6) * PERIOD)

    def look(self, middles, stamp, half=0.06, shown=None):
        """A frame with squares at `middles`, of which pixels `shown` are measured."""
        depth = np.full(self.x.shape, FLOOR)
        for x, y, z in middles:
            at = EYE - z
            inside = np.abs(self.x * at - x) < half
            inside &= np.abs(self.y * at - y) < half
            depth[inside] = np.minimum(depth[inside], at)
        depth += self.noise * self.rng.standard_normal(depth.shape)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = DOWN, (0.0, 0.0, EYE)
        self.cells.depth(depth, T, FOCAL, MIDDLE, stamp, source=1)
        points = np.stack([self.x * depth, self.y * depth, EYE - depth], axis=-1)
        shown = np.ones(depth.shape, dtype=bool) if shown is None else shown
        self.clusters.look(points[shown], T[:3, 3], 1, stamp)

    def watch(self, places, start=0.0):
        """Frames of bodies at places, shape (frames, bodies, 3); the last clusters."""
        for k, middles in enumerate(places):
            self.look(middles, start + k * PERIOD)
        return self.clusters.found()


def way(begin, velocity, frames):
    """Where a body is in each frame, shape (frames, 3)."""
    times = PERIOD * np.arange(frames)
    return np.array(begin) + times[:, None] * np.array(velocity)


@pytest.mark.parametrize(
    "velocity",
    [(0.1, 0.0, 0.0), (0.5, 0.3, 0.0), (0.0, -1.2, 0.0), (0.0, 0.3, 0.4)],
)
def test_velocity_and_box_are_those_of_the_body(velocity):
    begin = -0.15 * np.array(velocity) + (0.0, 0.0, 1.0)
    places = way(begin, velocity, 10)
    (found,) = View(noise=3e-3).watch(places[:, None])
    off = float(np.linalg.norm(found.velocity - velocity))
    assert off <= min(found.error, 0.05)
    # The side that the camera sees, and as far behind it as it is wide.
    seen = places[-1]
    assert found.low[:2] == pytest.approx(seen[:2] - 0.06, abs=0.025)
    assert found.high[:2] == pytest.approx(seen[:2] + 0.06, abs=0.025)
    assert found.high[2] == pytest.approx(seen[2], abs=0.025)
    assert found.low[2] == pytest.approx(seen[2] - 0.12, abs=0.04)
    assert found.stamp == pytest.approx(9 * PERIOD)


def test_a_few_frames_are_needed():
    places = way((0.0, 0.0, 1.01), (0.5, 0.0, 0.0), 10)
    view = View(noise=3e-3)
    counts = []
    for k, place in enumerate(places):
        view.look([place], k * PERIOD)
        counts.append(len(view.clusters.found()))
    assert counts[:3] == [0, 0, 0]
    assert counts[6:] == [1] * 4


def test_a_slower_body_needs_more_frames():
    # Five frames give its velocity to 0.1 m/s, half of what it is.
    view = View()
    for k, place in enumerate(way((0.0, 0.0, 1.01), (0.2, 0.0, 0.0), 9)):
        view.look([place], k * PERIOD)
        assert len(view.clusters.found()) == 0 or k > 4
    assert len(view.clusters.found()) == 1


def test_a_body_that_turns_is_followed_all_the_same():
    view, counts = View(noise=3e-3), []
    there = way((-0.2, 0.0, 1.01), (0.6, 0.0, 0.0), 10)
    places = np.concatenate([there, way(there[-1], (0.0, 0.6, 0.0), 12)[1:]])
    for k, place in enumerate(places):
        view.look([place], k * PERIOD)
        counts.append(len(view.clusters.found()))
    assert counts[6:] == [1] * (len(places) - 6)


def test_a_body_that_appears_and_rests_does_not_move():
    view = View(noise=3e-3)
    for k in range(60):
        view.look([(0.1, 0.0, 1.0)], k * PERIOD)
        assert len(view.clusters.found()) == 0


def test_bodies_that_appear_anywhere_in_turn_do_not_move():
    view = View(noise=3e-3)
    rng = np.random.default_rng(2)
    for k in range(90):
        places = rng.uniform((-0.5, -0.5, 0.7), (0.5, 0.5, 1.3), (3, 3))
        view.look(places, k * PERIOD, half=0.03)
        assert len(view.clusters.found()) == 0


def test_a_body_faster_than_any_is_none():
    places = way((-0.6, 0.0, 1.0), (3.0, 0.0, 0.0), 10)
    assert len(View().watch(places[:, None])) == 0


def test_two_bodies_are_two_clusters():
    one = way((-0.3, 0.2, 1.01), (0.4, 0.0, 0.0), 10)
    other = way((0.3, -0.2, 0.91), (-0.2, 0.0, 0.0), 10)
    found = View().watch(np.stack([one, other], axis=1))
    # The fastest comes first.
    assert found.velocity[:, 0] == pytest.approx([0.4, -0.2], abs=0.02)


def test_a_body_that_is_seen_no_more_is_forgotten():
    view = View()
    places = way((0.0, 0.0, 1.01), (0.5, 0.0, 0.0), 10)
    assert len(view.watch(places[:, None])) == 1
    last = 9 * PERIOD
    view.look([], last + CONFIRMED - 0.01)
    assert len(view.clusters.found()) == 1
    view.look([], last + CONFIRMED + 0.01)
    assert len(view.clusters.found()) == 0


def test_a_body_keeps_its_number():
    one = way((-0.3, 0.2, 1.01), (0.4, 0.0, 0.0), 12)
    other = way((0.3, -0.2, 0.91), (-0.2, -0.1, 0.0), 12)
    view, numbers = View(), []
    for k, places in enumerate(np.stack([one, other], axis=1)):
        view.look(places, k * PERIOD)
        # By where they are along x.
        found = view.clusters.found()
        numbers.append(found.number[np.argsort(found.low[:, 0])].tolist())
    known = [pair for pair in numbers if len(pair) == 2]
    assert len(known) >= 6
    assert all(pair == known[0] and pair[0] != pair[1] for pair in known)


def test_a_body_is_not_followed_before_it_is_wholly_in_the_region():
    # The region is 1.6 m wide; half of the body is in it at first.
    velocity = (-0.5, 0.0, 0.0)
    view = View(noise=3e-3)
    for k, place in enumerate(way((0.84, 0.0, 0.41), velocity, 14)):
        view.look([place], k * PERIOD)
        for found in view.clusters.found():
            assert place[0] + 0.06 < 0.8
            assert found.velocity == pytest.approx(velocity, abs=0.08)
    assert len(view.clusters.found()) == 1


def test_a_ball_holds_what_several_sensors_see():
    track, half = Track(1), 0.06
    turns = np.array([(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)])
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 2), axis=-1).reshape(-1, 2)
    velocity, seen = np.array((0.3, -0.2, 0.1)), []
    for k in range(12):
        # A quarter of a ball's surface, towards each sensor in turn.
        out = turns[k % 3]
        round_it = np.stack([np.roll(out, 1), np.roll(out, 2)])
        points = 0.7 * grid @ round_it + out
        points = half * points / np.linalg.norm(points, axis=1)[:, None]
        points += 0.02 * k * velocity
        seen.append(points - 0.02 * k * velocity)
        track.add(part_of(points, 3.0 * out, k % 3, 0.02 * k), FASTEST)
    assert track.moves
    low, high = track.box(0.22)
    middle = 0.5 * (low + high) - 0.22 * track.velocity.mean
    farthest = np.linalg.norm(np.concatenate(seen) - middle, axis=1).max()
    assert track.radius(0.22) == pytest.approx(farthest, abs=2e-3)
    # Less far than the corners of the box.
    assert track.radius(0.22) < 0.85 * np.linalg.norm(0.5 * (high - low))
    lone = Track(2)
    lone.add(part_of(points, np.zeros(3), 1, 0.0), FASTEST)
    assert lone.radius(0.0) == 0.0


def test_clusters_and_tracks_are_bounded():
    grid = [(0.13 * i, 0.13 * j, 1.01) for i in range(-3, 3) for j in range(-2, 3)]
    view = View()
    for k in range(8):
        moved = np.add(grid, (0.3 * k * PERIOD, 0.0, 0.0))
        view.look(moved, k * PERIOD, half=0.035)
    assert len(view.clusters.found()) == MOST_CLUSTERS
    assert len(view.clusters._tracks) == MOST_TRACKS


def test_with_too_many_new_cells_a_frame_has_no_clusters():
    view = View()
    for k in range(8):
        # Walls that step towards the camera.
        view.look([(0.0, 0.0, 0.7 + 0.06 * k)], k * PERIOD, half=0.8)
    cells = view.cells
    assert cells.occupied().sum() > MOST_CELLS
    assert len(view.clusters.found()) == 0


def test_without_scipy_an_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy.sparse.csgraph", None)
    with pytest.raises(SceneError, match="armguard\\[meshes\\]"):
        Clusters(CellMap((0.0, 0.0, 1.0), CELL, 64), FASTEST)
