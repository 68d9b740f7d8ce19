"""The page of mistakes is written from the rows that the tests of each door play."""

from mistakes.page import DOORS, PAGE, page


def test_the_page_has_every_row():
    hint = "run `python -m mistakes.page` in tests/"
    assert PAGE.read_text(encoding="utf-8") == page(), hint


def test_every_row_has_a_value_a_place_and_a_remedy():
    for mistakes, _ in DOORS.values():
        for kind, mistake in mistakes.items():
            assert all(part.strip() for part in mistake[:3]), kind


def test_units_are_checked_at_every_door():
    for door, (mistakes, _) in DOORS.items():
        for unit in ("degrees", "millimetres"):
            assert any(unit in kind for kind in mistakes), (door, unit)
