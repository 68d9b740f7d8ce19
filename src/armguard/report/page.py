"""The page: one file of HTML that loads nothing."""

from collections.abc import Mapping
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from plotly.io.json import to_json_plotly
from plotly.offline import get_plotlyjs

from armguard.errors import StationError
from armguard.recording.palette import State
from armguard.recording.recording import reading
from armguard.report import plots
from armguard.report.cycles import Distribution, distribution
from armguard.report.findings import Findings
from armguard.report.formatting import (
    NOTHING,
    clock,
    count,
    duration,
    millimetres,
    share,
    short_time,
)
from armguard.report.incidents import Sense

# Sections of the page, and their links at its top.
PLACES = (
    ("what", "About"),
    ("states", "States"),
    ("timeline", "Time line"),
    ("near", "Near misses"),
    ("stops", "Stops"),
    ("closest", "Closest pairs"),
    ("headroom", "Headroom"),
    ("times", "Cycle times"),
    ("ages", "Ages"),
    ("contracts", "Contracts"),
    ("model", "Model"),
    ("events", "Events"),
    ("file", "File"),
)

# Near misses with a plot; the JSON has all.
MOST_DRAWN = 60

# Calls that change which pairs may touch.
CONTRACTS = ("grasp", "release", "allow")

# Entries of the metadata that have another place on the page.
SHOWN = ("names", "robots", "bodies", "note", "period", "late", "began", "archive")

# Letters of a call's arguments.
MOST_LETTERS = 160


def page(findings: Findings) -> str:
    """The page of a recording."""
    series, drawn = findings.series, findings.near_misses[:MOST_DRAWN]
    figures = plots.plots(findings, drawn) if len(series.t) else {}
    # Without stopping figures a robot has a declared delay of NaN, but no age.
    ages = zip(series.ages.T, findings.sensing, strict=False)
    return TEMPLATES.get_template("page.html.j2").render(
        f=findings,
        series=series,
        model=findings.model,
        places=PLACES,
        summary=summary(findings),
        advice=advice(findings),
        drawn=drawn,
        calls=[e for e in findings.events if e.text.get("call") in CONTRACTS],
        others=[e for e in findings.events if e.text.get("call") not in CONTRACTS],
        figures=figures,
        figures_json=to_json_plotly(figures),
        plotlyjs=get_plotlyjs(),
        moving=series.held[series.state < State.STOP].sum(),
        far=series.held[~(series.time_left < plots.LOOKED)].sum(),
        alone=series.held[np.isinf(series.headroom)].sum(),
        older=[int((age > late * (1.0 + 1e-6)).sum()) for age, late in ages],
    )


def write_page(findings: Findings, path: Path) -> None:
    """Write the page into a file.

    Raises:
        StationError: It cannot be written, or the findings have content that no
            recorder writes.
    """
    try:
        with reading(findings.source):
            text = page(findings)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StationError(
            f"{path}: the page cannot be written: {error.strerror}"
        ) from error


def recorded(wall: float) -> str:
    """A time of the wall clock [s since 1970] in words."""
    if not isfinite(wall):
        return "at a time that is not known"
    return f"{datetime.fromtimestamp(wall, UTC):%Y-%m-%d %H:%M:%S} UTC"


def tails(numbers: Distribution | None) -> list[str]:
    """Median, tails and greatest of times [s]."""
    if numbers is None:
        return [NOTHING] * 4
    times = numbers.p50, numbers.p99, numbers.p999, numbers.most
    return [short_time(time) for time in times]


def flat(settings: Mapping[str, object], lead: str = "") -> list[tuple[str, object]]:
    """Nested settings as rows, each with its path."""
    rows: list[tuple[str, object]] = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            rows += flat(value, f"{lead}{name}.")
        else:
            rows.append((f"{lead}{name}", value))
    return rows


def arguments(text: Mapping[str, Any]) -> str:
    """Arguments of a call in one line of a table."""
    line = ", ".join(
        f"{name} {shortened(value)}"
        for name, value in text.items()
        if name not in ("call", "note") and value is not None
    )
    return line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 1] + "…"


def shortened(value: object) -> str:
    """An argument with four digits."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return f"[{', '.join(shortened(item) for item in value)}]"
    return str(value)


def summary(findings: Findings) -> str:
    """A recording in a sentence or two."""
    series, robots, stops = findings.series, len(findings.everyone), findings.stops
    if not len(series.t):
        return "There is no cycle in this recording."
    text = (
        f"In {duration(series.duration)} {count(robots, 'robot')} "
        f"{'was' if robots == 1 else 'were'} judged {len(series.t):,} times: "
        f"{count(len(stops), 'stop')}"
    )
    if stops:
        needless = len(findings.stops_that_were(Sense.NEEDLESS))
        text += f" ({needless or 'none'} of them needless)"
    misses = count(len(findings.near_misses), "near miss", "near misses")
    text += f", {misses}. {nearest_sentence(findings)}"
    if faults := findings.faults:
        text += (
            f" In {count(faults, 'cycle')} the input was not credible "
            "(NaN, stale or missing)."
        )
    if findings.problems or series.missing:
        text += " The recording is not whole; see below."
    if gaps := len(series.gaps):
        text += f" There {'is' if gaps == 1 else 'are'} {count(gaps, 'gap')} in it."
    return text


def nearest_sentence(findings: Findings) -> str:
    """The nearest pair, and whether anything touched."""
    if not findings.free:
        return "Nothing came within the margin in which pairs are reported."
    pair = findings.free[0]
    names, at = f"{pair.a} and {pair.b}", clock(pair.at)
    if pair.distance <= 0.0:
        overlap = millimetres(-pair.distance)
        return f"The modelled surfaces of {names} overlapped by {overlap} at {at}."
    touched = any(contract.distance <= 0.0 for contract in findings.contracts)
    but = " but what a contract let touch" if touched else ""
    apart = millimetres(pair.distance)
    return f"Nothing touched{but}; nearest were {names}, {apart} apart at {at}."


def advice(findings: Findings) -> str:
    """What would have let the most stops pass; "" if that is not known."""
    for cause in findings.causes:
        if cause.cause is not None and cause.stops and cause.remedy:
            return (
                f"Most stops ({cause.stops} of {len(findings.stops)}) have the cause "
                f"“{cause.cause.value}”. To avoid the one that lacked most: "
                f"{cause.remedy}."
            )
    return ""


TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
TEMPLATES.filters |= {
    function.__name__: function
    for function in (
        *(clock, duration, millimetres, short_time, share, distribution),
        *(recorded, tails, flat, arguments),
    )
}
TEMPLATES.filters["thousands"] = "{:,}".format
TEMPLATES.globals |= {"NOTHING": NOTHING, "SHOWN": SHOWN}
TEMPLATES.globals |= {"State": State, "Sense": Sense, "look": plots, "count": count}
