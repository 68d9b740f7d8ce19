"""The large plots of a report, as functions of its findings alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from armguard.guard.levels import Level
from armguard.guard.proofs import LOOK_AHEAD
from armguard.guard.watch import SLOW_TIME_DEFAULT
from armguard.station.blackbox.report.distribution import distribution
from armguard.station.blackbox.report.findings import Findings
from armguard.station.blackbox.report.palette import (
    BLUE,
    COLOURS,
    FAINT,
    GREEN,
    INK,
    LINE,
    ON_COLOUR,
    PATTERNS,
    VERMILLION,
    WORDS,
)
from armguard.station.blackbox.report.timeline import (
    Timeline,
    level_shares,
    timeline,
)
from armguard.station.blackbox.report.words import (
    clock,
    duration,
    in_plot,
    share,
    short_time,
)

Floats = NDArray[np.float64]

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif"

# Nothing beyond this is drawn of clearances [mm].
FARTHEST = 120.0

# The guard looks so far ahead; more slack than this it does not tell [s].
LOOKED = LOOK_AHEAD * SLOW_TIME_DEFAULT * (1.0 - 1e-6)

# Bins of a histogram of times, for each tenfold.
BINS_EACH_TENFOLD = 16

# Spans in which shares of levels are told.
SPANS = 120

# Shares of a bar below this have no room for words [-].
LEAST_WORDS = 0.06


def level_bars(findings: Findings) -> go.Figure:
    """Time at each level: all together, and each robot."""
    series = findings.series
    rows = [("all together", series.time_at(series.level))]
    rows += [
        (name, series.time_at(series.levels[:, r]))
        for r, name in enumerate(findings.robots)
    ]
    names = [in_plot(name) for name, _ in rows]
    figure = go.Figure()
    for level in Level:
        times = [row[level] for _, row in rows]
        if not any(times):
            continue
        shares = [time / series.judged if series.judged else 0.0 for time in times]
        figure.add_bar(
            y=names,
            x=[100.0 * part for part in shares],
            name=WORDS[level],
            orientation="h",
            marker={
                "color": COLOURS[level],
                "line": {"color": "#ffffff", "width": 1},
                "pattern": {
                    "shape": PATTERNS[level],
                    "fillmode": "overlay",
                    "fgcolor": INK,
                    "fgopacity": 0.22,
                    "size": 7,
                },
            },
            text=[
                f"{WORDS[level]} {part:.0%}" if part >= LEAST_WORDS else ""
                for part in shares
            ],
            textposition="inside",
            insidetextanchor="middle",
            textangle=0,
            textfont={"color": ON_COLOUR[level]},
            customdata=[[duration(time), share(time, series.judged)] for time in times],
            hovertemplate="%{y}: "
            + WORDS[level]
            + " %{customdata[0]}, %{customdata[1]}<extra></extra>",
        )
    figure.update_layout(
        barmode="stack",
        height=110 + 46 * len(rows),
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    )
    figure.update_xaxes(ticksuffix=" %", range=[0, 100])
    figure.update_yaxes(autorange="reversed", automargin=True)
    return styled(figure)


def levels_over_time(findings: Findings) -> go.Figure | None:
    """Share of each level in spans of a long recording; None of a short one."""
    series = findings.series
    unit, size = unit_of(series.duration)
    if size == 1.0:
        return None
    edges, held = level_shares(series, SPANS)
    figure = go.Figure()
    for level, own in zip(Level, held, strict=True):
        if own.any():
            figure.add_bar(
                x=rounded((edges[1:] + edges[:-1]) / 2.0 / size),
                y=[round(100.0 * part, 2) for part in own.tolist()],
                width=float(edges[1] - edges[0]) / size,
                name=WORDS[level],
                marker={"color": COLOURS[level], "line": {"width": 0}},
                hovertemplate=f"{WORDS[level]} %{{y:.1f}} %<extra></extra>",
            )
    figure.update_layout(barmode="stack", bargap=0.0, height=190, showlegend=False)
    figure.update_xaxes(
        title_text=f"time since the first cycle [{unit}]",
        range=[0.0, series.duration / size],
    )
    figure.update_yaxes(ticksuffix=" %", range=[0, 100])
    return styled(figure)


def time_line(findings: Findings) -> go.Figure:
    """Levels, clearance, slack and cycle time over the whole recording."""
    line = timeline(findings.series)
    robots = findings.robots or ("all",)
    unit, size = unit_of(findings.series.duration)
    heights = [0.10 + 0.05 * len(robots), 0.35, 0.22, 0.22]
    figure = make_subplots(
        rows=4,
        cols=1,
        shared_xaxes=True,
        row_heights=heights,
        vertical_spacing=0.035,
    )
    figure.add_trace(level_strip(line, robots, size), row=1, col=1)
    clearance = np.where(line.clearance * 1e3 > FARTHEST, np.nan, line.clearance * 1e3)
    add_line(figure, 2, line, clearance, BLUE, "%{y:.1f} mm left", size)
    slack = np.where(line.slack >= LOOKED, np.nan, line.slack * 1e3)
    add_line(figure, 3, line, slack, GREEN, "%{y:.0f} ms until a stop", size)
    add_line(
        figure, 4, line, line.cycle_time * 1e6, FAINT, "longest cycle %{y:.0f} µs", size
    )
    figure.add_hline(
        y=0.0,
        row=2,
        col=1,
        line={"color": VERMILLION, "dash": "dash", "width": 1.5},
        annotation_text="nothing left: stop",
        annotation_position="bottom right",
        annotation_font={"color": VERMILLION},
    )
    stops = findings.stops
    figure.add_scatter(
        x=[(halt.at - findings.begin) / size for halt in stops],
        y=[0.0] * len(stops),
        mode="markers",
        marker={"symbol": "triangle-down", "size": 10, "color": VERMILLION},
        text=[in_plot(f"stop: {halt.told.why}") for halt in stops],
        hovertemplate="%{text}<extra></extra>",
        row=2,
        col=1,
    )
    for row, title in enumerate(
        ("level", "clearance [mm]", "slack [ms]", "cycle [µs]"), start=1
    ):
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_yaxes(type="log", dtick=1, row=4, col=1)
    figure.update_yaxes(autorange="reversed", row=1, col=1)
    figure.update_xaxes(title_text=f"time since the first cycle [{unit}]", row=4, col=1)
    figure.update_xaxes(range=[0.0, findings.series.duration / size])
    figure.update_layout(height=640, showlegend=False, hovermode="x")
    return styled(figure)


def level_strip(line: Timeline, robots: Sequence[str], size: float) -> go.Heatmap:
    """Levels as coloured cells, one row for each robot."""
    steps = [float(level) for level in Level]
    place = {level: k for k, level in enumerate(steps)}
    codes = np.full(line.levels.shape, np.nan)
    for level, code in place.items():
        codes[line.levels == level] = code
    count = len(steps)
    scale: list[list[Any]] = []
    for k, level in enumerate(Level):
        scale += [[k / count, COLOURS[level]], [(k + 1) / count, COLOURS[level]]]
    words = [WORDS[level] for level in Level]
    text = [["" if c != c else words[int(c)] for c in row] for row in codes.tolist()]
    return go.Heatmap(
        x=rounded(line.t / size),
        y=[in_plot(name) for name in robots],
        z=[[None if c != c else int(c) for c in row] for row in codes.tolist()],
        text=text,
        zmin=-0.5,
        zmax=count - 0.5,
        colorscale=scale,
        showscale=False,
        hovertemplate="%{y}: %{text}<extra></extra>",
    )


def add_line(
    figure: go.Figure,
    row: int,
    line: Timeline,
    values: Floats,
    colour: str,
    told: str,
    size: float,
) -> None:
    """A line of the worst of each bucket."""
    figure.add_scatter(
        x=rounded(line.t / size),
        y=[None if v != v else float(f"{v:.4g}") for v in values.tolist()],
        mode="lines",
        line={"color": colour, "width": 1.6, "shape": "hvh"},
        text=[clock(t) for t in line.t.tolist()],
        hovertemplate="%{text}: " + told + "<extra></extra>",
        row=row,
        col=1,
    )


def slack_histogram(findings: Findings) -> go.Figure:
    """How long how much was left until a stop: in time, and in length."""
    series = findings.series
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.1, shared_yaxes=False)
    for col, (values, most, least, title, colour) in enumerate(
        (
            (series.slack, LOOKED * 1e3, 0.0, "time until a stop [ms]", GREEN),
            (series.clearance, FARTHEST, -20.0, "clearance [mm]", BLUE),
        ),
        start=1,
    ):
        number = values.astype(np.float64) * 1e3
        # What is too far away to matter is told in words.
        known = np.isfinite(number) & (number < most)
        edges = np.linspace(least, most, 51)
        held, _ = np.histogram(
            np.clip(number[known], least, None), edges, weights=series.held[known]
        )
        figure.add_bar(
            x=((edges[1:] + edges[:-1]) / 2.0).tolist(),
            y=held.tolist(),
            width=float(edges[1] - edges[0]),
            marker={"color": colour, "line": {"color": "#ffffff", "width": 0.5}},
            customdata=[[duration(t)] for t in held.tolist()],
            hovertemplate="%{x:.0f}: for %{customdata[0]}<extra></extra>",
            row=1,
            col=col,
        )
        figure.update_xaxes(title_text=title, row=1, col=col)
        figure.update_yaxes(title_text="for how long [s]", row=1, col=col)
    figure.add_vline(x=0.0, row=1, col=2, line={"color": VERMILLION, "dash": "dash"})
    figure.update_layout(height=300, showlegend=False, bargap=0.0)
    return styled(figure)


def time_histogram(findings: Findings) -> go.Figure:
    """How long judging took, and answers, on scales on which tails are seen."""
    series = findings.series
    figure = go.Figure()
    marks: list[tuple[float, str]] = []
    for values, name, colour in (
        (series.cycle_time, "judging", BLUE),
        (series.answer, "message in to judged", "#cc79a7"),
    ):
        numbers = distribution(values)
        known = values[np.isfinite(values) & (values > 0.0)].astype(np.float64)
        if numbers is None or not len(known):
            continue
        logs = np.log10(known)
        low, high = np.floor(logs.min()), np.ceil(logs.max() + 1e-9)
        edges = np.linspace(low, high, int(high - low) * BINS_EACH_TENFOLD + 1)
        counts, _ = np.histogram(logs, edges)
        seen = counts > 0
        middle = (edges[1:] + edges[:-1]) / 2.0
        figure.add_bar(
            x=middle[seen].tolist(),
            y=counts[seen].tolist(),
            width=1.0 / BINS_EACH_TENFOLD,
            name=name,
            marker={"color": colour, "line": {"color": "#ffffff", "width": 0.5}},
            opacity=0.75,
            customdata=[
                [short_time(10.0**a), short_time(10.0**b)]
                for a, b in zip(edges[:-1][seen], edges[1:][seen], strict=True)
            ],
            hovertemplate=f"{name}, %{{customdata[0]}} to %{{customdata[1]}}: "
            "%{y} cycles<extra></extra>",
        )
        if not marks:
            marks = [
                (numbers.p50, "p50"),
                (numbers.p99, "p99"),
                (numbers.p999, "p99.9"),
                (numbers.most, "max"),
            ]
    for k, (value, name) in enumerate(marks):
        if value > 0.0:
            figure.add_vline(
                x=float(np.log10(value)),
                line={"color": INK, "width": 1, "dash": "dot"},
                annotation_text=f"{name} {short_time(value)}",
                annotation_position="top left" if k % 2 else "top right",
                annotation_yshift=-16 * k,
                annotation_font={"size": 11},
            )
    figure.add_vline(
        x=float(np.log10(findings.deadline)),
        line={"color": VERMILLION, "width": 2},
        annotation_text=f"deadline {short_time(findings.deadline)}",
        annotation_position="top right",
        annotation_yshift=-70,
        annotation_font={"color": VERMILLION},
    )
    decades = range(-7, 2)
    figure.update_xaxes(
        tickvals=list(decades),
        ticktext=[round_time(10.0**k) for k in decades],
        title_text="time",
    )
    figure.update_yaxes(type="log", title_text="cycles", dtick=1)
    figure.update_layout(
        height=330,
        barmode="overlay",
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    )
    return styled(figure)


def round_time(seconds: float) -> str:
    """A power of ten as a time."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size * 0.999:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds * 1e9:.0f} ns"


def unit_of(length: float) -> tuple[str, float]:
    """Unit of a time axis, and how long it is [s]."""
    if length < 300.0:
        return "s", 1.0
    return ("min", 60.0) if length < 3.0 * 3600.0 else ("h", 3600.0)


def rounded(t: Floats) -> list[float]:
    """Times a page needs no more digits of."""
    return [round(value, 5) for value in t.tolist()]


def styled(figure: go.Figure) -> go.Figure:
    """The look all plots share."""
    figure.update_layout(
        template=go.layout.Template(),
        font={"family": FONT, "size": 13, "color": INK},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        margin={"l": 70, "r": 20, "t": 30, "b": 45},
        hoverlabel={"font": {"family": FONT}},
    )
    figure.update_xaxes(gridcolor=LINE, linecolor=LINE, zeroline=False)
    figure.update_yaxes(gridcolor=LINE, linecolor=LINE, zeroline=False)
    return figure
