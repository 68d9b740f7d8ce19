"""Motion among objects that the scene has, or that sensors alone know."""

from dataclasses import replace

import numpy as np
import pytest

import armguard as ag
from armguard.scene.compile import compile_scene
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from freedom import runs
from freedom.runs import foreign_gap, run
from freedom.worlds import bay, drawn_world, empty_bay, modelled_bay
from freedom_campaign import is_broken, sensed_episode, summed_up


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(runs, "SECONDS", 2.0)


def test_the_objects_of_a_world_are_off_the_arms_at_home():
    for seed in range(3):
        world, again = drawn_world(seed), drawn_world(seed)
        assert np.array_equal(world.edges, again.edges)
        scene = modelled_bay(world)
        judge = Judge(scene, compile_scene(scene))
        assert foreign_gap(judge, scene.home) == SIGHT


def test_arms_move_among_objects_that_sensors_alone_know():
    found = summed_up([sensed_episode(0.025, 0.0, 0)])
    assert found["contacts"] == {"sensors": 0}
    assert found["modelled_contacts"] == 0
    assert not is_broken(found)
    assert found["done"]["sensors"] > 0.5 * found["modelled"]


def test_arms_that_know_nothing_touch_an_object_in_their_way():
    world, (scene, judge) = drawn_world(1), empty_bay()
    judge.place(scene.home + world.way(1.6))
    hand = judge.data.geom_xpos[judge.owners.index("left/link7")]
    blind = replace(
        world, edges=np.full((1, 3), 0.1), poses=(ag.Pose(xyz=hand.tolist()),)
    )
    found = run(blind, ag.Guard(bay(), self_test=False), 1)
    assert found["least"] < 0.0
