"""The measurements of docs/room.md: what they rest on."""

import numpy as np
import pytest

from armguard import bay_scene
from armguard.robot.stopping import stop_travel
from episodes.follower import Arms
from room import walls
from room.approaches import next_approach
from room.lines import FASTEST, PERIOD, ruler_of
from room.slides import slide_figures


def test_an_approach_ends_in_contact_and_can_be_driven():
    ruler = ruler_of(bay_scene())
    approach = next_approach(ruler, np.random.default_rng(3), "fixture")
    samples = list(approach.line.drive(FASTEST))
    q, v = (np.array([s[k] for s in samples]) for k in (0, 1))
    assert (np.abs(v) <= Arms(ruler.tables).joined("velocity")).all()
    accelerations = np.abs(np.diff(v, axis=0)) / PERIOD
    figures = bay_scene("path").robots["left"].stopping
    assert (accelerations <= figures.acceleration.min()).all()
    assert np.abs(np.diff(q, axis=0) - PERIOD * v[:-1]).max() < 1e-5
    assert ruler.judge_at_rest(q[-1]).nearest.distance < 0.005


def test_two_arms_head_on_keep_their_floor_and_not_much_more():
    figures = slide_figures(**walls.BAY)
    found = walls.gap_at_stop(walls.together(figures), 0.25)
    assert found["contacts"] == 0
    assert walls.FLOOR - 1e-9 <= found["least"] < walls.FLOOR + 0.002


def test_a_fixed_buffer_of_what_a_stop_takes_is_enough_and_less_is_not():
    figures = slide_figures(**walls.ARMS["one deceleration"])
    speed = walls.SPEEDS[0]
    takes = stop_travel(figures, 0, speed, period=PERIOD).travel
    assert walls.kept_by(figures, takes + 5e-4, speed)
    assert not walls.kept_by(figures, takes - 5e-4, speed)


def test_a_run_that_is_stopped_before_it_has_its_speed_is_none():
    track = walls.together(slide_figures(**walls.BAY))
    with pytest.raises(RuntimeError, match="on its way"):
        track.worst_run(track.start_of(0.02), 0.4)
