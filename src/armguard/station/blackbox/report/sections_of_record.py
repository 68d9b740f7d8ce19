"""Sections of a report about the guard, its model and the file."""

from collections.abc import Mapping

from armguard.station.blackbox.report.distribution import Distribution, distribution
from armguard.station.blackbox.report.findings import Findings
from armguard.station.blackbox.report.model import Claims, ModelFacts
from armguard.station.blackbox.report.sentences import when
from armguard.station.blackbox.report.tables import (
    Cell,
    facts,
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

# What a recording says of itself that has a place of its own on the page.
SHOWN = ("names", "robots", "bodies", "note", "period", "archive")

# Gaps that are listed.
MOST_GAPS = 20


def what(findings: Findings) -> str:
    """What was recorded, with what."""
    series, info = findings.series, findings.info
    rows: list[tuple[str, Cell]] = [
        ("file", findings.source),
        ("recorded", when(findings)),
        ("length", f"{duration(series.duration)}, {len(series.t):,} cycles"),
        ("period", f"{short_time(series.period)} as declared, {measured(findings)}"),
        ("robots", ", ".join(findings.everyone)),
    ]
    rows += [
        (titled(name), str(value))
        for name, value in info.items()
        if name not in SHOWN and not isinstance(value, dict | list)
    ]
    parts = [facts(rows)]
    for name, settings in info.items():
        if isinstance(settings, Mapping) and settings:
            parts += [
                f"<details><summary>{safe(titled(name))}</summary>",
                facts([(path, str(value)) for path, value in flat(settings)]),
                "</details>",
            ]
    return section("what", "What this is", *parts)


def titled(name: object) -> str:
    """A name of a setting as words."""
    return str(name).replace("_", " ")


def measured(findings: Findings) -> str:
    """The period as it was."""
    held = findings.series.held
    numbers = distribution(held[:-1]) if len(held) > 1 else None
    return "not measured" if numbers is None else f"{short_time(numbers.p50)} at p50"


def flat(settings: Mapping[str, object], lead: str = "") -> list[tuple[str, object]]:
    """Settings within settings, each with its path."""
    rows: list[tuple[str, object]] = []
    for name, value in settings.items():
        path = f"{lead}{name}"
        if isinstance(value, Mapping):
            rows += flat(value, f"{path}.")
        else:
            rows.append((path, value))
    return rows


def times(findings: Findings, plot: str) -> str:
    """How long judging took, and whether it was in time."""
    series = findings.series
    rows: list[list[Cell]] = []
    for name, numbers in (
        ("judging", distribution(series.cycle_time)),
        ("message in to judged", distribution(series.answer)),
        ("from cycle to cycle", distribution(series.held[:-1])),
    ):
        rows.append([name, *tails(numbers)])
    misses, total = findings.misses, len(series.t)
    told = (
        f"{count(misses, 'deadline miss', 'deadline misses').capitalize()} in "
        f"{total:,} cycles ({share(misses, total)}): a cycle is to end within "
        f"{short_time(findings.deadline)} of its message, or of its beginning where "
        "the recording does not tell when that came."
    )
    return section(
        "times",
        "Cycle times",
        paragraph(told),
        plot,
        table(("", "p50", "p99", "p99.9", "max"), rows, numbers=(1, 2, 3, 4)),
    )


def tails(numbers: Distribution | None) -> list[Cell]:
    """Median and tails of times."""
    if numbers is None:
        return [NOTHING] * 4
    return [
        short_time(value)
        for value in (numbers.p50, numbers.p99, numbers.p999, numbers.most)
    ]


def ages(findings: Findings) -> str:
    """How old the input was."""
    rows: list[list[Cell]] = []
    for k, (name, numbers) in enumerate(findings.ages().items()):
        declared = findings.sensing[k]
        late = int((findings.series.ages[:, k] > declared * (1.0 + 1e-6)).sum())
        rows.append(
            [
                name,
                *tails(numbers),
                short_time(declared),
                f"{late:,} · {share(late, len(findings.series.t))}",
            ]
        )
    heads = (
        "robot", "p50", "p99", "p99.9", "max", "declared delay", "cycles older",
    )  # fmt: skip
    told = (
        table(heads, rows, numbers=range(1, 7))
        if rows
        else paragraph("Robots of mode “fixed” have no ages.")
    )
    return section(
        "ages",
        "Ages of the input",
        paragraph(
            "How old each robot's measurement may have been when it was judged; all of "
            "it is in what pairs had to keep.",
            "faint",
        ),
        told,
    )


def model(facts_: ModelFacts | None, info: Mapping[str, object]) -> str:
    """The model: its hashes, fits, figures and proofs."""
    if facts_ is None:
        told = paragraph("The scene is not in the recording.", "note")
        return section("model", "Model, figures and proofs", told)
    rows: list[list[Cell]] = [
        [
            r.name,
            r.mode,
            r.response,
            r.joints,
            f"{r.links} links, {r.primitives} primitives",
            f"{millimetres(r.overreach)} ({r.worst_link})",
            f"{r.contained} of {r.links}",
            f"{r.assumed} of {r.figures}" if r.figures else "none declared",
            r.fingerprint or "files not here",
        ]
        for r in facts_.robots
    ]
    heads = (
        "robot", "mode", "response", "joints", "geometry", "overreach at most",
        "fits contained", "figures assumed", "fingerprint",
    )  # fmt: skip
    assumed = sum(r.assumed for r in facts_.robots)
    hashed = info.get("scene_hash", info.get("archive", "not told"))
    parts = [
        table(heads, rows, numbers=(3,), times=(8,)),
        facts(
            [
                ("scene hash", str(hashed)),
                ("objects", facts_.objects),
                ("buffer at most", millimetres(facts_.buffer)),
                ("pairs told from", millimetres(facts_.margin)),
                ("period", late_period(facts_)),
                ("allowed pairs", ", ".join(f"{n} {who}" for who, n in
                                            facts_.allowed.items()) or "none"),
                ("claims and proofs", claims(facts_.claims)),
            ]
        ),
    ]  # fmt: skip
    if facts_.claims.contradicted:
        parts.append(
            paragraph(
                "Belied by a proof: " + ", ".join(facts_.claims.contradicted), "note"
            )
        )
    if assumed:
        parts.append(
            paragraph(
                f"{assumed} stopping figures are assumptions: nobody measured them, "
                "and every stop was proven by them. “armguard check” lists them.",
                "note",
            )
        )
    return section("model", "Model, figures and proofs", *parts)


def late_period(facts_: ModelFacts) -> str:
    """The declared period, and how late a cycle may be."""
    told = short_time(facts_.period)
    if not facts_.late:
        return f"{told}, no cycle may be late"
    return f"{told}, a cycle may be {short_time(facts_.late)} late"


def claims(found: Claims) -> str:
    """Claims that pairs need no check, and what is proven of them."""
    if not found.count:
        return "no file or scene claims of two links of a robot that they need no check"
    if not found.known:
        return (
            f"{found.count} claims; the robots' files are not here, so no proof could "
            "be looked for"
        )
    told = ", ".join(f"{status} {number}" for status, number in found.by_status.items())
    more = found.by_status.get("open", 0)
    hint = "; “armguard check --prove” decides more" if more else ""
    return f"{found.count} claims: {told}{hint}"


def file(findings: Findings) -> str:
    """Gaps and damage."""
    series = findings.series
    parts = [paragraph(problem, "note") for problem in findings.problems]
    if series.missing:
        parts.append(
            paragraph(
                f"{count(series.missing, 'cycle')} that was judged is not in the file: "
                "numbers are missing."
                if series.missing == 1
                else f"{series.missing:,} cycles that were judged are not in the file: "
                "numbers are missing.",
                "note",
            )
        )
    if len(series.gaps):
        rows: list[list[Cell]] = [
            [
                clock(series.time_of(k)),
                duration(float(series.t[k + 1] - series.t[k])),
            ]
            for k in series.gaps[:MOST_GAPS].tolist()
        ]
        parts += [
            paragraph(
                f"{count(len(series.gaps), 'gap')} in which nothing was judged; they "
                "count for no level.",
                "note",
            ),
            table(("from", "length"), rows, numbers=(1,), times=(0,)),
        ]
    if not parts:
        parts = [
            paragraph("The file is whole: no cycle is missing, nothing is damaged.")
        ]
    return section("file", "Gaps and damage", *parts)
