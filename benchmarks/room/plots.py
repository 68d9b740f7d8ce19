"""Plots of docs/room.md."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import paper_buffer as paper
from room.co_braking import WAYS
from room.summary import LEVELS, TERMS, needs, passed_at, speeds_of, warned_at
from room.warned import MODES

Rows = Sequence[Mapping[str, Any]]

# Pixels of an inch.
DPI = 110

COLOURS = {"path": "#0072B2", "speed": "#D55E00", "fixed": "#009E73"}
TERM_COLOURS = dict(
    zip(TERMS, ("#555555", "#CC79A7", "#4477aa", "#ee8866", "#ddcc77"), strict=True)
)
WAY_COLOURS = dict(zip(WAYS, ("#0072B2", "#E69F00", "#D55E00"), strict=True))


def tidy(axes: Axes, **words: str) -> None:
    """What all plots have in common, and the words at their axes."""
    axes.set(**words)
    axes.set_ylim(bottom=0.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
    axes.set_axisbelow(True)


def draw_warnings(rows: Rows, passed: Rows, path: Path) -> None:
    """Clearance at the first slow and stop: approaches above, passing below."""
    figure = Figure(figsize=(9.0, 7.0), dpi=DPI, layout="constrained")
    places = figure.subplots(2, 2)
    for k, level in enumerate(LEVELS):
        for row, means, what in (
            (0, warned_at(rows, level), "approaching"),
            (1, passed_at(passed, level), "passing"),
        ):
            axes = places[row, k]
            for mode in MODES:
                if level == "SLOW" and mode == "fixed":
                    continue
                known = {float(s): m[mode] for s, m in means.items() if speaks(m)}
                axes.plot(
                    list(known),
                    [1e3 * d for d in known.values()],
                    "o-",
                    color=COLOURS[mode],
                    label=mode,
                )
            tidy(
                axes,
                title=f"{what}: {'first slow' if level == 'SLOW' else 'stop'}",
                xlabel="speed of the tool [m/s]",
                ylabel="mean clearance [mm]",
            )
            axes.legend(title="mode", frameon=False)
    figure.savefig(path)


def speaks(mean: Mapping[str, Any]) -> bool:
    """Whether at least half of the motions say something of a speed.

    Others were warned of before the tool had it, or had no distance.
    """
    if "full" in mean:
        return bool(mean["full"] >= 0.5)
    return bool(2 * mean["count"] >= mean["of"])


def draw_needs(rows: Rows, path: Path) -> None:
    """What the pair at the stop needs, by cause, in both modes."""
    figure = Figure(figsize=(9.0, 3.8), dpi=DPI, layout="constrained")
    places = figure.subplots(1, 2, sharey=True)
    for axes, mode in zip(places, ("path", "speed"), strict=True):
        means = needs(rows, mode)
        for m in means.values():
            # What the course of the path saves is a shorter stop, no bar below zero.
            m["stopping"] += min(m["path"], 0.0)
            m["path"] = max(m["path"], 0.0)
        x = np.arange(len(means))
        bottom = np.zeros(len(means))
        for term in TERMS:
            heights = 1e3 * np.array([m[term] for m in means.values()])
            label = "directions unknown" if term == "path" else term
            axes.bar(x, heights, 0.6, bottom, color=TERM_COLOURS[term], label=label)
            bottom += heights
        axes.set_xticks(x, list(means))
    for axes, mode in zip(places, ("path", "speed"), strict=True):
        tidy(axes, title=f"mode {mode}", xlabel="speed of the tool [m/s]")
    places[0].set_ylabel("mean need at the stop [mm]")
    handles, labels = places[1].get_legend_handles_labels()
    places[0].legend(handles[::-1], labels[::-1], frameon=False, loc="upper left")
    figure.savefig(path)


def draw_co_braking(rows: Rows, path: Path) -> None:
    """Gap at the stop, head-on, by what each guard knows."""
    arms = list(dict.fromkeys(row["arm"] for row in rows))
    figure = Figure(figsize=(11.0, 3.6), dpi=DPI, layout="constrained")
    for axes, arm in zip(figure.subplots(1, len(arms)), arms, strict=True):
        own = [row for row in rows if row["arm"] == arm]
        for way in WAYS:
            axes.plot(
                [row["tool_speed"] for row in own],
                [1e3 * row[way]["gap"] for row in own],
                "o-",
                color=WAY_COLOURS[way],
                label=way,
            )
        words = {"xlabel": "speed of each arm [m/s]", "ylabel": "gap at the stop [mm]"}
        tidy(axes, title=arm, **words)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)


def draw_least(rows: Rows, path: Path) -> None:
    """Clearance at the stop beside the least fixed buffer that does."""
    arms = list(dict.fromkeys(row["arm"] for row in rows))
    figure = Figure(figsize=(9.0, 3.8), dpi=DPI, layout="constrained")
    for axes, arm in zip(figure.subplots(1, len(arms)), arms, strict=True):
        own = [row for row in rows if row["arm"] == arm]
        x = np.arange(len(own))
        bars = {
            "least that does": ("#999999", [row["least"] for row in own]),
            "path, floor 0": ("#56B4E9", at(own, "path, floor 0 mm")),
            "path, floor 5 mm": ("#0072B2", at(own, "path, floor 5 mm")),
        }
        for k, (label, (colour, values)) in enumerate(bars.items()):
            axes.bar(
                x + 0.25 * (k - 1),
                1e3 * np.array(values),
                0.25,
                color=colour,
                label=label,
            )
        axes.axhline(1e3 * paper.FIXED, color="black", ls=":", label="paper, 1.2 in")
        axes.set_xticks(x, [f"{s / paper.INCH:.0f}" for s in speeds_of(own)])
        y = "clearance at the stop [mm]"
        tidy(axes, title=arm, xlabel="speed of the tool [in/s]", ylabel=y)
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)


def at(rows: Rows, way: str) -> list[float]:
    """Distances at the stop [m]."""
    return [float(row[way]["distance"]) for row in rows]
