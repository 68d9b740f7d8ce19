"""The table of docs/security.md, between its marks."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

BEGIN = "<!-- figures: written by make attack -->"
END = "<!-- end of figures -->"


def write_table(results: Mapping[str, Any], page: Path, kernels: str = "") -> None:
    """Put the figures into a page.

    Args:
        results: By door what came of the attacks.
        page: The page; it has both marks.
        kernels: The kernels each was tried with, in words.
    """
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    lines = [
        BEGIN,
        "",
        "| attack | tried | target | seen | |",
        "| --- | --- | --- | --- | --- |",
        *(line(row) for one in results.values() for row in one["rows"]),
        "",
        kernels,
        "",
        END,
    ]
    page.write_text(before + "\n".join(lines) + after, encoding="utf-8")


def line(row: Mapping[str, Any]) -> str:
    """A row of the table."""
    seen = f"{row['had']:,} {row['unit']}"
    if row["note"]:
        seen += f"; {row['note']}"
    verdict = "PASS" if row["passed"] else "**FAIL**"
    cells = (row["attack"], f"{row['tried']:,}", row["target"], seen, verdict)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
