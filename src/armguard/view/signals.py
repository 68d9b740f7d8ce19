"""Signals of the last seconds in the panel: a plot, and the list of near pairs."""

from collections import deque
from collections.abc import Iterable

import numpy as np
from viser import uplot

from armguard.guard.levels import Level
from armguard.guard.near_pair import NearPair
from armguard.recording.palette import BLUE, STATE_COLOURS, VERMILLION, hexadecimal
from armguard.view.controls import on_value
from armguard.view.drawables import ABOVE, Drawable, middle_of
from armguard.view.world import Cycle, World

# Drawings that are kept a second [Hz].
RATE = 30.0

# What the plot shows, and how often it is sent [s].
SPAN, REDRAW = 20.0, 0.3

# Between two cycles with more time than this there is neither line nor shade [s].
GAP = 1.0

# Near pairs in the list.
LISTED = 6

# Radius of the ends of the marked pair [m].
END = 0.02

# Pairs that the plot offers at most.
CHOICES = 24

# Joints are plotted within one turn [rad or m], headroom up to this [mm].
TURN, TALLEST = np.pi * 2.0, 800.0

# The signal that is plotted at first, and titles of the plot.
NEAREST = "nearest pair"
HEADROOM, POSITION = "headroom [mm], last 20 s", "position [rad or m], last 20 s"

# Levels with a shade behind the plot; one between has that of the next below.
SHADED = {
    Level.CAUTION: "caution",
    Level.SLOW: "slow",
    Level.STOP: "stop",
}


# Line below the plot that names its shades.
SHADES = (
    '<div style="font: 12px/1.4 sans-serif; padding: 0 12px 8px; text-align: right">'
    + " ".join(
        f'<span style="color: {hexadecimal(STATE_COLOURS[level])}">■</span> {word}'
        for level, word in SHADED.items()
    )
    + "</div>"
)


class SignalPlot(Drawable):
    """A signal of the last seconds, with the levels behind it.

    The signal is the headroom of a pair or the position of a joint, as chosen in the
    list. Where a pair is not reported its line leaves the plot at the top.
    """

    every = REDRAW

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._pairs: tuple[str, ...] = ()
        self._points: deque[tuple[float, int, float]] = deque(maxlen=round(SPAN * RATE))
        # Cycles of the last seconds, so that another signal has a past as well.
        self._kept: deque[tuple[float, int, Cycle]] = deque(maxlen=round(SPAN * RATE))
        self._choice = self.gui.add_dropdown("Plot", self._options())
        on_value(self._choice, self._choose)
        still = np.array([-SPAN, 0.0])
        self._shown = self._range(0.0)
        shades = [
            uplot.Series(label=word, fill=hexadecimal(STATE_COLOURS[level]) + "60")
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
            title=HEADROOM,
            scales=scales(*self._shown),
            legend=uplot.Legend(show=False),
            height=170,
        )
        self.gui.add_html(SHADES)

    @property
    def chosen(self) -> str:
        """Name of the signal."""
        return str(self._choice.value)

    def _options(self) -> tuple[str, ...]:
        return (NEAREST, *self._pairs, *self.tables.q_names)

    def _choose(self, name: str) -> None:
        self._plot.title = POSITION if name in self.tables.q_names else HEADROOM
        self._points.clear()
        for when, level, cycle in tuple(self._kept):
            self._points.append((when, level, self._value(name, cycle)))
        self._send()

    def _value(self, name: str, cycle: Cycle) -> float:
        """The signal in a cycle; NaN where it is not reported."""
        if name in self.tables.q_names:
            return float(cycle.frame.q[self.tables.q_names.index(name)])
        pair = pair_named(cycle, name)
        return np.nan if pair is None else pair.headroom * 1e3

    def fill(self, cycles: Iterable[Cycle]) -> None:
        """Replace the past, where a recording goes on elsewhere."""
        self._points.clear()
        self._kept.clear()
        for cycle in cycles:
            self._add(cycle)
        self._due = -np.inf

    def follow(self, cycle: Cycle, now: float) -> bool:
        """Take in a cycle; the plot is drawn seldom."""
        self._add(cycle)
        return super().follow(cycle, now)

    def _add(self, cycle: Cycle) -> None:
        when, name = cycle.frame.monotonic, self.chosen
        if self._points and self._points[-1][0] == when:
            return
        level = int(cycle.level)
        self._kept.append((when, level, cycle))
        self._points.append((when, level, self._value(name, cycle)))

    def _draw(self, cycle: Cycle) -> None:
        known = (*self._pairs, *map(pair_name, cycle.pairs[:LISTED]))
        pairs = tuple(dict.fromkeys(known))[:CHOICES]
        if pairs != self._pairs:
            self._pairs = pairs
            self._choice.options = self._options()
        self._send()

    def _send(self) -> None:
        """Send the points to the page, with a shade where each level was."""
        if not self._points:
            return
        points = np.array(tuple(self._points))
        gaps = 1 + np.flatnonzero(np.diff(points[:, 0]) > GAP)
        ends = np.column_stack([points[gaps - 1, 0], points[gaps, 0]]).reshape(-1, 1)
        nothing = np.hstack([ends, np.full_like(ends, Level.CLEAR), ends * np.nan])
        times, levels, values = np.insert(points, np.repeat(gaps, 2), nothing, axis=0).T
        shown = values[np.isfinite(values)]
        low, high = self._range(float(shown.max()) if len(shown) else 0.0)
        if (low, high) != self._shown:
            self._shown = low, high
            self._plot.scales = scales(low, high)
        ordered = sorted(SHADED)
        found = np.searchsorted(ordered, levels, side="right") - 1
        shades = [np.where(found == k, high, 0.0) for k in range(len(ordered))]
        # Far above the plot: uPlot joins the points beside a NaN.
        line = np.where(np.isfinite(values), values, 100.0 * high)
        self._plot.data = times - times[-1], *shades, line, np.full(len(times), 0.0)

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
        # The uppermost number is beside a line of the grid, below the title.
        return -0.3 * high, 1.15 * high


