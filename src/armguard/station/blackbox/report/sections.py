"""Sections of a report that tell what happened."""

from armguard.guard.levels import SENTENCES, Level
from armguard.station.blackbox.report.closest import Closest
from armguard.station.blackbox.report.findings import CONTRACTS, Findings
from armguard.station.blackbox.report.near_misses import NearMiss
from armguard.station.blackbox.report.palette import BLUE, VERMILLION
from armguard.station.blackbox.report.sentences import advice, moving_share
from armguard.station.blackbox.report.small_plot import small_plot
from armguard.station.blackbox.report.spoken import Sense
from armguard.station.blackbox.report.tables import (
    Cell,
    chip,
    link,
    paragraph,
    section,
    table,
)
from armguard.station.blackbox.report.words import (
    NOTHING,
    clock,
    count,
    duration,
    millimetres,
    safe,
    share,
    short_time,
)

# Near misses that are drawn, and rows of other tables; the JSON has them all.
MOST_DRAWN = 60
MOST_ROWS = 25
MOST_EVENTS = 200

SENSES = {
    Sense.NEEDED: "the arms were too near or too fast, or a stop was not what was "
    "declared",
    Sense.EARLY: "a closer fit, fresher data or a faster reaction would have let that "
    "very cycle pass; the stop would have come later, or not at all: nobody knows",
    Sense.NEEDLESS: "nothing was too near: the input could not be believed, or the "
    "guard's own limits were used up",
    Sense.UNKNOWN: "the recording does not tell",
}


def levels(findings: Findings, *plots: str) -> str:
    """Time at each level, with its plots."""
    series = findings.series
    columns = [("all together", series.time_at(series.level))]
    columns += [
        (name, series.time_at(series.levels[:, r]))
        for r, name in enumerate(findings.robots)
    ]
    rows: list[list[Cell]] = []
    for level in Level:
        if not any(times[level] for _, times in columns):
            continue
        row: list[Cell] = [chip(level)]
        for _, times in columns:
            part = share(times[level], series.judged)
            row.append(
                f"{duration(times[level])} · {part}" if times[level] else NOTHING
            )
        rows.append(row)
    heads = ["level", *(name for name, _ in columns)]
    return section(
        "levels",
        "Time at each level",
        paragraph(
            f"In {moving_share(findings)} of the time nobody was stopped.", "faint"
        ),
        *plots,
        table(heads, rows, numbers=range(1, len(heads))),
        "" if findings.robots else paragraph(FIXED, "faint small"),
    )


def near_misses(findings: Findings) -> str:
    """Every near miss: a table, and a plot of each."""
    misses, begin = findings.near_misses, findings.begin
    close = findings.closeness
    what = "a near miss is every stop"
    if close.clearance > 0.0:
        what += f", and less than {millimetres(close.clearance)} of clearance"
    else:
        what += ", and every pair nearer than it must be"
    if close.slack > 0.0:
        what += f", and less than {short_time(close.slack)} until a stop"
    drawn = misses[:MOST_DRAWN]
    rows: list[list[Cell]] = []
    for k, miss in enumerate(drawn, start=1):
        told = miss.told
        rows.append(
            [
                link(f"near-{k}", clock(miss.at - begin)),
                chip(miss.level),
                told.subject or NOTHING,
                millimetres(told.distance),
                millimetres(told.needed),
                millimetres(miss.clearance),
                duration(miss.ended - miss.began),
                NOTHING if told.cause is None else told.cause.value,
            ]
        )
    heads = (
        "time", "level", "pair", "distance", "needed", "least clearance", "lasted",
        "made by",
    )  # fmt: skip
    parts = [
        paragraph(f"Here {what}; what is less than a second apart is one.", "faint")
    ]
    if not misses:
        parts.append(paragraph("There was none."))
    else:
        parts.append(table(heads, rows, numbers=(3, 4, 5, 6), times=(0,)))
    if len(misses) > len(drawn):
        parts.append(
            paragraph(
                f"The first {len(drawn)} of {len(misses)} are shown; the JSON has all.",
                "note",
            )
        )
    if drawn:
        parts.append(KEY)
    parts += [one_near_miss(findings, k, miss) for k, miss in enumerate(drawn, start=1)]
    return section("near", f"Near misses: {len(misses)}", *parts)


FIXED = "All robots are of mode “fixed”, whose level is one for all of them."

KEY = (
    '<p class="key small faint">Plots, from 2 s before to 3 s after:'
    f'<i style="border-color:{BLUE}"></i>distance of the nearest pair'
    f'<i style="border-color:{VERMILLION};border-top-style:dashed"></i>'
    "what it had to keep; below, the level. Where they meet, a stop is ordered.</p>"
)


def one_near_miss(findings: Findings, number: int, miss: NearMiss) -> str:
    """A near miss in words, and its plot."""
    told, begin = miss.told, findings.begin
    lines = [told.why]
    if told.remedy:
        lines.append(f"What would have let this cycle pass: {told.remedy}.")
    if miss.nearest_at != miss.at and miss.nearest.clearance is not None:
        lines.append(
            f"Least clearance {millimetres(miss.clearance)} at "
            f"{clock(miss.nearest_at - begin)}: {miss.nearest.why}"
        )
    plot = small_plot(
        findings.series, miss.at - begin, miss.began - begin, miss.ended - begin
    )
    head = f"{number}. at {clock(miss.at - begin)}, cycle {miss.cycle:,}"
    return (
        f'<div class="miss" id="near-{number}"><h3>{safe(head)} '
        f"{chip(miss.level).text}</h3>"
        + "".join(paragraph(text, "small") for text in lines)
        + plot
        + "</div>"
    )


