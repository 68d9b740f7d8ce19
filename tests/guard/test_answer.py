"""The answer of a cycle by name: the places are those the kernels write to."""

import numpy as np
import pytest

from approach import ball_guard
from armguard.guard import Level, Reason, layout
from armguard.guard.answer import COUNTED, Answer, NearNumbers, stop_answer
from armguard.guard.layout import IN_HEADER, Header, NearRow, RobotRow
from armguard.record import dtype_of

# Numbers of the header and of the rows in their order, `name:3` for a vector of three:
# recordings hold them.
ORDERS = {
    Header: "reason joint value near_count nearest pairs_tested pairs_kept "
    "pairs_filtered bodies_moved links_checked changed_leaf leaves_entered leaves_left "
    "splits merges pairs_refined pairs_apart robot least_time_left spans_tested "
    "terms:12",
    RobotRow: "level phase scale age cause urgency time force:3 torque:3 tool:3 delay",
    NearRow: "first second headroom buffer outer exact time_left time_to_contact proof "
    "envelope distance point_a:3 point_b:3 normal:3",
}


@pytest.mark.parametrize("row", ORDERS, ids=lambda row: row.__name__)
def test_every_number_is_at_its_place_of_the_layout(row):
    parts = [part.partition(":") for part in ORDERS[row].split()]
    expected = [
        (name, np.float64, *map(int, filter(None, [n]))) for name, _, n in parts
    ]
    assert dtype_of(row) == np.dtype(expected)


def test_counts_are_in_the_order_of_the_layout():
    numbers = np.zeros(layout.HEADER)
    first, last = IN_HEADER.pairs_tested, IN_HEADER.pairs_apart
    numbers[first : last + 1] = range(1, 13)
    names = ball_guard().names
    counts = Answer(np.append(numbers, np.zeros(200)), names).counts
    for name in ("pairs_tested", "splits", "merges", "pairs_refined", "pairs_apart"):
        assert getattr(counts, name) == numbers[getattr(IN_HEADER, name)], name
    assert len(COUNTED) == last + 1 - first
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


def test_the_numbers_of_a_near_pair_are_the_first_fields_of_its_row():
    fields = dtype_of(NearRow).names
    assert NearNumbers._fields == fields[: len(NearNumbers._fields)]
    assert fields[len(NearNumbers._fields)] == "point_a"
