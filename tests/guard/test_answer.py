"""The answer of a cycle by name: the places are those the kernels write to."""

import numpy as np
import pytest

from approach import ball_guard
from armguard.guard import Level, Reason, layout
from armguard.guard.answer import COUNTED, NEAR_ROW, ROBOT_ROW, Answer, stop_answer

# Fields whose place in `layout` has another name.
ROBOT_NAMES = {name: f"ROBOT_{name.upper()}" for name in ROBOT_ROW.names}
NEAR_NAMES = {name: name.upper() for name in NEAR_ROW.names} | {"distance": "WITNESS"}
BEHIND_DISTANCE = {"point_a": 1, "point_b": 4, "normal": 7}


@pytest.mark.parametrize(
    ("row", "names", "width"),
    [
        (ROBOT_ROW, ROBOT_NAMES, layout.ROBOT_WIDTH),
        (NEAR_ROW, NEAR_NAMES, layout.NEAR_WIDTH),
    ],
    ids=["robot", "near pair"],
)
def test_every_field_is_at_its_place_of_the_layout(row, names, width):
    assert row.itemsize == 8 * width
    for name, (_, offset, *_) in row.fields.items():
        if name in BEHIND_DISTANCE:
            place = layout.WITNESS + BEHIND_DISTANCE[name]
        else:
            place = getattr(layout, names[name])
        assert offset == 8 * place, name


def test_counts_are_in_the_order_of_the_layout():
    numbers = np.zeros(layout.HEADER)
    numbers[layout.PAIRS_TESTED : layout.PAIRS_APART + 1] = range(1, 13)
    names = ball_guard().names
    counts = Answer(np.append(numbers, np.zeros(200)), names).counts
    places = ("PAIRS_TESTED", "SPLITS", "MERGES", "PAIRS_REFINED", "PAIRS_APART")
    for place in places:
        name = place.lower()
        assert getattr(counts, name) == numbers[getattr(layout, place)], name
    assert len(COUNTED) == layout.PAIRS_APART + 1 - layout.PAIRS_TESTED
    assert counts.pairs_skipped == names.tables.checkable_pairs - counts.pairs_tested


def test_a_cycle_that_was_not_judged_stops_every_robot():
    guard = ball_guard()
    answer = Answer(stop_answer(guard.names, Reason.WRONG_INPUT), guard.names)
    assert (answer.robots["level"] == Level.STOP).all()
    assert len(answer.near) == 0
    assert answer.nearest == -1


def test_positions_that_are_none_are_a_stop_at_rest_as_well():
    guard = ball_guard()
    verdict = guard.judge_at_rest([1.0, 2.0, 3.0])
    assert verdict.level is Level.STOP
    assert verdict.reason is Reason.WRONG_INPUT
    assert set(verdict.levels.values()) == {Level.STOP}
    assert "shape (3,)" in verdict.why
