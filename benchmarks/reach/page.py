"""Writes docs/reach.md from the figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from episodes import kernels
from episodes.records import Records
from reach.answers import ANSWERS
from reach.plots import draw_goals, draw_slides
from reach.scenes import SCENES
from reach.summary import ROADS, WHATS, compared

Results = Mapping[str, Any]

# Share of goals with a certified way that are to be reached without a stop.
TARGET = 0.95

WORDS = {
    "straight": "The operator's own way is certified",
    "bends": "Only a bent way is certified, and the operator steers straight",
    "led": "The same goals, the operator following the certified way",
}

SAME = """## On the same goals

All rows of a scene are of the same goals: those that were run with every response."""

OTHERS = """## Other runs

**These rows cannot be compared with each other**: they are of different numbers of
goals. A run on the same goals that is as long takes their place."""

# Cells of a row without a slide.
NO_SLIDE = (0, "no start was found", *("-",) * 5)

MEASURED = """
Operators steer both arms straight at a goal, at 0.2 to 0.6 of their speed limits. They
do not plan. Starts and goals are random configurations that keep every buffer, starts
with 20 mm more; for two goals in three the operator commands joint velocities, for one
in three twists of the tools. A goal has a *certified way* if `Guard.check_path` clears
the operator's own way (*straight*), or if a short RRT-connect finds another one that it
clears (*bends*). A goal without a certified way is left out.

The robots follow commands with a delay of up to `command`, within their acceleration
and with an error of up to 0.9 `tracking_error`; measurements are up to `sensing` old
and wrong by up to the declared errors (constant, alternating or noise); stops are as
declared. A seed draws all of it. A cycle takes 1 ms. MuJoCo judges distances (at most
60 mm) and contacts on the true states.

*Reached* is 0.02 rad in every joint, or 10 mm and 3 degrees; a trial ends when it has
made no progress for 1.5 s, or after four stops. After a stop the operator releases the
stick for 0.3 s and tries again. *Chatter* is how often the acceleration of a joint
changes its sign while the command differs from the desired velocity, of the joint with
most of it.

`field` gets the goal and leads the arms by its own potentials, at no more than 0.3 of
the top speeds; it cannot follow a way, so it is not in the table of certified ways.

