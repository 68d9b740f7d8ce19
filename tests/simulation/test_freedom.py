"""Motion among objects that the scene has, or that sensors alone know."""

from dataclasses import replace

import numpy as np
import pytest

import armguard as ag
from armguard.scene.compile import compile_scene
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from evading.episode import Plant
from freedom import runs
from freedom.losses import least_on_way
from freedom.runs import Sensing, foreign_gap, run
from freedom.sight import CLEAR, HIDDEN, IN_PART, WHOLE, Frame, Seen, Sight
from freedom.worlds import bay, drawn_world, empty, modelled, sensing_bay
from freedom_campaign import is_broken, sensed_episode, summed_up

CAMERAS = ("over_left", "over_right")


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(runs, "SECONDS", 2.0)


def test_the_objects_of_a_world_are_off_the_arms_at_home():
    for seed in range(3):
        world, again = drawn_world(seed), drawn_world(seed)
        assert np.array_equal(world.edges, again.edges)
        scene = modelled(world)
        judge = Judge(scene, compile_scene(scene))
        assert foreign_gap(judge, scene.home) == SIGHT


def test_arms_move_among_objects_that_sensors_alone_know():
    found = summed_up([sensed_episode(0.025, 0.0, 0)])
    assert found["contacts"] == {"sensors": 0}
    assert found["modelled_contacts"] == 0
    assert not is_broken(found)
    assert found["done"]["sensors"] > 0.5 * found["modelled"]


def test_arms_that_know_nothing_touch_an_object_in_their_way():
    world, (scene, judge) = drawn_world(1), empty("bay")
    judge.place(scene.home + world.way(1.6))
    hand = judge.data.geom_xpos[judge.owners.index("left/link7")]
    blind = replace(
        world, edges=np.full((1, 3), 0.1), poses=(ag.Pose(xyz=hand.tolist()),)
    )
    found = run(blind, ag.Guard(bay(), self_test=False), 1)
    assert found["least"] < 0.0


class Wall:
    """Judges a joint that moves towards a wall, at the value of its position [m]."""

    owners = ("arm/link", "foreign0")

    def __init__(self, wall):
        self._wall, self.far = wall, 0.0

    def measure(self, q):
        self.far = max(self.far, q[0])
        return np.array([self._wall - q[0]]), np.array([[0, 1]])


def test_the_way_of_a_stop_ends_where_a_steady_deceleration_ends_it():
    q, v, brake = np.array([0.2, 1.0]), np.array([0.5, -0.1]), np.array([2.0, 4.0])
    # 0.1 s at 0.5 m/s, then v² / 2a.
    end = 0.2 + 0.05 + 0.0625
    judge = Wall(0.4)
    least = least_on_way(judge, "arm", q, v, 0.1, brake)
    assert judge.far == pytest.approx(end, abs=1e-12)
    assert least == pytest.approx(0.4 - end, abs=1e-12)
    assert least_on_way(judge, "other", q, v, 0.1, brake) == np.inf


@pytest.mark.parametrize(("beyond", "needless"), [(-0.002, False), (0.002, True)])
def test_a_stop_is_needless_if_its_way_keeps_the_buffer(beyond, needless):
    plate = ag.Pose(xyz=(-0.4, 0.0, 3.0))
    world = replace(drawn_world(0), edges=np.array([[2.0, 2.0, 0.1]]), poses=(plate,))
    judge, scene = empty("bay")[1], bay()
    judge.place(scene.home)
    arm = [g for g, name in enumerate(judge.owners) if name.startswith("left/")]
    # The plate is above the highest point of the arm at rest.
    top = max(highest(judge, g) for g in arm)
    plate = ag.Pose(xyz=(-0.4, 0.0, top + scene.buffer + beyond + 0.05))
    world = replace(world, poses=(plate,))
    sensing = Sensing(world, 0.025, 0.0, 0)
    plant = Plant(sensing, scene.home, np.random.default_rng(0))
    assert sensing.losses.is_needless(plant, "left") is needless


def highest(judge, geom):
    """Greatest height of a capsule [m]."""
    along = judge.data.geom_xmat[geom].reshape(3, 3)[2, 2]
    radius, half = judge.model.geom_size[geom, :2]
    return judge.data.geom_xpos[geom, 2] + half * abs(along) + radius


def seen_cell(world, middle):
    """What the cameras above the arms see of a cell of 20 mm."""
    scene = sensing_bay(0.025, zones=False)
    sight = Sight(scene, modelled(world), 0.05)
    found = [sight.seen(np.array(middle), 0.02, Frame(n, scene.home)) for n in CAMERAS]
    return sight.fills(np.array(middle), 0.02), max(found)


def test_what_cameras_see_of_cells_about_a_box():
    # The camera over the left arm is at (-0.4, 0.7, 2.3) and looks down.
    box = ag.Pose(xyz=(-0.4, 1.0, 1.0))
    world = replace(drawn_world(0), edges=np.full((1, 3), 0.2), poses=(box,))
    hidden = Seen(HIDDEN, 0, "a foreign object")
    assert seen_cell(world, (-0.4, 1.0, 1.0)) == (True, hidden)
    assert seen_cell(world, (-0.4, 1.046, 0.8)) == (False, hidden)
    assert seen_cell(world, (-0.4, 0.862, 1.6)) == (False, Seen(CLEAR, 27))
    # 4 mm beside the edge of the box, a third of a pixel.
    assert seen_cell(world, (-0.286, 1.0, 1.111)) == (False, Seen(WHOLE, 27))
    # The edge of the shadow is 125 mm off the middle, this cell's 120 to 140 mm.
    part = Seen(IN_PART, 18, "a foreign object")
    assert seen_cell(world, (-0.27, 1.046, 0.8)) == (False, part)
    # The middle of this one is in the shadow, which leaves a third of its points.
    mostly = Seen(HIDDEN, 9, "a foreign object")
    assert seen_cell(world, (-0.28, 1.046, 0.8)) == (False, mostly)
    assert seen_cell(world, (-0.4, 1.0, 2.4)) == (False, Seen())
