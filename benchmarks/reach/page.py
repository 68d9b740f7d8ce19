"""Writes docs/reach.md from the figures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from episodes import kernels
from episodes.records import Records
from pages import rendered
from reach.answers import ANSWERS
from reach.plots import draw_goals, draw_slides
from reach.scenes import SCENES
from reach.summary import ROADS, WHATS, compared

Results = Mapping[str, Any]

WORDS = {
    "straight": "The operator's own way is certified",
    "bends": "Only a bent way is certified, and the operator steers straight",
    "led": "The same goals, the operator following the certified way",
}


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
    drawn = {scene: goals[scene] for scene in SCENES if goals.get(scene)}
    text = rendered(
        "reach",
        note=kernels.note(),
        same=same,
        others=others,
        counts=[line for what in WHATS for line in counts(same[what], what)],
        roads=WORDS,
        each=each,
        by_road=by_road,
        numbers="; ".join(f"{s} {goals_of(rows)}" for s, rows in drawn.items()),
        alike=", ".join(s for s, r in drawn.items() if "not_by_all" in first(r)),
        missing=", ".join(
            a for a in ANSWERS if all(a not in rows for rows in slides.values())
        ),
        calls=[
            (
                scene,
                answer,
                next(figures[r] for r in ROADS if figures.get(r))["call_us"],
            )
            for scene, answer, figures in each(goals)
            if any(figures.get(road) for road in ROADS)
        ],
    )
    (docs / "reach.md").write_text(text, encoding="utf-8")


def counts(results: Results, what: str) -> list[str]:
    """Goals or slides of each scene that are compared, and how many are left out."""
    lines = []
    for scene in [s for s in SCENES if s in results]:
        one = first(results[scene])
        left = [f"{n} ({why})" for why, n in one["left_out"].items()]
        if one["not_by_all"]:
            left.append(f"{one['not_by_all']} (not run with all responses)")
        lines.append(
            f"{scene}: {one['drawn']} {what} with each of {', '.join(results[scene])}; "
            f"left out {', '.join(left) or 'none'}."
        )
    return lines


def first(rows: Results) -> Results:
    """Figures of the first response of a scene."""
    return next(iter(rows.values()))


def goals_of(rows: Results) -> str:
    """Fewest and most goals of the responses of a scene."""
    numbers = {
        sum(figures[road]["goals"] for road in ROADS[:2] if figures.get(road))
        for figures in rows.values()
    }
    return " to ".join(map(str, sorted({min(numbers), max(numbers)})))


def each(results: Results) -> list[tuple[str, str, Any]]:
    """Scenes and responses in order, with their figures."""
    return [
        (scene, answer, results[scene][answer])
        for scene in SCENES
        for answer in ANSWERS
        if answer in results.get(scene, {})
    ]


def by_road(results: Results, road: str) -> list[tuple[str, str, Any, Any]]:
    """The same by one road, where there were any goals; and all figures of each row."""
    return [
        (scene, answer, figures[road], figures)
        for scene, answer, figures in each(results)
        if figures.get(road)
    ]
