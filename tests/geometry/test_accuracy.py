"""No pair of kinds gets worse than docs/accuracy.json says.

The rule: over the first pairs of every regime of the campaign, drawn again, no figure
exceeds GROWTH times the worst the campaign found over all of its pairs, plus SLACK for
what another processor rounds otherwise. Better figures come into force when the
campaign is run again (`make accuracy`), which writes the file. In it, nothing may be
worse than the targets.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from accuracy.judge import (
    FIGURES,
    MISSED,
    NAMES,
    TARGETS,
    figures,
    judge_pairs,
    swallowed,
)
from accuracy.regimes import REGIMES, draw

RESULTS = Path(__file__).parents[2] / "docs" / "accuracy.json"

KNOWN = json.loads(RESULTS.read_text("utf-8"))["kinds"]

# How much worse than the campaign's worst a figure may be [-].
GROWTH = 3.0

# What rounding alone may do to a figure that is 0 in the campaign [-].
SLACK = 1e-14

# Pairs a regime, of each pair of kinds; and of them, measured with 50 digits.
PAIRS = 8
EXACT = 40


def test_the_page_knows_every_pair_of_kinds():
    assert list(KNOWN) == list(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_no_figure_is_worse_than_published(name):
    cases = [(regime, k) for regime in REGIMES for k in range(PAIRS)]
    pairs = [draw(*NAMES[name], *case) for case in cases]
    batch = judge_pairs(*NAMES[name], pairs, list(range(len(cases))))
    for figure, values in figures(batch, EXACT).items():
        known = ~np.isnan(values)
        if not known.any():
            continue
        k = int(np.where(known, values, -1.0).argmax())
        most = GROWTH * KNOWN[name][figure]["worst"] + SLACK
        assert values[k] <= most, (figure, *cases[k])


@pytest.mark.parametrize("figure", FIGURES)
def test_what_is_published_meets_the_targets(figure):
    if figure not in TARGETS:
        pytest.skip("part of another figure")
    missed = {
        (figure, name): entry[figure]["worst"]
        for name, entry in KNOWN.items()
        if not entry[figure]["worst"] <= TARGETS[figure]
    }
    # Those that are known, and published with their reasons, are single pairs in a
    # million, and no further off than this.
    assert set(missed) == {key for key in MISSED if key[0] == figure}
    assert max(missed.values(), default=0.0) <= 4.0 * TARGETS[figure]


@pytest.mark.parametrize("name", NAMES)
def test_no_nan_is_swallowed(name):
    tried, missed = swallowed(*NAMES[name])
    assert tried > 0
    assert missed == 0
