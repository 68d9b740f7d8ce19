"""Signals of the last seconds in the panel: a plot, and the list of near pairs."""

import time
from collections import deque

import numpy as np
from viser import uplot

from armguard.guard.levels import Level
from armguard.guard.near_pair import NearPair
from armguard.recording.palette import BLUE, LEVEL_COLOURS, VERMILLION, hexadecimal
from armguard.view.controls import on_value
from armguard.view.drawables import Drawable
from armguard.view.world import Cycle, World

# Drawings that are kept a second [Hz].
RATE = 30.0

# What the plot shows, and how often it is sent [s].
SPAN, REDRAW = 20.0, 0.3

# Near pairs in the list.
LISTED = 6

# Pairs that the plot offers at most.
CHOICES = 24

# Joints are plotted within one turn [rad or m], headroom up to this [mm].
TURN, TALLEST = np.pi * 2.0, 800.0

# The signal that is plotted at first, and the title of the plot.
NEAREST = "nearest pair"
TITLE = "{} [{}], last 20 s"

# Levels with a shade behind the plot; one between has that of the next below.
SHADED = {
    Level.CAUTION: "caution",
    Level.SLOW: "slow",
    Level.STOP: "stop",
}


class SignalPlot(Drawable):
    """A signal of the last seconds, with the levels behind it.

    The signal is the headroom of a pair or the position of a joint, as chosen in the
    list. Where a pair is not reported its line leaves the plot at the top. The chosen
    pair is marked in the picture.
    """

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._pairs: tuple[str, ...] = ()
        self._points: deque[tuple[float, int, float]] = deque(maxlen=round(SPAN * RATE))
        self._sent = -np.inf
        # Cycles of the last seconds, so that another signal has a past as well.
        self._kept: deque[tuple[float, int, Cycle]] = deque(maxlen=round(SPAN * RATE))
        self._choice = self.gui.add_dropdown("Plot", self._options())
        on_value(self._choice, self._choose)
        still = np.array([-SPAN, 0.0])
        self._shown = self._range(0.0)
        shades = [
            uplot.Series(label=word, fill=hexadecimal(LEVEL_COLOURS[level]) + "60")
            for level, word in SHADED.items()
        ]
        self._plot = self.gui.add_uplot(
            (still, *[np.zeros(2)] * len(SHADED), still, np.zeros(2)),
            (
                uplot.Series(label="s"),
                *shades,
                uplot.Series(label="signal", stroke=hexadecimal(BLUE), width=2),
                uplot.Series(
                    label="zero", stroke=hexadecimal(VERMILLION), width=1, dash=(6, 4)
                ),
            ),
            title=TITLE.format(NEAREST, "mm"),
            scales=scales(*self._shown),
            legend=uplot.Legend(show=False),
            height=170,
        )
        self._mark = self.api.add_line_segments(
            "/near/marked",
            np.zeros((1, 2, 3)),
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=0.02,
            visible=False,
        )

    def _options(self) -> tuple[str, ...]:
        return (NEAREST, *self._pairs, *self.tables.q_names)

    def _choose(self, name: str) -> None:
        unit = "rad or m" if name in self.tables.q_names else "mm"
        self._plot.title = TITLE.format(name, unit)
        self._points.clear()
        for when, level, cycle in tuple(self._kept):
            self._points.append((when, level, self._value(name, cycle)))
        self._sent = -np.inf

    def _value(self, name: str, cycle: Cycle) -> float:
        """The signal in a cycle; NaN where it is not reported."""
        if name in self.tables.q_names:
            return float(cycle.frame.q[self.tables.q_names.index(name)])
        pairs = cycle.pairs if name == NEAREST else [pair_named(cycle, name)]
        pair = pairs[0] if pairs else None
        return np.nan if pair is None else pair.headroom * 1e3

    def _draw(self, cycle: Cycle) -> None:
        now, name = time.monotonic(), self._choice.value
        level = int(max(cycle.verdict.level, *cycle.verdict.levels.values()))
        self._kept.append((now, level, cycle))
        self._points.append((now, level, self._value(name, cycle)))
        marked = pair_named(cycle, name)
        self._mark.visible = marked is not None
        if marked is not None:
            ends = np.array([[marked.point_a, marked.point_b]], dtype=np.float32)
            self._mark.points = ends
            self._mark.colors = np.full((1, 2, 3), BLUE, dtype=np.uint8)
        if now - self._sent < REDRAW:
            return
        self._sent = now
        known = (*self._pairs, *map(pair_name, cycle.pairs[:LISTED]))
        pairs = tuple(dict.fromkeys(known))[:CHOICES]
        if pairs != self._pairs:
            self._pairs = pairs
            self._choice.options = self._options()
        self._send(now)

    def _send(self, now: float) -> None:
        """Send the points to the page, with a shade where each level was."""
        times, levels, values = np.array(self._points).T
        shown = values[np.isfinite(values)]
        low, high = self._range(float(shown.max()) if len(shown) else 0.0)
        if (low, high) != self._shown:
            self._shown = low, high
            self._plot.scales = scales(low, high)
        ordered = sorted(SHADED)
        found = np.searchsorted(ordered, levels, side="right") - 1
        shades = [np.where(found == k, high, 0.0) for k in range(len(ordered))]
        # Far above the plot: uPlot joins what is beside a NaN.
        line = np.where(np.isfinite(values), values, 100.0 * high)
        self._plot.data = times - now, *shades, line, np.full(len(times), 0.0)

    def _range(self, most: float) -> tuple[float, float]:
        """Ends of the axis: a joint's limits, or steps that hold the headroom."""
        name, tables = self._choice.value, self.tables
        if name in tables.q_names:
            k = tables.q_names.index(name)
            low, high = tables.lower[k], tables.upper[k]
            return max(min(low, 0.0), -TURN) - 0.1, min(max(high, 0.0), TURN) + 0.1
        high = tables.margin * 1e3
        while high < min(most, TALLEST):
            high *= 2.0
        return -0.3 * high, 1.05 * high


class NearList(Drawable):
    """The list of near pairs."""

    every = 0.25

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._text = self.gui.add_markdown("")

    def _draw(self, cycle: Cycle) -> None:
        lines = [
            f"| {inert(pair_name(pair))} | {pair.distance * 1e3:.0f} mm "
            f"| {pair.headroom * 1e3:.0f} mm |"
            for pair in cycle.pairs[:LISTED]
        ]
        text = "No pair is within the margin."
        if lines:
            head = ["| pair | distance | headroom |", "| --- | --: | --: |"]
            text = "\n".join([*head, *lines])
        if len(cycle.pairs) > LISTED:
            text += f"\n\n… and {len(cycle.pairs) - LISTED} more"
        if text != self._text.content:
            self._text.content = text


def scales(low: float, high: float) -> dict[str, uplot.Scale]:
    """Scales of the plot: the last seconds, and a range of the signal."""
    return {
        "x": uplot.Scale(time=False, range=(-SPAN, 0.0)),
        "y": uplot.Scale(range=(low, high)),
    }


def pair_name(pair: NearPair) -> str:
    """Both sides of a pair, in words."""
    return f"{pair.a} – {pair.b}"


def pair_named(cycle: Cycle, name: str) -> NearPair | None:
    """The reported pair of a name; None if it is not reported."""
    return next((pair for pair in cycle.pairs if pair_name(pair) == name), None)


def inert(name: str) -> str:
    """A name in which no sign means anything in Markdown or HTML."""
    return "".join(sign if sign.isalnum() else f"&#{ord(sign)};" for sign in name)
