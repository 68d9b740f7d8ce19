"""One page about the results of a fleet."""

import shlex
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.io.json import to_json_plotly
from plotly.offline import get_plotlyjs

from armguard.errors import StationError
from armguard.fleet.manifest import Manifest
from armguard.fleet.store import query
from armguard.report.formatting import count, plot_text
from armguard.report.page import TEMPLATES
from armguard.report.plots import BLUE, VERMILLION, styled

# Inputs that each table lists, and bins of the plots.
MOST, BINS = 20, 60

# Figures whose greatest values are outliers, with their titles and units.
OUTLIERS = (
    ("top_speed", "Fastest, in shares of a joint's top speed", ""),
    ("rest_offset", "Leader and follower farthest apart at rest", " rad or m"),
    ("beyond_limits", "Most joints beyond their limits", ""),
    ("longest_hold", "Arms held longest", " s"),
)

# What a page says of its figures, by the work.
REMARKS = {
    "audit": "It shows what recorded positions come to in the model of the scene. A "
    "stop counts as needless if no pair came nearer than its buffer in the rest of "
    "that recording.",
    "verify": "It shows what plans come to in the model of the scene.",
    "replay": "It shows what the guard decides about recorded measurements.",
    "run": "It shows what simulated robots do in the model of the scene: they keep "
    "their declared figures, unless the job has them break these. A stop counts as "
    "needless if the desired motion keeps every buffer for another second without the "
    "guard.",
}

RESULT = "item, input, episode, scene, setting"


def write_report(out: Path, path: Path) -> None:
    """Write the page about results.

    Args:
        out: Their folder.
        path: The page.

    Raises:
        FleetError: There are no results.
        StationError: The page cannot be written.
    """
    text = page(out)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StationError(
            f"{path}: the page cannot be written: {error.strerror}"
        ) from error


def page(out: Path) -> str:
    """The page about results."""
    manifest = Manifest.read(out)
    [totals] = rows(
        out,
        "select count(*) as items, count(*) filter (clear) as clear, "
        "count(*) filter (contacts > 0) as contacts, count(error) as failed, "
        "count(*) filter (len(findings) > 0) as found, sum(frames) as frames, "
        "min(least) as least, count(stop) as stops, "
        "count(*) filter (needless) as needless, any_value(judge) as judge "
        "from results",
    )
    tables = {
        title: with_command(out, manifest, found)
        for title, found in listed(out).items()
        if found
    }
    figures = plots(out)
    return TEMPLATES.get_template("fleet.html.j2").render(
        name=out.name,
        manifest=manifest,
        total=totals,
        remark=REMARKS[manifest.work],
        summary=summary(manifest, totals),
        kinds=rows(
            out,
            "select kind, count(*) as findings, count(distinct item) as items "
            "from findings group by kind order by items desc, kind",
        ),
        groups=rows(
            out,
            "select scene, setting, count(*) as items, count(*) filter (clear) as "
            "clear, min(least) as least, count(stop) as stops, "
            "count(*) filter (needless) as needless, avg(done) as done from results "
            "group by scene, setting order by min(item)",
        ),
        tables=tables,
        figures=figures,
        figures_json=to_json_plotly(figures),
        plotlyjs=get_plotlyjs(),
    )


def rows(out: Path, sql: str) -> list[dict[str, Any]]:
    """Rows of a query by name."""
    names, found = query(out, sql)
    return [dict(zip(names, row, strict=True)) for row in found]


def summary(manifest: Manifest, total: dict[str, Any]) -> str:
    """The results in a sentence or two."""
    text = (
        f"{count(len(manifest.inputs), 'input')}, {count(total['items'], 'result')}: "
        f"{total['clear']:,} clear, {total['found']:,} with findings"
    )
    if total["contacts"]:
        text += f", {total['contacts']:,} of them with contacts"
    text += "."
    if total["failed"]:
        text += f" {count(total['failed'], 'input')} could not be judged."
    return text


def listed(out: Path) -> dict[str, list[dict[str, Any]]]:
    """The worst inputs, by the title of their table."""
    shown = f"select {RESULT}, "
    found = {
        "Could not be judged": rows(
            out,
            f"{shown} error as what from results where error is not null "
            f"order by item limit {MOST}",
        ),
        "Contacts": rows(
            out,
            f"{shown} text as what from findings where kind in ('contact', "
            f"'self-contact') order by value, item limit {MOST}",
        ),
        "Least distances": rows(
            out,
            f"{shown} format('{{:.2f}} mm, {{}} to {{}}, at {{:.3f}} s', "
            "1e3 * least, a, b, time) as what from results where least is not null "
            f"order by least, item limit {MOST}",
        ),
        "Needless stops": needless(out),
        "Least of the motion done": rows(
            out,
            f"{shown} format('{{:.0f}} %', 100.0 * done) as what from results "
            f"where done < 0.95 order by done, item limit {MOST}",
        ),
    }
    for column, title, unit in OUTLIERS:
        found[title] = rows(
            out,
            f"{shown} format('{{:.4g}}{unit}', {column}::double) as what from results "
            f"where {column} > 0 order by {column} desc, item limit {MOST}",
        )
    return found


def needless(out: Path) -> list[dict[str, Any]]:
    """Needless stops."""
    return rows(
        out,
        f"select {RESULT}, text as what from findings where kind = 'needless stop' or "
        "(kind = 'stop' and item in (select item from results where needless and "
        f"needless_stops is null)) order by item limit {MOST}",
    )


def with_command(
    out: Path, manifest: Manifest, found: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows with the command that shows each in the view."""
    for row in found:
        if manifest.work == "replay":
            words = ["armguard", "view", str(manifest.folder / row["input"])]
        else:
            words = ["armguard", "fleet", "view", str(out), str(row["item"])]
        row["command"] = shlex.join(words)
    return found


def plots(out: Path) -> dict[str, go.Figure]:
    """Histograms of the results."""
    figures = {}
    for name, column, title, scale in (
        ("plot-least", "least", "least distance of an input [mm]", 1e3),
        ("plot-speed", "top_speed", "greatest speed, in shares of the top speed", 1.0),
        ("plot-offset", "rest_offset", "offset at rest [rad or m]", 1.0),
        ("plot-done", "done", "share of the motion that was done [%]", 1e2),
    ):
        values = [
            scale * row["value"]
            for row in rows(
                out,
                f"select {column} as value from results where {column} is not null "
                "order by item",
            )
        ]
        if values:
            bars = go.Histogram(x=values, nbinsx=BINS, marker={"color": BLUE})
            figures[name] = styled(
                go.Figure(bars),
                260,
                xaxis={"title": plot_text(title)},
                yaxis={"title": "inputs"},
            )
            if column == "least":
                figures[name].add_vline(x=0.0, line={"color": VERMILLION, "width": 2})
    return figures
