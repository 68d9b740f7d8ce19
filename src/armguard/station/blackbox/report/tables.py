"""Tables and other pieces of a page; all text becomes harmless here."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from armguard.guard.levels import Level
from armguard.station.blackbox.report.palette import COLOURS, ON_COLOUR, WORDS
from armguard.station.blackbox.report.words import safe


@dataclass(frozen=True, slots=True)
class Html:
    """What is HTML already, made of text that was made safe."""

    text: str


Cell = str | int | Html


def cell(value: Cell) -> str:
    """A cell's content as HTML."""
    return value.text if isinstance(value, Html) else safe(value)


def table(
    heads: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    numbers: Sequence[int] = (),
    times: Sequence[int] = (),
) -> str:
    """A table.

    Args:
        heads: Titles of the columns.
        rows: Their cells.
        numbers: Columns that hold numbers.
        times: Columns that hold times and are not broken.
    """

    def kind(k: int) -> str:
        name = "n" if k in numbers else "t" if k in times else ""
        return f' class="{name}"' if name else ""

    head = "".join(f"<th{kind(k)}>{safe(title)}</th>" for k, title in enumerate(heads))
    body = "".join(
        "<tr>"
        + "".join(f"<td{kind(k)}>{cell(value)}</td>" for k, value in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def facts(rows: Iterable[tuple[str, Cell]]) -> str:
    """Names and values."""
    return (
        "<dl>"
        + "".join(
            f"<dt>{safe(name)}</dt><dd>{cell(value)}</dd>" for name, value in rows
        )
        + "</dl>"
    )


def chip(level: Level) -> Html:
    """A level as a coloured word."""
    return Html(
        f'<span class="chip" style="background:{COLOURS[level]};'
        f'color:{ON_COLOUR[level]}">{safe(WORDS[level])}</span>'
    )


def level_key() -> str:
    """The word of every colour that a level has."""
    return "<p>" + " ".join(chip(level).text for level in Level) + "</p>"


def link(target: str, text: str) -> Html:
    """A link to a place on this page."""
    return Html(f'<a href="#{safe(target)}">{safe(text)}</a>')


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph."""
    name = f' class="{kind}"' if kind else ""
    return f"<p{name}>{safe(text)}</p>"


def section(name: str, title: str, *parts: str) -> str:
    """A section of the page."""
    return (
        f'<section id="{safe(name)}"><h2>{safe(title)}</h2>{"".join(parts)}</section>'
    )
