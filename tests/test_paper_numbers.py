"""What docs/paper.md derives from the paper's figures, derived again."""

import re
from pathlib import Path

import numpy as np
import pytest

import paper_buffer
from armguard.robot.stopping.distance import brake_way

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
    for speed, reaction, stated in (
        (TYPICAL_SPEED, 0.033, least_typical),
        (TYPICAL_SPEED, 0.110, most_typical),
        (TOP_SPEED, 0.033, least_top),
        (TOP_SPEED, 0.110, most_top),
    ):
        needed = INCH * (speed * reaction + speed**2 / (2 * DECELERATION))
        assert stated == pytest.approx(needed, abs=0.05)


def stops_of_the_set():
    return {
        speed: paper_buffer.controlled_stop(speed * paper_buffer.INCH)
        for speed in (TOP_SPEED, TYPICAL_SPEED)
    }


def row_of(name):
    (row,) = re.findall(rf"^\| {name} \|(.*)\|$", PAGE, flags=re.MULTILINE)
    return [float(cell) for cell in row.split("|")]


def test_one_set_of_figures_reproduces_both_controlled_stops():
    ways, times = [], []
    for stop in stops_of_the_set().values():
        ways.append(stop.travel / paper_buffer.INCH)
        times.append(paper_buffer.stop_time(stop))
    assert ways[0] == pytest.approx(6.0, rel=0.06)
    assert 0.9 <= times[0] < 1.0
    assert 2.0 <= ways[1] <= 4.0
    assert times[1] == pytest.approx(1.0 / 3.0, rel=0.06)


@pytest.mark.parametrize(
    ("name", "way", "time"),
    [
        ("latency", lambda s: s.reaction, lambda s: s.reaction_time),
        ("ramp and deceleration", lambda s: s.braking, lambda s: s.braking_time),
        (
            "swing",
            lambda s: s.settle,
            lambda s: s.settle_time * s.settle / paper_buffer.SWING,
        ),
        ("all three", lambda s: s.travel, paper_buffer.stop_time),
    ],
)
def test_the_parts_of_the_stops_are_as_stated(name, way, time):
    stated = row_of(name)
    for k, stop in enumerate(stops_of_the_set().values()):
        assert stated[2 * k] == pytest.approx(way(stop) / paper_buffer.INCH, abs=0.0051)
        assert stated[2 * k + 1] == pytest.approx(time(stop), abs=0.0051)


def test_the_set_is_the_one_the_page_names():
    words = " ".join(PAGE.split())
    inch = paper_buffer.INCH
    for sentence in (
        f"latency {paper_buffer.LATENCY * 1e3:.0f} ms",
        f"speeds up by {paper_buffer.ACCELERATION / inch:.0f} in/s²",
        f"deceleration {paper_buffer.DECELERATION / inch:.0f} in/s²",
        f"a ramp of {paper_buffer.RAMP * 1e3:.0f} ms",
        f"a swing of {paper_buffer.SWING / inch:.1f} in that takes "
        f"{paper_buffer.SWING_TIME:.2f} s",
        f"at rest {paper_buffer.controlled_stop(0.0).travel * 1e3:.1f} mm remain",
        f"such a stop up to {paper_buffer.enough_up_to() / inch:.1f} in/s",
    ):
        assert sentence in words


def test_one_deceleration_is_the_row_before():
    assert row_of("one deceleration, 48 in/s²") == pytest.approx(
        [6.0, 0.5, 0.375, 0.125], abs=0.0051
    )


def test_what_shrinks_with_speed_leaves_a_quarter_at_most():
    """Without speeding up in the latency no set reaches the paper's 2 in."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        latency, ramp = rng.uniform(0.0, 0.25), rng.uniform(0.0, 0.5)
        deceleration, swing = 10.0 ** rng.uniform(1.0, 4.0), rng.uniform(0.0, 6.0)
        ways = [
            speed * latency + brake_way(speed, deceleration, ramp)[0] + swing * share
            for speed, share in ((TOP_SPEED, 1.0), (TYPICAL_SPEED, 0.25))
        ]
        assert ways[1] <= ways[0] / 4.0 + 1e-12
    assert TYPICAL_SPEED / 3.0 == 2.0


def test_a_brake_goes_on_for_its_own_time():
    least, most = map(
        float, re.search(r"are ([\d.]+) to ([\d.]+) mm, if", PAGE).groups()
    )
    assert least == pytest.approx(TOP_SPEED * INCH * 0.010, abs=0.05)
    assert most == pytest.approx(TOP_SPEED * INCH * 0.020, abs=0.05)


def test_the_plot_is_there():
    assert paper_buffer.IMAGE.read_bytes()[:4] == b"\x89PNG"