`mink` is the velocity-damper QP of that name with its default settings; in `mink_early`
its limits begin at 100 mm and let a pair lose all but 1/e in 60 ms, which is our own
choice. It models no accelerations, delays or errors, and stops nothing. In public
scenes it sees boxes in place of cylinders.
"""

LIMITS = """
The tables count what was run: where counts are small the percentages mean little. Goals
whose way bends are a hard test for an operator who steers straight: without planning a
local minimum ends the trial. So the certified way measures a filter, and the straight
one measures its effect on an operator who does not look ahead. Operators pause all
robots after a stop of one. Times of calls are from a machine with other load.
"""


def write_page(records: Records, docs: Path) -> None:
    """Write the page and its plots."""
    same: dict[str, dict[str, Any]] = {what: {} for what in WHATS}
    others: dict[str, dict[str, Any]] = {what: {} for what in WHATS}
    for what, scene, rows in compared(records):
        kept = all("not_by_all" in row for row in rows.values())
        into = same if kept and scene not in same[what] else others
        into[what].setdefault(scene, {}).update(rows)
    # What is drawn is what can be compared, where there is any.
    goals, slides = ({**others[what], **same[what]} for what in WHATS)
    draw_goals(goals, docs / "images" / "reach_goals.png")
    draw_slides(slides, docs / "images" / "reach_slides.png")
    text = "\n".join(
        [
            "# Goals reached with each response",
            "",
            "Written by `make reach`, from [reach.json](reach.json).",
            kernels.note(),
            *section(same, SAME),
            *section(others, OTHERS),
            "",
            *captions(goals, slides),
            *time_section(goals),
            "",
            "## What is measured",
            MEASURED.rstrip(),
            "",
            "## Limits",
            LIMITS.rstrip(),
            "",
        ]
    )
    (docs / "reach.md").write_text(text, encoding="utf-8")


def section(results: Mapping[str, Results], words: str) -> list[str]:
    """All tables of some rows."""
    goals, slides = (results[what] for what in WHATS)
    if not goals and not slides:
        return []
    return [
        "",
        words,
        "",
        *(f"- {line}" for what in WHATS for line in counts(results[what], what)),
        *(line for road in ROADS for line in goal_section(goals, road)),
        *slide_section(slides),
    ]


def counts(results: Results, what: str) -> list[str]:
    """Goals or slides of each scene that are compared, and how many are left out."""
    lines = []
    for scene in SCENES:
        answers = results.get(scene, {})
        first = next(iter(answers.values()), {})
        if "not_by_all" not in first:
            continue
        text = f"{scene}: {first['drawn']} {what} with each of {', '.join(answers)}"
        left = [f"{n} ({why})" for why, n in first["left_out"].items()]
        if first["not_by_all"]:
            left.append(f"{first['not_by_all']} (not run with all responses)")
        lines.append(f"{text}; left out {', '.join(left) or 'none'}.")
    return lines


def captions(goals: Results, slides: Results) -> list[str]:
    """The pictures, each with how many goals or slides it rests on."""
    counted = {scene: goals_of(rows) for scene, rows in in_order(goals)}
    numbers = "; ".join(f"{scene} {number}" for scene, number in counted.items())
    missing = ", ".join(a for a in ANSWERS if all(a not in r for r in slides.values()))
    few = [scene for scene, rows in in_order(goals) if "not_by_all" in some(rows)]
    same = ", ".join(few) or "no scene"
    return [
        "![goals reached](images/reach_goals.png)",
        "",
        f"Goals with each response, fewest and most: {numbers}. Only in {same} all "
        "responses had the same goals; in the other scenes bars of different "
        "responses are not to be compared.",
        "",
        "![ways along surfaces](images/reach_slides.png)",
        "",
        "The first slide of each scene. A response without a line there was not run "
        f"or found no start; in no scene: {missing or 'none'}.",
    ]


def in_order(results: Results) -> Sequence[tuple[str, Results]]:
    """Scenes that have any figures, in order."""
    return [(scene, results[scene]) for scene in SCENES if results.get(scene)]


def some(rows: Results) -> Results:
    """Figures of any response."""
    return next(iter(rows.values()))


def goals_of(rows: Results) -> str:
    """Fewest and most goals of the responses of a scene."""
    numbers = [
        sum(figures[road]["goals"] for road in ROADS[:2] if figures.get(road))
        for figures in rows.values()
    ]
    least, most = min(numbers), max(numbers)
    return str(least) if least == most else f"{least} to {most}"


def goal_section(goals: Results, road: str) -> list[str]:
    """Goals by one road."""
    head = (
        "scene",
        "response",
        "goals",
        "reached without a stop",
        "reached",
        "stops",
        "contacts",
        "least [mm]",
        "time / free",
        "jerk of command, arm [rad/s³]",
        "chatter [1/s]",
        "blocked",
        "kernels",
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
                    kernels.told(figures),
                )
            )
    return ["", f"### {WORDS[road]}", "", *table(head, rows)] if rows else []


def slide_section(slides: Results) -> list[str]:
    """How far tools slide."""
    head = (
        "scene",
        "response",
        "slides",
        "way along / free, median",
        "least",
        "stops",
        "contacts",
        "least distance [mm]",
        "chatter [1/s]",
        "kernels",
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
            kernels.told(row),
        )
        if row.get("slides")
        else (scene, answer, *NO_SLIDE, kernels.told(row))
        for scene, answer, row in each(slides)
    ]
    text = (
        "The operator pushes a tool at 0.12 m/s along a surface and at 0.05 m/s into "
        "it. *Way along / free*: its way along the surface, divided by that of a free "
        "tool."
    )
    title = ["", "### Along a table or a board", "", text, ""]
    return [*title, *table(head, rows)] if rows else []


def time_section(goals: Results) -> list[str]:
    """How long a call takes."""
    rows = []
    for scene, answer, figures in each(goals):
        row = next((figures[r] for r in ROADS if figures.get(r)), None)
        if row:
            calls = {k: f"{m:.0f}, {p:.0f}" for k, (m, p) in row["call_us"].items()}
            told = (calls.get("joints", "-"), calls.get("tools", "-"))
            rows.append((scene, answer, *told))
    head = ("scene", "response", "joint velocities", "twists")
    text = (
        "Of one call, median and 99.9th percentile [us], medians over trials, on a "
        "machine with other load; the peer gets joint velocities in both."
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
