"""Cells and sensors on the page, from the frames of a ring."""

from types import SimpleNamespace

import numpy as np
import pytest
import viser

import armguard as ag
from armguard.recording.calls import UpdateCells
from armguard.scene.sensing import SENSED
from armguard.scene.two_pandas import sensed_table_path
from armguard.view.drawables import Shells
from armguard.view.sensed import (
    BESIDE,
    LONGEST,
    MOST_CELLS,
    MOST_FACES,
    frontier,
    line_of,
    nearest_cells,
    view_edges,
)
from armguard.view.sensed_state import SensedState
from armguard.view.world import World


@pytest.fixture(scope="module")
def scene():
    return ag.load_scene(sensed_table_path())


def cells_of(points):
    cells = ag.CellMap((0, 0, 0.5), 0.025, 128)
    cells.points(np.asarray(points), (0, 0, 1.9), 1.0)
    return cells


def test_cells_on_the_page_are_those_of_the_events(scene):
    state, cells = SensedState(scene), cells_of([(0.1, 0.2, 0.3), (0.4, 0, 0.1)])
    before = state.revision
    while len(changes := cells.take_deltas(10)):
        state.apply(UpdateCells(deltas=changes, stamp=1.0).event)
    assert state.revision > before
    assert (state.view.occupied() == cells.occupied()).all()
    assert state.view.occupied().sum() == 2
    for wrong in ({"call": "place"}, {"call": "update_cells", "deltas": "?"}):
        state.apply({**wrong, "stamp": 1.0})
    assert (state.view.occupied() == cells.occupied()).all()


def test_health_of_a_sensor_stays_until_a_newer_note(scene):
    state = SensedState(scene)
    state.note({"sensors": {"top": {"says": "in order"}, "skin": {"says": "SILENT"}}})
    state.note({"sensors": {"top": {"says": "BLIND"}}})
    assert state.health == {"top": "BLIND", "skin": "SILENT"}
    assert line_of("top", "BLIND") == "▲ **top**: BLIND"
    assert line_of("top", "in order").startswith("●")
    assert line_of("top", "") == "○ **top**: no report"


def test_the_page_gets_the_cells_nearest_to_the_robots():
    rng = np.random.default_rng(1)
    view = ag.CellView((0, 0, 0.5), 0.025, 128)
    cells = ag.CellMap((0, 0, 0.5), 0.025, 128)
    for x in np.arange(-1.4, 1.4, 0.2):
        points = rng.uniform((x, -1, 0.0), (x + 0.2, 1, 0.05), (4000, 3))
        cells.points(points, (x, 0, 1.9), 1.0)
    while len(changes := cells.take_deltas()):
        view.apply(changes)
    assert view.occupied().sum() > 1.2 * MOST_CELLS
    places = np.array([(1.0, 0, 0), (0.9, 0.2, 0.5)])
    found = nearest_cells(view, places)
    assert len(found) == MOST_CELLS
    far = np.linalg.norm(found[:, None] - places, axis=2).min(axis=1).max()
    every = view.middles(np.argwhere(view.occupied()))
    nearer = np.linalg.norm(every[:, None] - places, axis=2).min(axis=1) < far - 1e-9
    assert nearer.sum() <= MOST_CELLS


def frontier_of(view, links):
    """The frontier by a look at the six neighbours of every known free cell."""
    free, occupied = view.known_free(), view.occupied()
    found = set()
    for cell in np.argwhere(free):
        for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int)):
            other = tuple(cell + step)
            if min(other) < 0 or max(other) >= view.size:
                continue
            if not free[other] and not occupied[other]:
                face = view.middles(cell) + 0.5 * view.cell * step
                if np.linalg.norm(links - face, axis=1).min() < BESIDE:
                    found.add(tuple(np.round(face, 6)))
    return found


def looked_at(points):
    """A view of cells that are seen from above, all free up to some points."""
    view, cells = ag.CellView((0, 0, 0.5), 0.05, 64), ag.CellMap((0, 0, 0.5), 0.05, 64)
    for stamp in (1.0, 1.1, 1.2):
        cells.points(points, (0, 0, 1.9), stamp)
    while len(changes := cells.take_deltas()):
        view.apply(changes)
    return view


def test_the_frontier_is_between_known_free_and_unknown_cells_beside_the_links():
    side = np.linspace(-0.3, 0.3, 40)
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    view = looked_at(np.stack([x, y, 0.0 * x], axis=1))
    assert view.known_free().sum() > 500 and view.occupied().sum() > 50
    links = np.array([(0.1, 0.0, 0.4), (-0.2, 0.1, 0.5)])
    found = frontier(view, links)
    assert 100 < len(found) < MOST_FACES
    assert set(map(tuple, np.round(found, 6))) == frontier_of(view, links)
    assert not len(frontier(view, links + 5.0))


def test_the_page_gets_a_bounded_number_of_faces():
    rng = np.random.default_rng(2)
    view = ag.CellView((0, 0, 0.5), 0.025, 128)
    view.claims.unknown.words[:] = rng.integers(
        0, 2**64, len(view.claims.unknown.words), np.uint64
    )
    links = np.array([(0.1, 0.0, 0.4)])
    found = frontier(view, links)
    assert len(found) == MOST_FACES
    far = np.linalg.norm(found - links, axis=1)
    assert far.max() < BESIDE and (np.diff(far) >= 0.0).all()


def test_edges_of_a_view_enclose_what_its_sensor_sees(scene):
    sensor = scene.sensors["top"]
    edges = view_edges(sensor)
    assert edges.shape == (8, 2, 3)
    ends = edges[:4, 1]
    assert ends[:, 2] == pytest.approx(min(LONGEST, sensor.range[1]))
    columns, rows = sensor.zones
    corner = np.array([0.5 * columns, 0.5 * rows]) / sensor.focal
    assert np.abs(ends[:, :2]).max(axis=0) == pytest.approx(LONGEST * corner, rel=1e-6)


def test_a_pair_of_a_sensed_cell_is_drawn_without_a_primitive(scene):
    server = viser.ViserServer(port=0, verbose=False)
    try:
        world = World(server, scene)
        shells = Shells(world)
        pair = SimpleNamespace(
            primitive_a=world.tables.labels[5], primitive_b=SENSED, needed=0.05,
            contract=False, headroom=0.1, time_left=1.0,
        )  # fmt: skip
        verdict = SimpleNamespace(level=ag.Level.CLEAR)
        shells._draw(SimpleNamespace(pairs=[pair], verdict=verdict))
        assert list(shells.nodes) == [5]
    finally:
        server.stop()
