"""The page: one file of HTML that asks nobody for anything."""

from pathlib import Path

import plotly.graph_objects as go
from plotly.io import to_html
from plotly.offline import get_plotlyjs

from armguard.station.blackbox.report import figures, sections, sections_of_record
from armguard.station.blackbox.report.findings import Findings
from armguard.station.blackbox.report.sentences import (
    NOT,
    more_left,
    summary,
    when,
)
from armguard.station.blackbox.report.spoken import Sense
from armguard.station.blackbox.report.style import CSS
from armguard.station.blackbox.report.tables import level_key, paragraph, section
from armguard.station.blackbox.report.words import (
    duration,
    millimetres,
    safe,
    share,
    short_time,
)
from armguard.station.errors import StationError

# Whatever a name in the recording holds: the page may fetch nothing from anywhere.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'"
)

CONFIG = {"displaylogo": False, "responsive": True, "displayModeBar": "hover"}

PLACES = (
    ("what", "What this is"),
    ("levels", "Levels"),
    ("timeline", "Time line"),
    ("near", "Near misses"),
    ("stops", "Stops"),
    ("closest", "Closest pairs"),
    ("slack", "Slack"),
    ("times", "Cycle times"),
    ("ages", "Ages"),
    ("contracts", "Contracts"),
    ("model", "Model"),
    ("events", "Events"),
    ("file", "File"),
)


def page(findings: Findings) -> str:
    """A recording as one page.

    Args:
        findings: What it holds.
    """
    title = f"armguard report: {findings.source}"
    parts = [
        f"<h1>{safe(findings.source)}</h1>",
        paragraph(f"armguard report · recorded {when(findings)}", "faint"),
        paragraph(summary(findings), "summary"),
        tiles(findings),
        paragraph(NOT, "small faint"),
        "<nav>"
        + " ".join(f'<a href="#{name}">{word}</a>' for name, word in PLACES)
        + "</nav>",
        sections_of_record.what(findings),
    ]
    if len(findings.series.t):
        parts += [
            sections.levels(
                findings,
                plot(figures.level_bars(findings), "plot-levels"),
                plot(figures.levels_over_time(findings), "plot-history"),
            ),
            section(
                "timeline",
                "Time line",
                paragraph(
                    "The worst of each instant: no peak is left out, however long the "
                    "recording. Drag to look closer, double-click to go back.",
                    "faint small",
                ),
                level_key(),
                plot(figures.time_line(findings), "plot-timeline"),
            ),
            sections.near_misses(findings),
            sections.stops(findings),
            sections.closest(findings),
            section(
                "slack",
                "How much was left",
                paragraph(
                    "For how long how much was left until a stop had to be ordered.",
                    "faint small",
                ),
                plot(figures.slack_histogram(findings), "plot-slack"),
                paragraph(more_left(findings), "small"),
            ),
            sections_of_record.times(
                findings, plot(figures.time_histogram(findings), "plot-times")
            ),
            sections_of_record.ages(findings),
            sections.contracts(findings),
        ]
    parts += [
        sections_of_record.model(findings.model, findings.info),
        sections.events(findings),
        sections_of_record.file(findings),
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<title>{safe(title)}</title><style>{CSS}</style>"
        f"<script>{get_plotlyjs()}</script></head><body><main>"
        + "\n".join(parts)
        + "</main></body></html>\n"
    )


def write_page(findings: Findings, path: Path) -> None:
    """Write the page into a file.

    Raises:
        StationError: It cannot be written.
    """
    try:
        path.write_text(page(findings), encoding="utf-8")
    except OSError as error:
        raise StationError(
            f"{path}: the page cannot be written: {error.strerror}"
        ) from error


def tiles(findings: Findings) -> str:
    """The figures one looks for first."""
    series = findings.series
    stops, early = findings.stops, findings.stops_that_were(Sense.NEEDLESS)
    nearest = findings.free[0].distance if findings.free else None
    times = series.cycle_time
    worst = float(times.max()) if len(times) else None
    rows = [
        (duration(series.duration), "recorded", False),
        (f"{len(stops)}", f"stops, {len(early)} needless", bool(stops)),
        (f"{len(findings.near_misses)}", "near misses", bool(findings.near_misses)),
        (
            millimetres(nearest),
            "least distance",
            nearest is not None and nearest <= 0.0,
        ),
        (short_time(worst), "longest cycle", False),
        (
            f"{findings.misses:,}",
            f"deadline misses, {share(findings.misses, len(series.t))}",
            bool(findings.misses),
        ),
        (
            f"{findings.faults:,}",
            "cycles without credible input",
            bool(findings.faults),
        ),
    ]
    return (
        '<div class="tiles">'
        + "".join(
            f'<div class="tile{" bad" if bad else ""}"><b>{safe(value)}</b>'
            f"<span>{safe(word)}</span></div>"
            for value, word, bad in rows
        )
        + "</div>"
    )


def plot(figure: go.Figure | None, name: str) -> str:
    """A figure as a piece of the page; nothing if there is none."""
    if figure is None:
        return ""
    text: str = to_html(
        figure,
        include_plotlyjs=False,
        full_html=False,
        div_id=name,
        config=CONFIG,
        default_height=f"{figure.layout.height}px",
    )
    return f'<div class="plot">{text}</div>'
