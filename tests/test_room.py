"""The measurements of docs/room.md: what they rest on."""

import numpy as np
import pytest

from armguard import bay_scene
from armguard.robot.stopping import stop_travel
from room import co_braking, least_buffer
from room.approaches import bay_ruler, next_approach
from room.lines import FASTEST, PERIOD, tops
from room.slides import slide_figures, worst_run


def test_an_approach_ends_in_contact_and_can_be_driven():
    ruler = bay_ruler()
    approach = next_approach(ruler, np.random.default_rng(3), "fixture")
    samples = list(approach.line.drive(FASTEST))
    q, v = (np.array([s[k] for s in samples]) for k in (0, 1))
    assert (np.abs(v) <= tops(ruler.tables)).all()
    accelerations = np.abs(np.diff(v, axis=0)) / PERIOD
    figures = bay_scene("path").robots["left"].stopping
    assert (accelerations <= figures.acceleration.min()).all()
    assert np.abs(np.diff(q, axis=0) - PERIOD * v[:-1]).max() < 1e-5
    assert ruler.judge_at_rest(q[-1]).nearest.distance < 0.005


def test_two_arms_head_on_keep_their_floor_and_not_much_more():
    figures = slide_figures(**co_braking.BAY)
    told = co_braking.gap_at_stop(co_braking.together(figures), figures, 0.25)
    assert told["contacts"] == 0
    assert co_braking.FLOOR - 1e-9 <= told["least"] < co_braking.FLOOR + 0.002


def test_a_fixed_buffer_of_what_a_stop_takes_is_enough_and_less_is_not():
    figures = slide_figures(**least_buffer.ARMS["one deceleration"])
    speed = least_buffer.SPEEDS[0]
    takes = stop_travel(figures, 0, speed, period=PERIOD).travel
    assert least_buffer.kept_by(figures, takes + 5e-4, speed)
    assert not least_buffer.kept_by(figures, takes - 5e-4, speed)


def test_a_run_that_is_stopped_before_it_has_its_speed_is_none():
    figures = slide_figures(**co_braking.BAY)
    near = [co_braking.start_of(0.02)] * 2
    with pytest.raises(RuntimeError, match="on its way"):
        worst_run(co_braking.together(figures), figures, near, 0.4, co_braking.gap_of)
