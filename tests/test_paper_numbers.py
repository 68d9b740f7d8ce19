"""What docs/paper.md derives from the paper's figures, derived again."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "paper.md").read_text(encoding="utf-8")

INCH = 25.4  # [mm]
BUFFER = 1.2 * INCH
TOP_SPEED, TYPICAL_SPEED = 24.0, 6.0  # [in/s]
DECELERATION = 48.0  # [in/s²], 24 in/s to rest in 6 in


def rows_of_the_braked_stop():
    pattern = r"^" + r"\| ([\d.]+) " * 6 + r"\|$"
    return [
        tuple(map(float, row)) for row in re.findall(pattern, PAGE, flags=re.MULTILINE)
    ]


def test_the_page_has_its_table():
    assert len(rows_of_the_braked_stop()) == 4


@pytest.mark.parametrize("row", rows_of_the_braked_stop())
def test_a_braked_stop_needs_speed_times_reaction(row):
    delivery, detection, brake, at_top, at_typical, good_up_to = row
    seconds = (delivery + detection + brake) / 1000.0
    assert at_top == pytest.approx(TOP_SPEED * INCH * seconds, abs=0.05)
    assert at_typical == pytest.approx(TYPICAL_SPEED * INCH * seconds, abs=0.05)
    assert good_up_to == pytest.approx(BUFFER / INCH / seconds, abs=0.05)


def test_the_stops_are_not_one_deceleration():
    assert TOP_SPEED**2 / (2 * 6.0) == DECELERATION
    assert TOP_SPEED / DECELERATION == 0.5
    assert TYPICAL_SPEED**2 / (2 * DECELERATION) == 0.375
    assert TYPICAL_SPEED / DECELERATION == 0.125


def test_controlled_stops():
    (least_typical, most_typical, least_top, most_top) = map(
        float,
        re.search(
            r"within ([\d.]+) to ([\d.]+) mm, one at\s+24 in/s within "
            r"([\d.]+) to ([\d.]+) mm",
            PAGE,
        ).groups(),
    )
    for speed, reaction, told in (
        (TYPICAL_SPEED, 0.033, least_typical),
        (TYPICAL_SPEED, 0.110, most_typical),
        (TOP_SPEED, 0.033, least_top),
        (TOP_SPEED, 0.110, most_top),
    ):
        needed = INCH * (speed * reaction + speed**2 / (2 * DECELERATION))
        assert told == pytest.approx(needed, abs=0.05)
