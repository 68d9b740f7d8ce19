"""A coordination on the page: items, labels, and the state in words."""

from types import SimpleNamespace

import numpy as np
import pytest
import viser

import armguard as ag
from armguard.scene.compile import compile_scene
from armguard.scene.conveyor import conveyor_path
from armguard.scene.poses import body_poses
from armguard.view import line_items
from armguard.view.line_items import ABOVE, ASKS, BELOW, ENDED, LineItems
from armguard.view.world import World

# The left arm's tool where its plans begin, by Pinocchio [m].
TOOL = (-0.3719, -0.5447, 0.5245)


def item(job, robot="", held=False, xyz=(0.0, -1.0, 0.12), moves=(0.0, 0.2, 0.0)):
    return {"job": job, "xyz": xyz, "moves": moves, "robot": robot, "held": held}


def robot(name, yields=False):
    does = "goes to item 2"
    return {"name": name, "job": 2, "share": 0.5, "yields": yields, "does": does}


class Page:
    """Items on a page, at a time that a test sets."""

    def __init__(self, server, monkeypatch):
        scene = ag.load_scene(conveyor_path())
        tables = compile_scene(scene)
        self.answer, self.now, self.published = None, 0.0, []
        monkeypatch.setattr(line_items.time, "monotonic", lambda: self.now)
        ask = lambda: self.answer  # noqa: E731
        self.items = LineItems(World(server, scene), ask, self.published.append)
        poses = body_poses(tables, tables.home)
        self.cycle = SimpleNamespace(frame=SimpleNamespace(poses=poses))

    def draw(self, now):
        self.now = now
        self.items.follow(self.cycle, now)
        return self.items.nodes


@pytest.fixture
def page(monkeypatch):
    server = viser.ViserServer(port=0, verbose=False)
    yield Page(server, monkeypatch)
    server.stop()


def test_items_move_with_the_belt_between_two_answers_and_with_the_arm_that_has_one(
    page,
):
    page.answer = {"items": [item(1, "left", held=True), item(2)], "robots": []}
    page.draw(10.0)
    nodes = page.draw(10.0 + 0.5 * ASKS)
    moved = np.array([0.0, -1.0 + 0.2 * 0.5 * ASKS, 0.12])
    assert nodes[2].position == pytest.approx(moved + BELOW)
    assert nodes["item 2"].position == pytest.approx(moved + BELOW + ABOVE)
    assert nodes[1].position == pytest.approx(np.array(TOOL) + BELOW, abs=2e-3)
    assert (nodes["item 1"].text, nodes["item 2"].text) == ("item 1 for left", "item 2")
    page.answer = {"items": [item(2)], "robots": [robot("right", yields=True)]}
    nodes = page.draw(10.0 + 2.0 * ASKS)
    assert set(nodes) == {2, "item 2", "right"}
    assert nodes["right"].text == "right yields"


def test_the_words_of_a_coordination_that_ended_stay_and_its_items_go(page):
    assert page.published == [{"robots": []}]
    assert not page.draw(1.0) and len(page.published) == 1
    page.answer = {"items": [item(3)], "robots": [robot("left")], "fault": "late"}
    assert page.draw(2.0)
    shown = page.published[-1]
    assert not shown["ended"] and shown["fault"] == "late"
    assert shown["robots"][0]["colour"].startswith("#")
    page.answer = None
    assert page.draw(2.0 + 0.5 * ENDED)
    assert not page.published[-1]["ended"]
    assert not page.draw(2.5 + ENDED)
    assert page.published[-1]["ended"] and page.published[-1]["fault"] == "late"


def test_robots_of_another_scene_are_left_out(page):
    page.answer = {"items": [], "robots": [robot("other", yields=True)]}
    assert not page.draw(1.0)
    assert page.published[-1]["robots"] == []
