"""A small plot of one near miss, drawn as SVG: how far, and how far it had to be."""

from collections.abc import Callable
from itertools import pairwise
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Level
from armguard.station.blackbox.report.palette import (
    BLUE,
    COLOURS,
    FAINT,
    INK,
    LINE,
    ON_COLOUR,
    VERMILLION,
    WORDS,
)
from armguard.station.blackbox.report.series import Series
from armguard.station.blackbox.report.timeline import around

Floats = NDArray[np.float64]
Scale = Callable[[float], float]

# What is drawn around a near miss [s].
BEFORE, AFTER = 2.0, 3.0

# Points of a line.
POINTS = 400

# Sizes of the plot [px].
WIDTH, HEIGHT = 640, 190
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 14, 52
STRIP = 16

# Distances drawn of pairs that are far away would hide those that matter [mm].
LEAST_TOP = 20.0


def small_plot(series: Series, t: float, begin: float, end: float) -> str:
    """The distance of the nearest pair around a time, and what it had to keep.

    Args:
        series: All cycles.
        t: The time, since the first cycle [s].
        begin: When the near miss began [s].
        end: When it ended [s].
    """
    span = around(series, t, BEFORE, AFTER)
    times = series.t[span] - t
    distance = series.distance[span].astype(np.float64) * 1e3
    left = series.clearance[span].astype(np.float64) * 1e3
    seen = np.isfinite(distance) & np.isfinite(left)
    need = np.full(len(times), np.nan)
    need[seen] = distance[seen] - left[seen]
    top = LEAST_TOP
    if seen.any():
        # What is far away may leave the plot; what is needed may not.
        top = max(top, float(need[seen].max()) * 1.3, float(distance[seen].min()) * 2)
    bottom = min(0.0, float(distance[seen].min()) * 1.1 if seen.any() else 0.0)
    x0, x1 = LEFT, WIDTH - RIGHT
    y0, y1 = TOP, HEIGHT - BOTTOM

    def x(seconds: float) -> float:
        return x0 + (seconds + BEFORE) / (BEFORE + AFTER) * (x1 - x0)

    def y(length: float) -> float:
        return y1 - (length - bottom) / (top - bottom) * (y1 - y0)

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" class="small-plot" '
        'aria-label="distance of the nearest pair, and what it had to keep">'
    ]
    shade = f'x="{x(max(begin - t, -BEFORE)):.1f}" y="{y0}" height="{y1 - y0}"'
    wide = max(x(min(end - t, AFTER)) - x(max(begin - t, -BEFORE)), 1.0)
    parts.append(
        f'<rect {shade} width="{wide:.1f}" fill="{VERMILLION}" opacity=".08"/>'
    )
    for tick in ticks(bottom, top):
        parts.append(line(x0, y(tick), x1, y(tick), LINE))
        parts.append(words(x0 - 6, y(tick) + 4, f"{tick:g}", "end"))
    parts.append(words(x0 - 6, y0 - 3, "mm", "end"))
    for second in range(-int(BEFORE), int(AFTER) + 1):
        told = "0 s" if second == 0 else f"{second:+d}"
        parts.append(words(x(second), HEIGHT - 6, told, "middle"))
    parts.append(line(x(0), y0, x(0), y1, FAINT, "2 3"))
    places = drawn(left, seen)
    parts.append(path(places, times, distance, seen, top, x, y, BLUE, 2.0))
    parts.append(path(places, times, need, seen, top, x, y, VERMILLION, 1.6, "5 3"))
    parts.append(levels(series.level[span], times, x, y1 + 8))
    parts.append("</svg>")
    return "".join(parts)


def drawn(left: Floats, seen: NDArray[np.bool_]) -> list[int]:
    """Cycles that are drawn: of each few the one with the least left."""
    if len(left) <= POINTS:
        return list(range(len(left)))
    edges = np.linspace(0, len(left), POINTS + 1).astype(int).tolist()
    known = np.where(seen, left, np.inf)
    return [a + int(known[a:b].argmin()) for a, b in pairwise(edges)]


def path(
    places: list[int],
    times: Floats,
    values: Floats,
    seen: NDArray[np.bool_],
    top: float,
    x: Scale,
    y: Scale,
    colour: str,
    width: float,
    dashes: str = "",
) -> str:
    """A line through values, broken where there are none."""
    pieces, pen = [], "M"
    for k in places:
        if not seen[k]:
            pen = "M"
            continue
        height = y(min(float(values[k]), top))
        pieces.append(f"{pen}{x(float(times[k])):.1f} {height:.1f}")
        pen = "L"
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<path d="{"".join(pieces)}" fill="none" stroke="{colour}" '
        f'stroke-width="{width}"{dash}/>'
    )


def levels(level: NDArray[np.int8], times: Floats, x: Scale, top: float) -> str:
    """A strip with the level of each cycle, and its word where there is room."""
    parts = []
    edges = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist(), len(level)]
    for a, b in pairwise(edges):
        if b <= a:
            continue
        left = x(float(times[a]))
        right = x(float(times[b] if b < len(times) else times[b - 1]))
        if right <= left:
            right = left + 0.5
        kind = Level(int(level[a]))
        parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.2f}" '
            f'height="{STRIP}" fill="{COLOURS[kind]}"><title>{WORDS[kind]}</title>'
            "</rect>"
        )
        if right - left > 9 * len(WORDS[kind]):
            middle = (left + right) / 2
            parts.append(
                words(middle, top + 12, WORDS[kind], "middle", ON_COLOUR[kind])
            )
    return "".join(parts)


def ticks(low: float, high: float) -> list[float]:
    """Some round numbers between two others."""
    step = 10.0 ** floor(log10((high - low) / 3.0))
    step *= next(k for k in (1.0, 2.0, 5.0, 10.0) if (high - low) / (k * step) <= 5.0)
    first, last = ceil(low / step), floor(high / step)
    return [k * step for k in range(first, last + 1)]


def line(
    x0: float, y0: float, x1: float, y1: float, colour: str, dashes: str = ""
) -> str:
    """A straight line."""
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" '
        f'stroke="{colour}"{dash}/>'
    )


def words(x: float, y: float, text: str, anchor: str, colour: str = INK) -> str:
    """Words in the plot; they are ours, and hold no sign that HTML reads."""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">'
        f"{text}</text>"
    )