class MarkedPair(Drawable):
    """One pair, marked in the picture with the names of its sides.

    It is the pair that a page points at (on the plot, in the list, or the nearest pair
    of a card's robot), and otherwise the one that was chosen for the plot.

    Attributes:
        pointed: What a page points at: "plot", "pair", "robot", or "" for nothing, and
            the name of the pair or the robot.

    Args:
        world: The scene.
        plot: The plot.
    """

    def __init__(self, world: World, plot: SignalPlot) -> None:
        super().__init__(world)
        self.pointed = "", ""
        self._plot = plot
        self._label = self.api.add_label(
            "/near/marked", "", visible=False, anchor="bottom-center"
        )
        self._line = self.api.add_line_segments(
            "/near/marked_line",
            np.zeros((1, 2, 3)),
            np.full((1, 2, 3), BLUE, dtype=np.uint8),
            thickness=0.02,
            visible=False,
        )
        self._ends = [
            self.api.add_icosphere(
                f"/near/marked_end_{k}", END, color=BLUE, visible=False
            )
            for k in range(2)
        ]

    @property
    def text(self) -> str:
        """Text of the label in the picture; empty while no pair is marked."""
        return str(self._label.text) if self._label.visible else ""

    def _draw(self, cycle: Cycle) -> None:
        pair = self._pair(cycle)
        for node in (self._label, self._line, *self._ends):
            node.visible = pair is not None
        if pair is None:
            return
        ends = np.array([[pair.point_a, pair.point_b]], dtype=np.float32)
        self._line.points = ends
        for node, at in zip(self._ends, ends[0], strict=True):
            node.position = at
        # Above the label that the pair may have beside.
        self._label.position = middle_of(pair) + 4.0 * ABOVE
        self._label.text = f"{pair_name(pair)} {pair.distance * 1e3:.0f} mm"

    def _pair(self, cycle: Cycle) -> NearPair | None:
        at, name = self.pointed
        if at == "robot":
            links = f"{name}/"
            found = (
                pair
                for pair in cycle.pairs
                if pair.a.startswith(links) or pair.b.startswith(links)
            )
            return next(found, None)
        if at == "pair":
            return pair_named(cycle, name)
        chosen = self._plot.chosen
        return None if not at and chosen == NEAREST else pair_named(cycle, chosen)


class NearList(Drawable):
    """The list of near pairs."""

    every = 0.25

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._text = self.gui.add_markdown("")

    def _draw(self, cycle: Cycle) -> None:
        # Of primitives of the same two links the pair with the least headroom.
        pairs: dict[str, NearPair] = {}
        for pair in cycle.pairs:
            pairs.setdefault(pair_name(pair), pair)
        lines = [
            f"| {inert(name)} | {pair.distance * 1e3:.0f} mm "
            f"| {pair.headroom * 1e3:.0f} mm |"
            for name, pair in [*pairs.items()][:LISTED]
        ]
        text = "No pair is within the margin."
        if lines:
            head = ["| pair | distance | headroom |", "| --- | --: | --: |"]
            text = "\n".join([*head, *lines])
        if len(pairs) > LISTED:
            text += f"\n\n… and {len(pairs) - LISTED} more"
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
    """The reported pair of a name, or the nearest one; None if it is not reported."""
    found = (pair for pair in cycle.pairs if name in (NEAREST, pair_name(pair)))
    return next(found, None)


def inert(name: str) -> str:
    """A name in which no sign means anything in Markdown or HTML."""
    return "".join(sign if sign.isalnum() else f"&#{ord(sign)};" for sign in name)
