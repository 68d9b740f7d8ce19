"""What came of an attack, and the table of docs/security.md, between its marks."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pages import rendered

BEGIN = "<!-- figures: written by make attack -->"
END = "<!-- end of figures -->"


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table.

    Attributes:
        door: What was attacked.
        attack: What was done.
        tried: How often.
        had: How often it had its effect.
        unit: What is counted as its effect.
        target: What is to come of it, in words.
        passed: Whether it did.
        note: What else is to be known.
        figures: Further figures, for the JSON.
    """

    door: str = field(default="service", kw_only=True)
    attack: str
    tried: int
    had: int
    unit: str
    target: str
    passed: bool
    note: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)


def none(
    attack: str,
    tried: int,
    had: int,
    unit: str = "accepted",
    *,
    wanted: int = 1,
    note: str = "",
    door: str = "service",
    **figures: Any,
) -> Row:
    """A row of what is never to have an effect, see `Row`.

    Args:
        attack: What was done.
        tried: How often.
        had: How often it had its effect.
        unit: What is counted as its effect.
        wanted: Least number of tries that make it a result.
        note: What else is to be known.
        door: What was attacked.
        figures: Further figures.
    """
    passed = had == 0 and tried >= wanted
    return Row(attack, tried, had, unit, "0", passed, note, figures, door=door)


def write_table(results: Mapping[str, Any], page: Path, kernels: str = "") -> None:
    """Put the figures into a page.

    Args:
        results: By door what came of the attacks.
        page: The page; it has both marks.
        kernels: The kernels each was tried with, in words.
    """
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    rows = [row for one in results.values() for row in one["rows"]]
    table = rendered("security", rows=rows, kernels=kernels)
    page.write_text(f"{before}{BEGIN}\n{table}{END}{after}", encoding="utf-8")
