"""Figures of many runs, a table and a plot for each measurement, and docs/room.md."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import paper_buffer as paper
from episodes.kernels import kernels_in_words
from pages import rendered
from plots import drawn
from room.lines import MODES
from room.walls import WAYS

Rows = Sequence[Mapping[str, Any]]

KINDS = {"all": None, "at a fixture": "fixture", "at the other arm": "arm"}

# Speed of the tool that the targets and the text are about [m/s].
AT_SPEED = "0.25"

LEVELS = ("SLOW", "STOP")

# What a pair needs by cause, as plots stack it, and their colours.
TERMS = {
    "floor": "#555555",
    "error": "#CC79A7",
    "reaction": "#4477aa",
    "stopping": "#ee8866",
    "path": "#ddcc77",
}
COLOURS = {"path": "#0072B2", "speed": "#D55E00", "fixed": "#009E73"}
WAY_COLOURS = dict(zip(WAYS, ("#0072B2", "#E69F00", "#D55E00"), strict=True))


def speeds_of(rows: Rows) -> dict[str, Rows]:
    """Rows by the speed of the tool, ascending [m/s]."""
    speeds = sorted({row["tool_speed"] for row in rows})
    return {f"{s:g}": [r for r in rows if r["tool_speed"] == s] for s in speeds}


def warned_at(rows: Rows, level: str, kind: str | None = None) -> dict[str, Any]:
    """Mean distances of the pairs that were warned of.

    An approach counts if every mode stopped it. No mode "fixed" slows.

    Args:
        rows: Of the approaches.
        level: "SLOW" or "STOP".
        kind: Kind of approach; all if None.

    Returns:
        For each speed and mode the mean [m]; how many count; the ratio of the means of
        path and speed, how often it is below a half in single approaches, and how often
        the tool had got up to its speed in both [-].
    """
    found: dict[str, Any] = {}
    for speed, same in speeds_of(rows).items():
        own = [
            row
            for row in same
            if kind in (None, row["kind"])
            and all(row["modes"][mode]["STOP"] for mode in MODES)
        ]
        said = [[row["modes"][mode][level] for mode in MODES] for row in own]
        table = np.array([[float(one["distance"]) for one in ones] for ones in said])
        means = table.mean(axis=0)
        # When path and speed warned, the first two modes.
        full = [
            all(one["speed"] == row["tool_speed"] for one in ones[:2])
            for row, ones in zip(own, said, strict=True)
        ]
        found[speed] = {
            "count": len(own),
            **{mode: float(x) for mode, x in zip(MODES, means, strict=True)},
            "ratio": float(means[0] / means[1]),
            "half": float((table[:, 0] <= 0.5 * table[:, 1]).mean()),
            "full": float(np.mean(full)),
        }
    return found


def needs(rows: Rows, mode: str) -> dict[str, dict[str, float]]:
    """Mean terms of what the pair at the stop needs, by speed [m]."""
    found = {}
    for speed, same in speeds_of(rows).items():
        stops = (row["modes"][mode]["STOP"] for row in same)
        budgets = [stop["budget"] for stop in stops if stop]
        found[speed] = {
            term: float(np.mean([term_of(budget, term) for budget in budgets]))
            for term in TERMS
        }
    return found


def term_of(budget: Mapping[str, float], term: str) -> float:
    """A term of a budget, of both sides together [m]."""
    sides = (f"{term}_a", f"{term}_b")
    return budget[term] if term in budget else sum(budget[side] for side in sides)


def closing_bounds(rows: Rows) -> dict[str, float]:
    """Mean closing speed that a slow of mode path counts with, by speed [m/s]."""
    found = {}
    for speed, same in speeds_of(rows).items():
        slows = [row["modes"]["path"]["SLOW"] for row in same]
        bounds = [slow["closing"] for slow in slows if slow and slow["closing"]]
        found[speed] = float(np.mean(bounds))
    return found


def passed_at(rows: Rows, level: str) -> dict[str, Any]:
    """Mean least distances at which a panel may be passed, by speed and mode [m].

    A passage counts at a speed if every mode lets it pass with no panel there, and
    without a warning somewhere within sight.
    """
    found: dict[str, Any] = {}
    for speed, same in speeds_of(rows).items():
        own = [row["modes"] for row in same]
        full = [m for m in own if all(m[mode] and m[mode][level] for mode in MODES)]
        path = [m["path"][level] for m in own if m["path"] and m["path"][level]]
        means = {mode: mean([m[mode][level] for m in full]) for mode in MODES}
        one, other = means["path"], means["speed"]
        found[speed] = {
            "count": len(full),
            "of": len(own),
            "path_alone": mean(path),
            **means,
            "ratio": one / other if one is not None and other is not None else None,
        }
    return found


def mean(values: Sequence[float]) -> float | None:
    """Mean; None of nothing."""
    return float(np.mean(values)) if values else None


def draw_warnings(rows: Rows, passed: Rows, path: Path) -> None:
    """Distance at the first slow and stop: approaches above, passing below."""
    what = ((warned_at, rows, "approaching"), (passed_at, passed, "passing"))
    each = [(*one, level) for one in what for level in LEVELS]
    with drawn(path, (9.0, 7.0), 2, 2, **TIDY) as places:
        for axes, (figures, some, title, level) in zip(places, each, strict=True):
            means = figures(some, level)
            for mode in MODES if level == "STOP" else MODES[:2]:
                known = {float(s): m[mode] for s, m in means.items() if speaks(m)}
                clear = [1e3 * d for d in known.values()]
                axes.plot([*known], clear, "o-", color=COLOURS[mode], label=mode)
            axes.set_title(f"{title}: {'first slow' if level == 'SLOW' else 'stop'}")
            axes.set(xlabel="speed of the tool [m/s]", ylabel="mean distance [mm]")
            axes.set_ylim(bottom=0.0)
            axes.legend(title="mode")


def speaks(mean: Mapping[str, Any]) -> bool:
    """Whether at least half of the motions say something of a speed.

    Others were warned of before the tool had it, or had no distance.
    """
    if "full" in mean:
        return bool(mean["full"] >= 0.5)
    return bool(2 * mean["count"] >= mean["of"])


def draw_needs(rows: Rows, path: Path) -> None:
    """What the pair at the stop needs, by cause, in both modes."""
    with drawn(path, (9.0, 3.8), 2, share_y=True, **TIDY) as places:
        for axes, mode in zip(places, ("path", "speed"), strict=True):
            means = needs(rows, mode)
            for m in means.values():
                # What the course of the path saves is a shorter stop, no bar below
                # zero.
                m["stopping"] += min(m["path"], 0.0)
                m["path"] = max(m["path"], 0.0)
            x = np.arange(len(means))
            bottom = np.zeros(len(means))
            for term, colour in TERMS.items():
                heights = 1e3 * np.array([m[term] for m in means.values()])
                label = "directions unknown" if term == "path" else term
                axes.bar(x, heights, 0.6, bottom, color=colour, label=label)
                bottom += heights
            axes.set_xticks(x, list(means))
        for axes, mode in zip(places, ("path", "speed"), strict=True):
            axes.set(title=f"mode {mode}", xlabel="speed of the tool [m/s]")
            axes.set_ylim(bottom=0.0)
        places[0].set_ylabel("mean need at the stop [mm]")
        handles, labels = places[1].get_legend_handles_labels()
        places[0].legend(handles[::-1], labels[::-1], loc="upper left")


def by_arm(rows: Rows) -> dict[str, Rows]:
    """Rows by the arm they are of."""
    names = dict.fromkeys(row["arm"] for row in rows)
    return {arm: [row for row in rows if row["arm"] == arm] for arm in names}


def draw_head_on(rows: Rows, path: Path) -> None:
    """Gap at the stop, head-on, by what each guard knows."""
    arms = by_arm(rows)
    with drawn(path, (11.0, 3.6), len(arms), **TIDY) as places:
        for axes, (arm, own) in zip(places, arms.items(), strict=True):
            speeds = [row["tool_speed"] for row in own]
            for way, colour in WAY_COLOURS.items():
                gaps = [1e3 * row[way]["gap"] for row in own]
                axes.plot(speeds, gaps, "o-", color=colour, label=way)
            axes.set(title=arm, xlabel="speed of each arm [m/s]")
            axes.set_ylabel("gap at the stop [mm]")
            axes.set_ylim(bottom=0.0)
            axes.legend(fontsize=8)


def draw_least(rows: Rows, path: Path) -> None:
    """Distance at the stop beside the least fixed buffer that does."""
    arms = by_arm(rows)
    with drawn(path, (9.0, 3.8), len(arms), **TIDY) as places:
        for axes, (arm, own) in zip(places, arms.items(), strict=True):
            x = np.arange(len(own))
            bars: dict[str, tuple[str, list[float]]] = {
                "least that does": ("#999999", [row["least"] for row in own])
            }
            for floor, colour in ((0, "#56B4E9"), (5, "#0072B2")):
                kept = [float(r[f"path, floor {floor} mm"]["distance"]) for r in own]
                bars[f"path, floor {floor}" + " mm" * bool(floor)] = colour, kept
            for k, (label, (colour, values)) in enumerate(bars.items()):
                heights = 1e3 * np.array(values)
                axes.bar(x + 0.25 * (k - 1), heights, 0.25, color=colour, label=label)
            fixed = {"color": "black", "ls": ":", "label": "paper, 1.2 in"}
            axes.axhline(1e3 * paper.FIXED, **fixed)
            speeds = sorted(row["tool_speed"] for row in own)
            axes.set_xticks(x, [f"{s / paper.INCH:.0f}" for s in speeds])
            axes.set(title=arm, xlabel="speed of the tool [in/s]")
            axes.set_ylabel("distance at the stop [mm]")
            axes.set_ylim(bottom=0.0)
            axes.legend(fontsize=8)


# All plots have a grid.
TIDY = {"axes__grid": True}


def write_page(results: Mapping[str, Rows], docs: Path) -> None:
    """Write the page and its plots."""
    rows, passed = results["approaches"], results["passing"]
    head_on, wall = results["co_braking"], results["least_buffer"]
    images = docs / "images"
    draw_warnings(rows, passed, images / "room_warnings.png")
    draw_needs(rows, images / "room_needs.png")
    draw_head_on(head_on, images / "room_co_braking.png")
    draw_least(wall, images / "room_least.png")
    text = rendered(
        "room",
        warned={
            level: {name: warned_at(rows, level, kind) for name, kind in KINDS.items()}
            for level in LEVELS
        },
        passed={level: passed_at(passed, level) for level in LEVELS},
        head_on=head_on,
        wall=wall,
        ways=WAYS,
        saved_by={
            way: [1.0 - row[WAYS[0]]["gap"] / row[way]["gap"] for row in head_on]
            for way in WAYS[1:]
        },
        beside_least=max(r["path, floor 5 mm"]["distance"] / r["least"] for r in wall),
        unknown=needs(rows, "speed")[AT_SPEED]["path"],
        closing=closing_bounds(rows)[AT_SPEED],
        inch=paper.INCH,
        kernels=kernels_in_words(results),
    )
    (docs / "room.md").write_text(text, encoding="utf-8")
