"""Pages of docs/, written from figures and the Markdown of `templates/`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from episodes import kernels
from episodes.classes import percentile
from episodes.records import Figures, rows_of

DOCS = Path(__file__).parents[1] / "docs"


def number(value: float | None, form: str = "", none: str = "-") -> str:
    """A figure in a format of Python's, or a dash where there is none."""
    return none if value is None else format(value, form)


def millimetres(length: float | None) -> str:
    """A length [m], in mm."""
    return "–" if length is None else f"{1e3 * length:.1f}"


def power(x: float) -> str:
    """A small figure by its first digit and its power of ten."""
    return "0" if x == 0.0 else f"{x:.0e}".replace("e-0", "e-").replace("e+0", "e+")


def bold(text: str, misses: bool) -> str:
    """A figure, in bold if it misses its target."""
    return f"**{text}**" if misses else text


def in_cell(text: str) -> str:
    """Text of a cell, in which bars divide no columns."""
    return text.replace("|", "\\|")


PAGES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "templates"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
PAGES.filters |= {
    "number": number,
    "mm": millimetres,
    "power": power,
    "bold": bold,
    "in_cell": in_cell,
    "kernels": kernels.cell_of,
}


def rendered(template: str, **figures: Any) -> str:
    """A page.

    Args:
        template: Name of its file, without the ending.
        figures: What its template names.
    """
    return PAGES.get_template(f"{template}.md.j2").render(figures)


def page(name: str, results: Mapping[str, Figures]) -> str:
    """The page of a campaign of episodes.

    Args:
        name: Its results' file in docs, without the ending; also its template's.
        results: Figures of all its rows.
    """
    text = rendered(
        name,
        results=results,
        rows=[(kind, r) for kind, found in results.items() for r in rows_of(found)],
        note=kernels.note(),
        listed=listed,
        percentile=percentile,
    )
    return text.rstrip() + "\n"


def listed(counts: Mapping[str, int]) -> str:
    """Counts in words, the most frequent first."""
    first = sorted(counts.items(), key=lambda item: -item[1])
    return ", ".join(f"{n} {name}" for name, n in first) or "none"
