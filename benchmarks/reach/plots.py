"""Plots of docs/reach.md."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reach.answers import ANSWERS
from reach.scenes import SCENES
from reach.summary import ROADS

Results = Mapping[str, Mapping[str, Mapping[str, Any]]]

# Pixels of an inch.
DPI = 110

COLOURS = dict(
    zip(
        ANSWERS,
        ("#0072B2", "#009E73", "#E69F00", "#56B4E9", "#D55E00", "#CC79A7"),
        strict=True,
    )
)
TITLES = {
    "straight": "straight way certified",
    "bends": "only a bent way certified; steers straight",
    "led": "the same goals, along the certified way",
}


def draw_goals(goals: Results, path: Path) -> None:
    """Goals reached without a stop, and those with one, in shares of the goals."""
    figure = Figure(figsize=(10.0, 3.6), dpi=DPI, layout="constrained")
    places = figure.subplots(1, len(ROADS), sharey=True)
    scenes = [s for s in SCENES if s in goals]
    answers = [a for a in ANSWERS if any(a in goals[scene] for scene in scenes)]
    wide = 0.8 / len(answers)
    for axes, road in zip(places, ROADS, strict=True):
        for k, answer in enumerate(answers):
            rows = {i: goals[s].get(answer, {}).get(road) for i, s in enumerate(scenes)}
            known = {i: row for i, row in rows.items() if row}
            at = [i + (k - 0.5 * (len(answers) - 1)) * wide for i in known]
            after, clean = (
                [100.0 * row[name] / row["goals"] for row in known.values()]
                for name in ("reached", "reached_without_stop")
            )
            axes.bar(at, after, wide, color=COLOURS[answer], alpha=0.3)
            axes.bar(at, clean, wide, color=COLOURS[answer], label=answer)
        axes.set_title(TITLES[road], fontsize=10)
        axes.set_xticks(np.arange(len(scenes)), scenes, rotation=20, fontsize=8)
        axes.axhline(95.0, color="black", linewidth=0.7, linestyle=":")
        axes.spines[["top", "right"]].set_visible(False)
    places[0].set_ylabel("goals reached [%]\n(pale: after a stop)")
    legend(figure, list(places))
    figure.savefig(path)


def draw_slides(slides: Results, path: Path) -> None:
    """How far tools get along, over time; the first slide of each scene."""
    drawn = {
        s: [r for r in rows.values() if r.get("first")] for s, rows in slides.items()
    }
    scenes = [s for s in SCENES if drawn.get(s)]
    figure = Figure(
        figsize=(2.6 * max(len(scenes), 1), 3.6), dpi=DPI, layout="constrained"
    )
    places = np.atleast_1d(figure.subplots(1, max(len(scenes), 1)))
    for axes, scene in zip(places, scenes, strict=False):
        for answer in ANSWERS:
            row = slides[scene].get(answer)
            if row is None or not row.get("first"):
                continue
            first = row["first"]
            for k, way in enumerate(first["along_m"]):
                axes.plot(
                    np.arange(len(way)) * first["step_s"],
                    [1e3 * x for x in way],
                    color=COLOURS[answer],
                    label=answer if k == 0 else None,
                )
        axes.set_title(scene, fontsize=10)
        axes.set_xlabel("time [s]")
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.3)
    places[0].set_ylabel("way along the surface [mm]")
    legend(figure, list(places))
    figure.savefig(path)


def legend(figure: Figure, places: Sequence[Axes]) -> None:
    """A legend of all responses drawn in any of some places, in their order."""
    drawn = {label for axes in places for label in axes.get_legend_handles_labels()[1]}
    names = [answer for answer in ANSWERS if answer in drawn]
    if names:
        figure.legend(
            [Patch(color=COLOURS[name]) for name in names],
            names,
            ncols=len(names),
            loc="outside upper center",
            fontsize=8,
        )
