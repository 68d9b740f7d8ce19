"""Answers are compared on the same goals only, and what is left out is said."""

import json

import pytest
from matplotlib.figure import Figure

from episodes.kernels import kernels_of
from episodes.records import Digest, Records, ranges_of, replace
from reach.summary import compared, digest, legend, write_page

RUN = {
    "stops": [],
    "contact": None,
    "least": 0.0123456,
    "nominal": 2.0,
    "jerk_told": (10.0, 20.0),
    "jerk_true": (11.0, 21.0),
    "chatter": 0.0,
    "blocked": 0.25,
    "call": (1e-5, 2e-5, 3e-5),
}


def trial(seed, reached=3.0, road="straight"):
    run = {**RUN, "reached": reached}
    runs = {road: run} | ({"led": run} if road == "bends" else {})
    return digest({"seed": seed, "kind": "joints", "runs": runs})


def records_with(path, answers):
    kept = Records(path / "reach.json", lambda kind: f"{kind} 1", {})
    for answer, digests in answers.items():
        figures = {
            "episodes": len(digests),
            "seeds": ranges_of(d.seed for d in digests),
        }
        kept.add(f"bay/{answer}/goals", figures, digests)
    return kept


def test_goals_that_not_all_had_are_left_out(tmp_path):
    none = Digest(2, "left out: no way was found")
    ours = [trial(0), trial(1, reached=None), none, trial(3, road="bends")]
    kept = records_with(tmp_path, {"deflect": [*ours, trial(4)], "slow": ours})
    ((what, scene, rows),) = compared(kept)
    assert (what, scene, list(rows)) == ("goals", "bay", ["deflect", "slow"])
    for row in rows.values():
        assert (row["drawn"], row["not_by_all"]) == (4, 1)
        assert row["left_out"] == {"no way was found": 1}
        assert (row["straight"]["goals"], row["straight"]["reached"]) == (2, 1)
        assert row["bends"]["goals"] == row["led"]["goals"] == 1
        assert row["straight"]["least_mm"] == pytest.approx(12.35)
        assert row["straight"]["time_by_nominal"] == 1.5


def test_the_page_keeps_rows_that_cannot_be_compared_apart(tmp_path):
    (tmp_path / "images").mkdir()
    old = {"drawn": 9, "episodes": 9, "straight": None, "bends": None, "led": None}
    slides = {"episodes": 0}
    kinds = {"bay/stop/goals": old, "panda_shelf/slow/slides": slides}
    replace(tmp_path / "reach.json", json.dumps(kinds))
    write_page(records_with(tmp_path, {"deflect": [trial(0), trial(1)]}), tmp_path)
    same, others = (tmp_path / "reach.md").read_text("utf-8").split("## Other runs")
    assert "bay: 2 goals with each of deflect; left out none." in same
    assert f"| {kernels_of()[:8]} |" in same
    assert "| panda_shelf | slow | 0 | no start was found |" in others
    assert "not recorded *" in others
    # The pictures say how few goals they rest on, and what no scene has.
    assert "fewest and most: bay 2. Only in bay all responses" in others
    assert "in no scene: deflect, " in others


def test_a_legend_has_the_responses_of_all_scenes():
    figure = Figure()
    places = figure.subplots(1, 2)
    places[0].plot([0.0, 1.0], label="deflect")
    places[1].plot([0.0, 1.0], label="mink")
    places[1].plot([0.0, 2.0], label="deflect")
    legend(list(places))
    (drawn,) = figure.legends
    assert [text.get_text() for text in drawn.get_texts()] == ["deflect", "mink"]
