"""Figures of many runs in one table for each measurement."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from room.warned import MODES

Rows = Sequence[Mapping[str, Any]]

LEVELS = ("SLOW", "STOP")

# What a pair needs by cause, as plots stack it.
TERMS = ("floor", "error", "reaction", "stopping", "path")


def speeds_of(rows: Rows) -> list[float]:
    """Speeds of the tool, ascending [m/s]."""
    return sorted({row["tool_speed"] for row in rows})


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

    def distance(row: Mapping[str, Any], mode: str) -> float:
        return float(row["modes"][mode][level]["distance"])

    found: dict[str, Any] = {}
    for speed in speeds_of(rows):
        own = [
            row
            for row in rows
            if row["tool_speed"] == speed
            and kind in (None, row["kind"])
            and all(row["modes"][mode]["STOP"] for mode in MODES)
        ]
        table = np.array([[distance(row, mode) for mode in MODES] for row in own])
        means = table.mean(axis=0)
        found[f"{speed:g}"] = {
            "count": len(own),
            **{mode: float(x) for mode, x in zip(MODES, means, strict=True)},
            "ratio": float(means[0] / means[1]),
            "half": float((table[:, 0] <= 0.5 * table[:, 1]).mean()),
            "full": float(np.mean([at_speed(row, level) for row in own])),
        }
    return found


def at_speed(row: Mapping[str, Any], level: str) -> bool:
    """Whether the tool had its speed when path and speed warned."""
    speeds = (row["modes"][mode][level]["speed"] for mode in ("path", "speed"))
    return all(speed == row["tool_speed"] for speed in speeds)


def needs(rows: Rows, mode: str) -> dict[str, dict[str, float]]:
    """Mean terms of what the pair at the stop needs, by speed [m]."""
    found = {}
    for speed in speeds_of(rows):
        budgets = [
            budget_of(row["modes"][mode]["STOP"]["budget"])
            for row in rows
            if row["tool_speed"] == speed and row["modes"][mode]["STOP"]
        ]
        found[f"{speed:g}"] = {
            term: float(np.mean([b[term] for b in budgets])) for term in TERMS
        }
    return found


def budget_of(budget: Mapping[str, float]) -> dict[str, float]:
    """Its terms, both sides together [m]."""
    both = {
        name: budget[f"{name}_a"] + budget[f"{name}_b"]
        for name in ("reaction", "stopping")
    }
    return {**{name: budget[name] for name in ("floor", "error", "path")}, **both}


def closing_bounds(rows: Rows) -> dict[str, float]:
    """Mean closing speed that a slow of mode path counts with, by speed [m/s]."""
    found = {}
    for speed in speeds_of(rows):
        slows = [
            row["modes"]["path"]["SLOW"] for row in rows if row["tool_speed"] == speed
        ]
        bounds = [slow["closing"] for slow in slows if slow and slow["closing"]]
        found[f"{speed:g}"] = float(np.mean(bounds))
    return found


def passed_at(rows: Rows, level: str) -> dict[str, Any]:
    """Mean least distances at which a panel may be passed, by speed and mode [m].

    A passage counts at a speed if every mode lets it pass with no panel there, and
    without a warning somewhere within sight.
    """
    found: dict[str, Any] = {}
    for speed in speeds_of(rows):
        own = [row["modes"] for row in rows if row["tool_speed"] == speed]
        full = [m for m in own if all(m[mode] and m[mode][level] for mode in MODES)]
        path = [m["path"][level] for m in own if m["path"] and m["path"][level]]
        means = {mode: mean([m[mode][level] for m in full]) for mode in MODES}
        one, other = means["path"], means["speed"]
        found[f"{speed:g}"] = {
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
