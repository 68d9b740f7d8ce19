"""Views of a map and of a slice: charts, and the robots where one is dragged to."""

import json
from base64 import b64decode

import numpy as np
import pytest

from armguard.maps.coordination import coordination_map
from armguard.maps.slices import configuration_slice
from armguard.prove.tile_search import FREE, TOUCHING, UNKNOWN
from armguard.view.charts import LOCKED, coarser
from armguard.view.mapped_view import MappedView, SlicedView
from crossing import cell_of, plan_through

# Turns of the first joints: each arm swings into the space of the others and back.
TURNS = {
    "left": (0.6, -1.0, 0.6),
    "right": (-0.6, 1.0, -0.6),
    "third": (-1.2, 0.0, -1.2),
}


@pytest.fixture(scope="module", params=[2, 3])
def shown(request):
    """A view of a map of two and of three arms, and what it shows."""
    robots = tuple(TURNS)[: request.param]
    scene = cell_of(robots)
    plans = {name: plan_through(scene, name, TURNS[name]) for name in robots}
    cell = coordination_map(scene, **plans)
    view = MappedView(scene, cell, cell.schedule(), page_port=0)
    yield view, cell
    view.close()


def state_of(view):
    """What the page gets of the present cycle."""
    view._published = -np.inf
    view.step()
    return json.loads(view.page.newest["state"])


def drag(view, **times):
    """What the page gets once a diagram was dragged to times of plans."""
    view._receive("page", {"type": "place", "places": times})
    return state_of(view)


def test_the_page_gets_each_diagram_with_its_schedule(shown):
    view, cell = shown
    each = json.loads(view.page.newest["charts"])["charts"]
    assert [tuple(one["axes"]) for one in each] == [d.robots for d in cell.diagrams]
    schedule = cell.schedule()
    for one, diagram in zip(each, cell.diagrams, strict=True):
        cells = np.frombuffer(b64decode(one["cells"]), np.uint8).reshape(one["shape"])
        assert max(cells.shape) <= 250 and set(np.unique(cells)) <= {0, 1, 2, LOCKED}
        every = round(one["step"] / diagram.step)
        i, j = np.nonzero(diagram.labels == TOUCHING)
        # What is forbidden stays so, and free cells are free as a whole.
        assert (cells[i // every, j // every] == TOUCHING).all()
        i, j = np.nonzero(np.repeat(np.repeat(cells, every, 0), every, 1) == FREE)
        inside = (i < diagram.labels.shape[0]) & (j < diagram.labels.shape[1])
        assert (diagram.labels[i[inside], j[inside]] == FREE).all()
        own = [schedule.robots.index(name) for name in diagram.robots]
        assert one["way"] == schedule.plan_times[:, own].round(3).tolist()


def test_a_drag_moves_both_robots_and_the_others_stay(shown):
    view, cell = shown
    view._receive("page", {"type": "seek", "at": 0.5 * view.source.length})
    before = state_of(view)["places"]
    at = cell.schedule().at(view.source.position)
    assert list(before.values()) == pytest.approx(at.tolist())
    view._receive("page", {"type": "play"})
    for times in ({"left": 1.25, "right": 0.5}, {"left": 99.0, "right": -1.0}):
        state = drag(view, **times)
        places = {name: float(np.clip(t, 0.0, 2.0)) for name, t in times.items()}
        assert not state["playing"]
        assert {name: state["places"][name] for name in times} == places
        assert all(
            state["places"][name] == pytest.approx(time, abs=0.1)
            for name, time in before.items()
            if name not in times
        )
        names, q = view.world.scene.q_names, view._still[1].q
        for robot, time in state["places"].items():
            own = [name.startswith(f"{robot}/") for name in names]
            tube = cell.plans[robot].plan.tube
            assert q[own] == pytest.approx(tube.at(np.array([time]))[0, own])
    # Whatever else pages send leaves them there; the time line leads them back.
    view._receive("page", {"type": "pulse", "held": False})
    assert state_of(view)["places"]["left"] == 2.0
    with pytest.raises(ValueError, match="nan is no place of 'left'"):
        drag(view, left=float("nan"))
    view._receive("page", {"type": "seek", "at": 0.0})
    assert set(state_of(view)["places"].values()) == {0.0}


def test_words_say_whether_the_map_permits_a_place(shown):
    view, cell = shown
    diagram = cell.diagrams[0]
    assert diagram.robots == ("left", "right")
    middle = drag(view, left=1.0, right=1.0)
    assert not cell.allowed(1.0, 1.0)
    assert "left at 1.00 s, right at 1.00 s" in middle["recorded"]
    assert "forbidden: left/" in middle["recorded"]
    assert middle["word"] == "STOP"
    start = drag(view, left=0.0, right=0.0)
    assert cell.allowed(0.0, 0.0)
    assert "left and right may be there together" in start["recorded"]
    locked = np.argwhere(cell.deadlocks(diagram))
    if len(locked):
        i, j = locked[len(locked) // 2] + 0.5
        there = drag(view, left=i * diagram.step, right=j * diagram.step)
        assert "but there is no way out" in there["recorded"]


def test_of_several_cells_the_one_that_forbids_most_remains():
    labels = np.array([[FREE, LOCKED, UNKNOWN, LOCKED, FREE]], dtype=np.uint8)
    labels = np.concatenate((labels, np.full((1, 5), FREE, np.uint8)))
    labels[1, 3] = TOUCHING
    assert coarser(labels, 2).tolist() == [[LOCKED, TOUCHING, FREE]]
    assert coarser(labels[:, :3], 3).tolist() == [[UNKNOWN]]


def test_a_slice_moves_its_joints_and_leaves_all_others_at_home():
    scene = cell_of()
    joints = "left/joint1", "left/joint2"
    found = configuration_slice(scene, joints)
    view = SlicedView(scene, found, page_port=0)
    try:
        assert list(view.places()) == list(joints)
        assert state_of(view)["recorded"].endswith("the others at home: free")
        forbidden = np.argwhere(found.labels == TOUCHING)
        i, j = forbidden[len(forbidden) // 2] + 0.5
        at = np.array([i, j]) * found.step + found.lower
        state = drag(view, **dict(zip(joints, at.tolist(), strict=True)))
        assert state["recorded"].endswith("the others at home: forbidden")
        assert state["word"] == "STOP"
        q = scene.home.copy()
        q[[scene.q_names.index(joint) for joint in joints]] = at
        assert view._still[1].q == pytest.approx(q)
        [chart] = json.loads(view.page.newest["charts"])["charts"]
        assert chart["titles"] == [f"{joint} [rad]" for joint in joints]
        assert (chart["lower"], chart["upper"]) == ([*found.lower], [*found.upper])
    finally:
        view.close()
