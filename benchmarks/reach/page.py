"""Writes docs/reach.md from the figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from reach.answers import ANSWERS
from reach.plots import draw_goals, draw_slides
from reach.scenes import SCENES
from reach.summary import ROADS

Results = Mapping[str, Any]

# Share of goals with a certified way that are to be reached without a stop.
TARGET = 0.95

WORDS = {
    "straight": "The operator's own way is certified",
    "bends": "Only a bent way is certified, and the operator steers straight",
    "led": "The same goals, the operator following the certified way",
}

MEASURED = """
Operators steer both arms at a goal, at 0.2 to 0.6 of their speed limits, and plan
nothing. Starts and goals are random configurations that keep every buffer, starts with
20 mm to spare; two goals in three are asked for in joint velocities, one in three in
twists of the tools. A goal has a *certified way* if `Guard.check_path` clears the way
the operator steers himself (*straight*), or a short RRT-connect finds another one that
it clears (*bends*). Goals without are left out: {left_out}.

The robots follow what they are told by a delay of up to `command`, within their
acceleration and with an error of up to 0.9 `tracking_error`; measurements are up to
`sensing` old and wrong by up to the declared errors (constant, alternating or noise);
stops are as declared. All of it is drawn by seed. A cycle takes 1 ms. MuJoCo judges
distances (at most 60 mm) and contacts on the true states.

*Reached* is 0.02 rad in every joint, or 10 mm and 3 degrees; a trial ends when nothing
has come nearer for 1.5 s, or after four stops. After a stop the operator lets go for
0.3 s and tries again. *Chatter* is how often the acceleration of a joint changes its
sign where something else is told than is asked for, of the joint that does so most.

`field` is told the goal and led there by its own potentials, at no more than 0.3 of the
top speeds; it follows no way, so it is not among those that are led along one.

`mink` is the velocity-damper QP of that name with the settings it has by default; in
`mink_early` its limits begin at 100 mm and let a pair lose all but 1/e in 60 ms, which
is our own. It knows of no accelerations, delays or errors, and stops nothing. Public
scenes: cylinders are the boxes round them.
"""

LIMITS = """
The counts in the tables are what was run, not what was planned: where they are small
so is what they tell. Goals whose way bends are a hard test of who steers straight: in a
local minimum nobody gets there without planning, so `led` is what a filter can be held
to, and `bends` what it does to somebody who does not look. Operators pause all robots
after a stop of one. Times of calls are those of a machine that did other work.
"""


def write_page(results: Results, docs: Path) -> None:
    """Write the page and its plots."""
    goals, slides = results["goals"], results["slides"]
    draw_goals(goals, docs / "images" / "reach_goals.png")
    draw_slides(slides, docs / "images" / "reach_slides.png")
    text = "\n".join(
        [
            "# Who gets there",
            "",
            "Written by `python benchmarks/reach_goals.py`, from "
            "[reach.json](reach.json).",
            *(line for road in ROADS for line in goal_section(goals, road)),
            "",
            "![goals reached](images/reach_goals.png)",
            *slide_section(slides),
            "",
            "![ways along surfaces](images/reach_slides.png)",
            *time_section(goals),
            "",
            "## What is measured",
            MEASURED.format(left_out=left_out(goals)).rstrip(),
            "",
            "## Limits",
            LIMITS.rstrip(),
            "",
        ]
    )
    (docs / "reach.md").write_text(text, encoding="utf-8")


def goal_section(goals: Results, road: str) -> list[str]:
    """Goals by one road."""
    head = (
        "scene",
        "answer",
        "goals",
        "reached without a stop",
        "reached",
        "stops",
        "contacts",
        "least [mm]",
        "time / free",
        "jerk told, true [rad/s³]",
        "chatter [1/s]",
        "blocked",
    )
    rows = []
    for scene, answer, figures in each(goals):
        row = figures.get(road)
        if row:
            share = row["reached_without_stop"] / row["goals"]
            rows.append(
                (
                    scene,
                    answer,
                    row["goals"],
                    f"{row['reached_without_stop']} ({share:.0%})",
                    row["reached"],
                    row["stops"],
                    row["contacts"],
                    f"{row['least_mm']:.1f}",
                    number(row["time_by_nominal"], "{:.2f}"),
                    f"{row['jerk_told_rms']:.0f}, {row['jerk_true_rms']:.0f}",
                    f"{row['chatter_median']:.0f}",
                    f"{row['blocked']:.0%}",
                )
            )
    return ["", f"## {WORDS[road]}", "", *table(head, rows)] if rows else []


def slide_section(slides: Results) -> list[str]:
    """How far tools slide."""
    head = (
        "scene",
        "answer",
        "slides",
        "way along / free, median",
        "least",
        "stops",
        "contacts",
        "least distance [mm]",
        "chatter [1/s]",
    )
    rows = [
        (
            scene,
            answer,
            row["slides"],
            f"{row['share_median']:.2f}",
            f"{row['share_least']:.2f}",
            row["stops"],
            row["contacts"],
            f"{row['least_mm']:.1f}",
            f"{row['chatter_median']:.0f}",
        )
        for scene, answer, row in each(slides)
        if row
    ]
    text = (
        "A tool is pushed at 0.12 m/s along a surface and 0.05 m/s into it; the way "
        "along, beside that of a tool that nothing hinders."
    )
    return ["", "## Along a table or a board", "", text, "", *table(head, rows)]


def time_section(goals: Results) -> list[str]:
    """How long a call takes."""
    rows = []
    for scene, answer, figures in each(goals):
        row = next((figures[r] for r in ROADS if figures.get(r)), None)
        if row:
            calls = {k: f"{m:.0f}, {p:.0f}" for k, (m, p) in row["call_us"].items()}
            told = (calls.get("joints", "-"), calls.get("tools", "-"))
            rows.append((scene, answer, *told))
    head = ("scene", "answer", "joint velocities", "twists")
    text = (
        "Of one call, median and 99.9th percentile [us], medians over trials, on a "
        "machine that was busy with other work; the peer is given joint velocities "
        "in both."
    )
    return ["", "## Time", "", text, "", *table(head, rows)]


def each(results: Results) -> Sequence[tuple[str, str, Any]]:
    """Scenes and answers in order, with their figures."""
    return [
        (scene, answer, results[scene][answer])
        for scene in SCENES
        for answer in ANSWERS
        if answer in results.get(scene, {})
    ]


def left_out(goals: Results) -> str:
    """Goals of each scene that nobody was asked to reach."""
    told = []
    for scene in SCENES:
        answers = goals.get(scene)
        if answers:
            first = next(iter(answers.values()))
            kinds = first["kinds"]
            none = sum(n for k, n in kinds.items() if k.endswith(", none"))
            far = sum(n for k, n in kinds.items() if k.endswith("out of reach"))
            told.append(
                f"{scene} {none} without a way found and {far} whose tool gets into "
                f"joint limits, of {first['drawn']}"
            )
    return "; ".join(told)


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table."""
    return [
        f"| {' | '.join(head)} |",
        f"|{' --- |' * len(head)}",
        *(f"| {' | '.join(map(str, row))} |" for row in rows),
    ]


def number(value: float | None, form: str) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None else form.format(value)
