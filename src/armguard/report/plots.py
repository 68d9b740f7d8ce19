"""The plots of a report, as functions of its findings."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from armguard.guard.needs import LOOK_AHEAD
from armguard.guard.watch import SLOW_TIME_DEFAULT
from armguard.recording import palette
from armguard.recording.palette import State, hexadecimal
from armguard.report.cycles import (
    Floats,
    Series,
    distribution,
    least_in_each,
    state_shares,
    timeline,
)
from armguard.report.findings import Findings
from armguard.report.formatting import (
    clock,
    duration,
    plot_text,
    share,
    short_time,
)
from armguard.report.incidents import NearMiss

COLOURS = {state: hexadecimal(rgb) for state, rgb in palette.STATE_COLOURS.items()}
INK, FAINT, LINE, WHITE = "#1b1f24", "#5b6570", "#d5dae0", "#ffffff"
BLUE, GREEN = hexadecimal(palette.BLUE), hexadecimal(palette.GREEN)
VERMILLION, PURPLE = hexadecimal(palette.VERMILLION), hexadecimal(palette.PURPLE)

# Colour of letters on the colour of a state.
LETTERS = {
    state: WHITE if state >= State.STOP and state != State.RECOVER else INK
    for state in State
}

# Patterns distinguish the areas of states in black and white print, and a hold from a
# stop.
PATTERNS = dict(zip(State, ("", ".", "/", "", "\\", "-", "x", "+"), strict=True))

WORDS = {state: word.lower() for state, word in palette.STATE_WORDS.items()}

# Greatest headroom in plots [mm].
FARTHEST = 120.0

# The guard's prediction horizon: its time left is never greater [s].
LOOKED = LOOK_AHEAD * SLOW_TIME_DEFAULT * (1.0 - 1e-6)

# Bins of a histogram of times for each power of ten; spans of shares of states.
BINS, SPANS = 16, 120

# Time around a near miss [s], and points of a line in its plot.
BEFORE, AFTER, POINTS = 2.0, 3.0, 400

# Distances in the plot of a near miss at least reach up to here [mm].
LEAST_TOP = 20.0

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif"
AXIS = {"showgrid": True, "gridcolor": LINE, "zeroline": False, "automargin": True}
LEGEND = {"orientation": "h", "y": 1.1, "yanchor": "bottom", "x": 0}
LEGEND |= {"traceorder": "normal"}


def plots(findings: Findings, drawn: Sequence[NearMiss]) -> dict[str, go.Figure]:
    """The plots of a report with cycles, by the names of their places on the page.

    Args:
        findings: The findings.
        drawn: Near misses with a plot.
    """
    found = {"plot-states": state_bars(findings)}
    if unit_of(findings.series.duration)[1] > 1.0:
        found["plot-history"] = states_over_time(findings.series)
    found["plot-timeline"] = time_line(findings)
    found["plot-time-left"], found["plot-headroom"] = left_histograms(findings.series)
    found["plot-times"] = time_histogram(findings)
    for k, miss in enumerate(drawn, start=1):
        found[f"plot-near-{k}"] = near_miss(findings.series, miss)
    return found


def styled(figure: go.Figure, height: int, **layout: Any) -> go.Figure:
    """A figure of this height [px] with the look that all plots share."""
    look = {
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 70, "r": 20, "t": 30, "b": 45},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": FAINT, "activecolor": INK},
        "uniformtext": {"mode": "hide", "minsize": 9},
        "xaxis": AXIS,
        "yaxis": AXIS,
    }
    figure.update_layout(height=height, **layout)
    # Assigned, since an update would keep the library's own template.
    figure.layout.template = {"layout": look}
    return figure


def bars(x: Any, y: Any, colour: Any, hover: str, **options: Any) -> go.Bar:
    """Bars of one colour, or of one each, with their text where there is room."""
    options = {
        "marker": {"color": colour, "line": {"color": WHITE, "width": 0.5}},
        "textposition": "inside",
        "insidetextanchor": "middle",
        "textangle": 0,
        "hovertemplate": f"{hover}<extra></extra>",
    } | options
    return go.Bar(x=x, y=y, **options)


def state_bars(findings: Findings) -> go.Figure:
    """Time in each state: of all robots together, and of each."""
    columns, judged = findings.time_in, findings.series.judged
    names = [plot_text(name) for name, _ in columns]
    figure = go.Figure()
    for state in State:
        times, word = [times[state] for _, times in columns], WORDS[state]
        if not any(times):
            continue
        shares = [time / judged for time in times]
        pattern = {"shape": PATTERNS[state], "fgcolor": INK, "fgopacity": 0.22}
        bar = bars(
            [100.0 * part for part in shares],
            names,
            COLOURS[state],
            f"%{{y}}: {word} %{{customdata[0]}}, %{{customdata[1]}}",
            name=word,
            orientation="h",
            text=[f"{word} {part:.0%}" for part in shares],
            textfont={"color": LETTERS[state]},
            customdata=[[duration(time), share(time, judged)] for time in times],
        )
        bar.marker.pattern = pattern | {"fillmode": "overlay", "size": 7}
        figure.add_trace(bar)
    figure.update_xaxes(ticksuffix=" %", range=[0, 100])
    figure.update_yaxes(autorange="reversed")
    return styled(figure, 110 + 46 * len(columns), barmode="stack", legend=LEGEND)


def states_over_time(series: Series) -> go.Figure:
    """Share of each state in spans of a long recording."""
    unit, size = unit_of(series.duration)
    edges, shares = state_shares(series, SPANS)
    figure = go.Figure()
    for state, own in zip(State, shares, strict=True):
        if own.any():
            hover, marker = f"{WORDS[state]} %{{y:.1f}} %", {"color": COLOURS[state]}
            x = middles(edges) / size
            figure.add_trace(bars(x, 100.0 * own, None, hover, marker=marker))
    figure.update_xaxes(title_text=time_title(unit), range=[0, series.duration / size])
    figure.update_yaxes(ticksuffix=" %", range=[0, 100])
    return styled(figure, 190, barmode="stack", bargap=0.0, showlegend=False)


def time_line(findings: Findings) -> go.Figure:
    """States, headroom, time left and cycle time over the whole recording."""
    line, robots = timeline(findings.series), findings.robots or ("all",)
    unit, size = unit_of(findings.series.duration)
    heights = [0.10 + 0.05 * len(robots), 0.35, 0.22, 0.22]
    figure = make_subplots(
        rows=4, shared_xaxes=True, row_heights=heights, vertical_spacing=0.035
    )
    for name, states in zip(robots, line.states, strict=True):
        figure.add_trace(state_runs(plot_text(name), states, line.edges / size), 1, 1)
    headroom, time_left = line.headroom * 1e3, line.time_left * 1e3
    headroom[headroom > FARTHEST] = time_left[line.time_left >= LOOKED] = np.nan
    times = [clock(t) for t in line.t.tolist()]
    for row, values, colour, text in (
        (2, headroom, BLUE, "%{y:.1f} mm headroom"),
        (3, time_left, GREEN, "%{y:.0f} ms until a stop"),
        (4, line.cycle_time * 1e6, FAINT, "longest cycle %{y:.0f} µs"),
    ):
        curve = lines(line.t / size, values, f"%{{text}}: {text}", text=times)
        curve.line = {"color": colour, "width": 1.6, "shape": "hvh"}
        figure.add_trace(curve, row, 1)
    stops = findings.stops
    marks = lines(
        np.array([halt.t / size for halt in stops]),
        np.zeros(len(stops)),
        "%{text}",
        mode="markers",
        marker={"symbol": "triangle-down", "size": 10, "color": VERMILLION},
        text=[plot_text(f"stop: {halt.verdict.why}") for halt in stops],
    )
    figure.add_trace(marks, 2, 1)
    figure.add_hline(
        y=0.0,
        row=2,
        col=1,
        line={"color": VERMILLION, "dash": "dash", "width": 1.5},
        annotation_text="nothing left: stop",
        annotation_position="bottom right",
        annotation_font={"color": VERMILLION},
    )
    figure.update_yaxes(title_text="state", autorange="reversed", row=1)
    figure.update_yaxes(title_text="headroom [mm]", row=2)
    figure.update_yaxes(title_text="time left [ms]", row=3)
    figure.update_yaxes(title_text="cycle [µs]", type="log", dtick=1, row=4)
    figure.update_xaxes(range=[0.0, findings.series.duration / size])
    figure.update_xaxes(title_text=time_title(unit), row=4)
    return styled(figure, 640, showlegend=False, hovermode="x", barmode="overlay")


def lines(x: Floats, y: Floats, hover: str, **options: Any) -> go.Scatter:
    """A line, or marks, in single precision: pixels need no more."""
    x, y = x.astype(np.float32), y.astype(np.float32)
    options = {"mode": "lines", "hovertemplate": f"{hover}<extra></extra>"} | options
    return go.Scatter(x=x, y=y, **options)


def state_runs(name: str, states: NDArray[Any], edges: Floats) -> go.Bar:
    """Runs of one state as coloured bars, each with its word.

    Args:
        name: Name of the row.
        states: State from each edge to the next; NaN for none, shape (k,).
        edges: Times, shape (k + 1,).
    """
    # NaN becomes a state that does not exist, so that a gap is one run too.
    known = np.where(np.isnan(states), -1, states).astype(np.int64)
    starts = np.flatnonzero(np.diff(known, prepend=-2))
    ends = np.append(starts[1:], len(known))
    seen = known[starts] >= 0
    starts, ends = starts[seen], ends[seen]
    runs = [State(state) for state in known[starts].tolist()]
    return bars(
        edges[ends] - edges[starts],
        [name] * len(runs),
        None,
        "%{y}: %{text}",
        base=edges[starts],
        orientation="h",
        width=1.0,
        marker={"color": [COLOURS[state] for state in runs], "line": {"width": 0}},
        text=[WORDS[state] for state in runs],
        textfont={"color": [LETTERS[state] for state in runs]},
    )


def near_miss(series: Series, miss: NearMiss) -> go.Figure:
    """Distance of the nearest pair and needed separation around a near miss."""
    first, last = np.searchsorted(series.t, [miss.t - BEFORE, miss.t + AFTER])
    times = series.t[first:last] - miss.t
    left, distance = series.headroom[first:last], series.distance[first:last]
    seen = np.isfinite(distance) & np.isfinite(left)
    distance = np.where(seen, distance * 1e3, np.nan)
    needed = distance - np.where(seen, left * 1e3, np.nan)
    top, bottom = LEAST_TOP, 0.0
    if seen.any():
        # A distance may leave the plot; the needed separation may not.
        top = max(top, 1.3 * np.nanmax(needed), 2.0 * np.nanmin(distance))
        bottom = min(bottom, 1.1 * np.nanmin(distance))
    place = np.arange(len(times)) * POINTS // max(len(times), POINTS)
    points = least_in_each(np.where(seen, left, np.inf), place)
    figure = make_subplots(
        rows=2, shared_xaxes=True, row_heights=[0.86, 0.14], vertical_spacing=0.07
    )
    for values, name, line in (
        (distance, "distance", {"color": BLUE, "width": 2}),
        (needed, "needed", {"color": VERMILLION, "width": 1.6, "dash": "5px,3px"}),
    ):
        hover = f"{name} %{{y:.1f}} mm"
        figure.add_trace(lines(times[points], values[points], hover, line=line), 1, 1)
    edges = np.append(times, min(AFTER, times[-1] + series.period))
    figure.add_trace(state_runs("state", series.state[first:last], edges), 2, 1)
    start, end = max(miss.began - miss.t, -BEFORE), min(miss.ended - miss.t, AFTER)
    # One cycle is wide enough to be seen.
    end = max(end, start + 0.01)
    shade = {"fillcolor": VERMILLION, "opacity": 0.08, "line_width": 0}
    figure.add_vrect(start, end, row=1, col=1, **shade)
    figure.add_vline(0.0, line={"color": FAINT, "width": 1, "dash": "dot"})
    seconds = np.arange(-BEFORE, AFTER + 1.0)
    ticks = [f"{second:+.0f}" if second else "0 s" for second in seconds]
    figure.update_xaxes(range=[-BEFORE, AFTER], tickvals=seconds, ticktext=ticks)
    figure.update_xaxes(showgrid=False)
    figure.update_yaxes(range=[bottom, top], title_text="mm", row=1)
    figure.update_yaxes(showticklabels=False, fixedrange=True, row=2)
    margin = {"l": 60, "r": 12, "t": 12, "b": 24}
    look = {"font": {"size": 11}, "showlegend": False, "hovermode": "x"}
    return styled(figure, 200, margin=margin, **look)


def left_histograms(series: Series) -> tuple[go.Figure, go.Figure]:
    """Time spent at each time left, and at each headroom."""
    figures = go.Figure(), go.Figure()
    for figure, values, most, least, title, colour in (
        (figures[0], series.time_left, LOOKED * 1e3, 0.0, "time to a stop [ms]", GREEN),
        (figures[1], series.headroom, FARTHEST, -20.0, "headroom [mm]", BLUE),
    ):
        known = values * 1e3 < most
        number, weights = np.maximum(values[known] * 1e3, least), series.held[known]
        held, edges = np.histogram(number, 50, (least, most), weights=weights)
        times = [duration(time) for time in held.tolist()]
        hover = "%{x:.0f}: for %{hovertext}"
        figure.add_trace(bars(middles(edges), held, colour, hover, hovertext=times))
        figure.update_xaxes(title_text=title)
        figure.update_yaxes(title_text="duration [s]")
        styled(figure, 300, showlegend=False, bargap=0.0)
    figures[1].add_vline(x=0.0, line={"color": VERMILLION, "dash": "dash"})
    return figures


def time_histogram(findings: Findings) -> go.Figure:
    """Cycle times and answer times on logarithmic scales, which show the tails."""
    series, figure = findings.series, go.Figure()
    for values, name, colour in (
        (series.cycle_time, "judging", BLUE),
        (series.answer, "message in to judged", PURPLE),
    ):
        logs = np.log10(values[np.isfinite(values) & (values > 0.0)], dtype=np.float64)
        if not len(logs):
            continue
        low, high = np.floor(logs.min()), np.ceil(logs.max() + 1e-9)
        counts, edges = np.histogram(logs, int(high - low) * BINS, (low, high))
        times = [short_time(time) for time in (10.0**edges).tolist()]
        spans = np.array([f"{start} to {end}" for start, end in pairwise(times)])
        hover, seen = f"{name}, %{{hovertext}}: %{{y}} cycles", counts > 0
        bar = bars(middles(edges)[seen], counts[seen], colour, hover, name=name)
        bar.update(hovertext=spans[seen], opacity=0.75, width=1.0 / BINS)
        figure.add_trace(bar)
    numbers = distribution(series.cycle_time)
    marks = {"deadline": findings.deadline}
    if numbers is not None:
        marks |= {"p50": numbers.p50, "p99": numbers.p99}
        marks |= {"p99.9": numbers.p999, "max": numbers.most}
    for k, (name, time) in enumerate(marks.items()):
        if time > 0.0:
            figure.add_vline(
                x=np.log10(time),
                line={"width": 1, "dash": "dot"} if k else {"color": VERMILLION},
                annotation_text=f"{name} {short_time(time)}",
                annotation_position="top left" if k in (2, 4) else "top right",
                annotation_yshift=16 - 16 * k if k else -70,
                annotation_font={"size": 11} if k else {"color": VERMILLION},
            )
    labels = [f"{n} {unit}" for unit in ("µs", "ms", "s") for n in (1, 10, 100)]
    figure.update_xaxes(tickvals=[*range(-6, 3)], ticktext=labels, title_text="time")
    figure.update_yaxes(type="log", title_text="cycles", dtick=1)
    return styled(figure, 330, barmode="overlay", bargap=0.0, legend=LEGEND)


def middles(edges: Floats) -> Floats:
    """Middle of each bin."""
    return (edges[1:] + edges[:-1]) / 2.0


def unit_of(length: float) -> tuple[str, float]:
    """Unit of a time axis of this length [s], and the length of the unit [s]."""
    if length < 300.0:
        return "s", 1.0
    return ("min", 60.0) if length < 3.0 * 3600.0 else ("h", 3600.0)


def time_title(unit: str) -> str:
    """Title of a time axis."""
    return f"time since the first cycle [{unit}]"