def stops(findings: Findings) -> str:
    """Stops and slows by cause, and what they were good for."""
    every = findings.stops
    slows = len(findings.halts) - len(every)
    rows: list[list[Cell]] = [
        [
            sense.value,
            len(own),
            share(len(own), len(every)),
            SENSES[sense],
        ]
        for sense in Sense
        if (own := findings.stops_that_were(sense))
    ]
    causes: list[list[Cell]] = [
        [
            "not known" if c.cause is None else c.cause.value,
            c.stops,
            c.slows,
            ", ".join(f"{r.name} {n}" for r, n in c.reasons.most_common()) or NOTHING,
            millimetres(c.most, 2),
            c.remedy or NOTHING,
        ]
        for c in findings.causes
    ]
    parts = [
        paragraph(
            f"{count(len(every), 'stop').capitalize()} and {count(slows, 'slow')}."
        )
    ]
    if rows:
        parts += [
            "<h3>Were they needed?</h3>",
            table(
                ("stops", "number", "share", "which means"),
                rows,
                numbers=(1, 2),
                times=(0,),
            ),
            paragraph(
                "By the guard's own classes. A stop is ordered in the first cycle that "
                "lacks something, so it hardly ever lacks much.",
                "faint small",
            ),
        ]
    if causes:
        heads = (
            "cause", "stops", "slows", "ordered for", "lacked at most",
            "what would have let that one pass",
        )  # fmt: skip
        parts += [
            "<h3>By cause</h3>",
            table(heads, causes, numbers=(1, 2, 4), times=(0,)),
        ]
    told = advice(findings)
    if told:
        parts.append(paragraph(told))
    reasons = findings.reasons
    listed: list[list[Cell]] = [
        [reason.name, number, share(number, len(findings.series.t)), SENTENCES[reason]]
        for reason, number in reasons.most_common()
    ]
    parts += [
        "<details><summary>Cycles by reason</summary>",
        table(("reason", "cycles", "share", "which means"), listed, numbers=(1, 2)),
        "</details>",
    ]
    return section("stops", "Stops and slows by cause", *parts)


def closest(findings: Findings) -> str:
    """Pairs that came closest."""
    heads = ("pair", "least distance", "at", "least clearance", "cycles near")
    total = len(findings.series.t)
    parts = [table(heads, closest_rows(findings, findings.free), numbers=(1, 3, 4),
                   times=(2,))]  # fmt: skip
    if not findings.free:
        parts = [paragraph("No pair came within the margin.")]
    elif len(findings.free) > MOST_ROWS:
        parts.append(paragraph(f"The {MOST_ROWS} nearest of {len(findings.free)}."))
    if findings.whole < total:
        parts.append(
            paragraph(
                f"Of {findings.whole:,} of {total:,} cycles all near pairs are "
                "recorded, of the others the one with the least clearance.",
                "faint small",
            )
        )
    return section("closest", "Closest pairs over the whole run", *parts)


def closest_rows(findings: Findings, pairs: list[Closest]) -> list[list[Cell]]:
    """Rows of a table of pairs."""
    return [
        [
            f"{pair.a} – {pair.b}",
            millimetres(pair.distance),
            clock(pair.at - findings.begin),
            millimetres(pair.clearance),
            f"{pair.cycles:,}",
        ]
        for pair in pairs[:MOST_ROWS]
    ]


def contracts(findings: Findings) -> str:
    """What was allowed to touch, when, and how near it came."""
    calls = [e for e in findings.events if e.text.get("call") in CONTRACTS]
    parts = []
    if findings.contracts:
        heads = ("pair", "least distance", "at", "least clearance", "cycles near")
        parts += [
            "<h3>Pairs that were near under a contract</h3>",
            table(
                heads,
                closest_rows(findings, findings.contracts),
                numbers=(1, 3, 4),
                times=(2,),
            ),
        ]
    if calls:
        rows: list[list[Cell]] = [
            [clock(e.at - findings.begin), str(e.text["call"]), arguments(e.text)]
            for e in calls[:MOST_EVENTS]
        ]
        parts += [
            "<h3>Calls</h3>",
            table(("time", "call", "arguments"), rows, times=(0, 1)),
        ]
    if not parts:
        parts = [paragraph("No contract was made or used.")]
    return section("contracts", "Allowances and contracts", *parts)


def events(findings: Findings) -> str:
    """All that was done between cycles."""
    others = [e for e in findings.events if e.text.get("call") not in CONTRACTS]
    rows: list[list[Cell]] = [
        [
            clock(e.at - findings.begin),
            e.kind.name.lower(),
            str(e.text.get("call", e.text.get("note", ""))),
            arguments(e.text),
        ]
        for e in others[:MOST_EVENTS]
    ]
    if not rows:
        return section(
            "events", "Events", paragraph("Nothing was done between cycles.")
        )
    parts = [table(("time", "kind", "what", "arguments"), rows, times=(0, 1, 2))]
    if len(others) > len(rows):
        parts.append(paragraph(f"The first {len(rows)} of {len(others)}.", "note"))
    return section(
        "events",
        "Events",
        f"<details><summary>{safe(count(len(others), 'event'))}</summary>",
        *parts,
        "</details>",
    )


# Letters of an argument that are shown.
MOST_LETTERS = 160


def arguments(text: object) -> str:
    """Arguments of a call in one line, as short as a table needs them."""
    if not isinstance(text, dict):
        return ""
    told = ", ".join(
        f"{name} {shortened(value)}"
        for name, value in text.items()
        if name not in ("call", "note") and value is not None
    )
    return told if len(told) <= MOST_LETTERS else told[: MOST_LETTERS - 1] + "…"


def shortened(value: object) -> str:
    """An argument with as many digits as people read."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return f"[{', '.join(shortened(item) for item in value)}]"
    return str(value)
